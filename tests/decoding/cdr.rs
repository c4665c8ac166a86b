//! Decoding against an independent encoder: random message types and values, written byte by byte in each encoding,
//! are read back as the same numbers, and no truncation goes unnoticed.

use std::fmt::Write as _;

use proptest::prelude::*;
use stillpoint::imu::{Decoder, FieldPath, Layout, Malformed, Place};
use stillpoint::record::Schema;

#[derive(Clone, Debug)]
pub(super) enum Kind {
    Number(&'static str),
    Text,
    WideText,
    Message(Vec<Field>, Evolution),
}

/// What IDL says of later versions of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Evolution {
    Unsaid,
    Final,
    Appendable,
}

#[derive(Clone, Debug)]
pub(super) struct Field {
    kind: Kind,
    list: List,
}

#[derive(Clone, Copy, Debug)]
enum List {
    No,
    Array(usize),
    Sequence(usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wire {
    Xcdr1 { big: bool },
    Xcdr2 { big: bool, delimited: bool },
    Ros1,
}

/// In which a schema is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Language {
    Msg,
    Idl,
}

fn numbers() -> impl Strategy<Value = Kind> {
    const NAMES: [&str; 11] =
        ["bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"];
    prop::sample::select(&NAMES[..]).prop_map(Kind::Number)
}

/// Fields of a message; with `wide`, some may be wide texts.
pub(super) fn fields(wide: bool) -> impl Strategy<Value = Vec<Field>> {
    let list = || prop_oneof![4 => Just(List::No), 1 => (1..4usize).prop_map(List::Array), 1 => (0..4usize).prop_map(List::Sequence)];
    let field = move |kind| (kind, list()).prop_map(|(kind, list)| Field { kind, list });
    let leaf = prop_oneof![12 => numbers(), 4 => Just(Kind::Text), u32::from(wide) => Just(Kind::WideText)];
    let evolution = || prop::sample::select(vec![Evolution::Unsaid, Evolution::Final, Evolution::Appendable]);
    let kind = leaf.prop_recursive(3, 24, 5, move |inner| {
        (prop::collection::vec(field(inner), 0..5), evolution())
            .prop_map(|(fields, evolution)| Kind::Message(fields, evolution))
    });
    // A message without fields is no layout.
    prop::collection::vec(field(kind.boxed()), 1..6)
}

pub(super) fn wires() -> impl Strategy<Value = Wire> {
    prop_oneof![
        any::<bool>().prop_map(|big| Wire::Xcdr1 { big }),
        any::<[bool; 2]>().prop_map(|[big, delimited]| Wire::Xcdr2 { big, delimited }),
        Just(Wire::Ros1)
    ]
}

pub(super) fn languages() -> impl Strategy<Value = Language> {
    prop::sample::select(vec![Language::Msg, Language::Idl])
}

/// Schema text of a message and the messages inside it, with what real ones have around the fields.
fn schema(fields: &[Field]) -> String {
    fn message(fields: &[Field], text: &mut String, later: &mut Vec<(String, Vec<Field>)>, named: &mut usize) {
        text.push_str("# a comment\r\nuint8 CONSTANT=7 # not a field\n\n");
        for (i, Field { kind, list }) in fields.iter().enumerate() {
            let base = match kind {
                Kind::Number(name) => (*name).to_owned(),
                Kind::Text => "string".to_owned(),
                Kind::WideText => "wstring".to_owned(),
                Kind::Message(inner, _) => {
                    *named += 1;
                    later.push((format!("M{named}"), inner.clone()));
                    format!("{}M{named}", ["", "pkg/", "pkg/msg/"][i % 3])
                }
            };
            let list = match list {
                List::No => String::new(),
                List::Array(n) => format!("[{n}]"),
                List::Sequence(_) => ["[]", "[<=9]"][i % 2].to_owned(),
            };
            writeln!(text, "{base}{list} f{i} # unit: m/s^2\r").unwrap();
        }
    }
    let (mut text, mut later, mut named) = (String::new(), Vec::new(), 0);
    message(fields, &mut text, &mut later, &mut named);
    while let Some((name, fields)) = later.pop() {
        writeln!(text, "{}\nMSG: pkg/{name}", "=".repeat(80)).unwrap();
        message(&fields, &mut text, &mut later, &mut named);
    }
    text
}

/// The same in IDL, as `rosidl` writes it, with annotations.
fn idl(fields: &[Field]) -> String {
    fn message(name: &str, fields: &[Field], evolution: Evolution, text: &mut String, named: &mut usize) {
        let (mut before, mut body) = (String::new(), String::new());
        for (i, Field { kind, list }) in fields.iter().enumerate() {
            let base = match kind {
                Kind::Number(name) => match *name {
                    "bool" => "boolean",
                    "int8" => "int8",
                    "uint8" => ["uint8", "octet"][i % 2],
                    "int16" => ["int16", "short"][i % 2],
                    "uint16" => ["uint16", "unsigned short"][i % 2],
                    "int32" => ["int32", "long"][i % 2],
                    "uint32" => ["uint32", "unsigned long"][i % 2],
                    "int64" => ["int64", "long long"][i % 2],
                    "uint64" => ["uint64", "unsigned long long"][i % 2],
                    "float32" => "float",
                    _ => "double",
                }
                .to_owned(),
                Kind::Text => ["string", "string<9>"][i % 2].to_owned(),
                Kind::WideText => "wstring".to_owned(),
                Kind::Message(inner, evolution) => {
                    *named += 1;
                    let name = format!("M{named}");
                    message(&name, inner, *evolution, text, named);
                    format!("pkg::msg::{name}")
                }
            };
            let field = match list {
                List::No => format!("{base} f{i}"),
                List::Array(n) => {
                    writeln!(before, "    typedef {base} {name}_f{i}[{n}];").unwrap();
                    format!("{name}_f{i} f{i}")
                }
                List::Sequence(_) => format!("sequence<{base}{}> f{i}", ["", ", 9"][i % 2]),
            };
            writeln!(
                body,
                "      @verbatim (language=\"comment\", text=\n        \"a {{ comment }};\")\n      {field};"
            )
            .unwrap();
        }
        if fields.is_empty() {
            body.push_str("      uint8 structure_needs_at_least_one_member;\n");
        }
        let annotation = match evolution {
            Evolution::Unsaid => "",
            Evolution::Final => "@final ",
            Evolution::Appendable => "@appendable ",
        };
        let rule = "=".repeat(80);
        writeln!(text, "{rule}\nIDL: pkg/msg/{name}\n#include \"x.idl\"\nmodule pkg {{\n  module msg {{\n{before}    {annotation}struct {name} {{\n{body}    }};\n  }};\n}};").unwrap();
    }
    let mut text = String::new();
    message("Root", fields, Evolution::Unsaid, &mut text, &mut 0);
    text
}

/// Writes a message as the standards say, one value after the other, and notes where the values are.
pub(super) struct Encoder {
    wire: Wire,
    language: Language,
    body: Vec<u8>,
    random: u64,
    /// By path; those of truth values are NaN.
    pub(super) numbers: Vec<(String, f64)>,
    texts: Vec<(String, Vec<u8>)>,
    wide: bool,
}

impl Encoder {
    /// A message with random values.
    pub(super) fn new(fields: &[Field], wire: Wire, language: Language, random: u64) -> Self {
        let (numbers, texts) = (Vec::new(), Vec::new());
        let mut encoder = Self { wire, language, body: Vec::new(), random, numbers, texts, wide: false };
        encoder.message(fields, "", matches!(wire, Wire::Xcdr2 { delimited: true, .. }));
        encoder
    }

    fn next(&mut self) -> u64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.random ^ self.random >> 29
    }

    fn bytes(&mut self, little_endian: &[u8]) {
        let (big, greatest) = match self.wire {
            Wire::Xcdr1 { big } => (big, 8),
            Wire::Xcdr2 { big, .. } => (big, 4),
            Wire::Ros1 => (false, 1),
        };
        while !self.body.len().is_multiple_of(little_endian.len().min(greatest)) {
            self.body.push(0xaa);
        }
        match big {
            true => self.body.extend(little_endian.iter().rev()),
            false => self.body.extend(little_endian),
        }
    }

    fn number(&mut self, kind: &str) -> f64 {
        let bits = self.next();
        let (bytes, value) = match kind {
            "bool" => (vec![bits as u8 & 1], f64::NAN),
            "int8" => (vec![bits as u8], f64::from(bits as i8)),
            "uint8" => (vec![bits as u8], f64::from(bits as u8)),
            "int16" => ((bits as i16).to_le_bytes().to_vec(), f64::from(bits as i16)),
            "uint16" => ((bits as u16).to_le_bytes().to_vec(), f64::from(bits as u16)),
            "int32" => ((bits as i32).to_le_bytes().to_vec(), f64::from(bits as i32)),
            "uint32" => ((bits as u32).to_le_bytes().to_vec(), f64::from(bits as u32)),
            "int64" => ((bits as i64).to_le_bytes().to_vec(), bits as i64 as f64),
            "uint64" => (bits.to_le_bytes().to_vec(), bits as f64),
            "float32" => ((bits as i32 as f32 / 3.0).to_le_bytes().to_vec(), f64::from(bits as i32 as f32 / 3.0)),
            _ => ((bits as i64 as f64 / 3.0).to_le_bytes().to_vec(), bits as i64 as f64 / 3.0),
        };
        self.bytes(&bytes);
        value
    }

    fn text(&mut self) -> Vec<u8> {
        let len = self.next() % 6;
        let text: Vec<u8> = (0..len).map(|_| b'a' + (self.next() % 26) as u8).collect();
        let terminated = !matches!(self.wire, Wire::Ros1);
        self.bytes(&(text.len() as u32 + u32::from(terminated)).to_le_bytes());
        self.body.extend(&text);
        self.body.extend(terminated.then_some(0));
        text
    }

    fn value(&mut self, kind: &Kind, path: &str) {
        match kind {
            Kind::Number(name) => {
                let value = self.number(name);
                self.numbers.push((path.to_owned(), value));
            }
            Kind::Text => {
                let text = self.text();
                self.texts.push((path.to_owned(), text));
            }
            Kind::WideText => {
                // As ROS 2 writes it, whatever its middleware.
                self.wide = true;
                let len = self.next() % 4;
                self.bytes(&(len as u32).to_le_bytes());
                (0..len).for_each(|_| self.bytes(&[b'a', 0, 0, 0]));
            }
            Kind::Message(fields, evolution) => {
                let evolution = if self.language == Language::Msg { Evolution::Unsaid } else { *evolution };
                let delimited = match self.wire {
                    Wire::Xcdr2 { delimited, .. } => {
                        evolution == Evolution::Appendable || evolution == Evolution::Unsaid && delimited
                    }
                    _ => false,
                };
                self.message(fields, path, delimited);
            }
        }
    }

    fn message(&mut self, fields: &[Field], path: &str, delimited: bool) {
        if delimited {
            self.bytes(&[0; 4]);
        }
        let start = self.body.len();
        self.fields(fields, path);
        let size = (self.body.len() - start) as u32;
        if delimited {
            let big = matches!(self.wire, Wire::Xcdr2 { big: true, .. });
            let size = if big { size.to_be_bytes() } else { size.to_le_bytes() };
            self.body[start - 4..start].copy_from_slice(&size);
        }
    }

    fn fields(&mut self, fields: &[Field], path: &str) {
        if fields.is_empty() && !matches!(self.wire, Wire::Ros1) {
            self.bytes(&[0]);
        }
        for (i, Field { kind, list }) in fields.iter().enumerate() {
            let path = format!("{path}{}f{i}", if path.is_empty() { "" } else { "." });
            let n = match *list {
                List::No => {
                    self.value(kind, &path);
                    continue;
                }
                List::Array(n) | List::Sequence(n) => n,
            };
            let sized = matches!(self.wire, Wire::Xcdr2 { .. }) && !matches!(kind, Kind::Number(_));
            if sized {
                self.bytes(&[0; 4]);
            }
            let start = self.body.len();
            if matches!(list, List::Sequence(_)) {
                self.bytes(&(n as u32).to_le_bytes());
            }
            for element in 0..n {
                self.value(kind, &format!("{path}[{element}]"));
            }
            if sized {
                let big = matches!(self.wire, Wire::Xcdr2 { big: true, .. });
                let size = (self.body.len() - start) as u32;
                let size = if big { size.to_be_bytes() } else { size.to_le_bytes() };
                self.body[start - 4..start].copy_from_slice(&size);
            }
        }
    }

    pub(super) fn payload(&self) -> Vec<u8> {
        let header: &[u8] = match self.wire {
            Wire::Xcdr1 { big: true } => &[0, 0, 0, 0],
            Wire::Xcdr1 { big: false } => &[0, 1, 0, 0],
            Wire::Xcdr2 { big: true, delimited: false } => &[0, 6, 0, 0],
            Wire::Xcdr2 { big: false, delimited: false } => &[0, 7, 0, 0],
            Wire::Xcdr2 { big: true, delimited: true } => &[0, 8, 0, 0],
            Wire::Xcdr2 { big: false, delimited: true } => &[0, 9, 0, 0],
            Wire::Ros1 => &[],
        };
        [header, &self.body].concat()
    }
}

/// Message encoding and schema; ROS 1 knows no IDL.
pub(super) fn described(wire: Wire, language: Language, fields: &[Field]) -> (&'static str, Schema) {
    let (message_encoding, encoding, text) = match (wire, language) {
        (Wire::Ros1, _) => ("ros1", "ros1msg", schema(fields).replace("<=9", "").replace("/msg/", "/")),
        (_, Language::Msg) => ("cdr", "ros2msg", schema(fields)),
        (_, Language::Idl) => ("cdr", "ros2idl", idl(fields)),
    };
    let name = if wire == Wire::Ros1 { "pkg/Root" } else { "pkg/msg/Root" };
    (message_encoding, Schema { id: 1, name: name.into(), encoding: encoding.into(), data: text.into() })
}

fn layout(wire: Wire, language: Language, fields: &[Field]) -> Layout {
    let (message_encoding, schema) = described(wire, language, fields);
    Layout::new(message_encoding, Some(&schema)).unwrap()
}

fn path(text: &str) -> FieldPath {
    text.parse().unwrap()
}

proptest! {
    #![proptest_config(super::cases(400))]

    #[test]
    fn numbers_and_texts_are_read_as_they_were_written(
        (fields, wire) in (any::<bool>(), wires()).prop_flat_map(|(wide, wire)| (fields(wide && wire != Wire::Ros1), Just(wire))),
        language in languages(),
        seed: u64,
    ) {
        let mut encoder = Encoder::new(&fields, wire, language, seed);
        let layout = layout(wire, language, &fields);
        encoder.numbers.retain(|(_, value)| !value.is_nan());
        let places: Vec<Place> = encoder.numbers.iter().map(|(p, _)| layout.number(&path(p)).unwrap()).collect();
        let text = encoder.texts.last().map(|(p, _)| layout.text(&path(p)).unwrap());

        let decoder = Decoder::new(&layout, &places, text.as_ref()).unwrap();
        let payload = encoder.payload();
        let mut found = vec![f64::NAN; places.len()];
        let found_text = match decoder.read(&payload, &mut found) {
            // By chance, another way to write wide texts may fit as well.
            Err(Malformed::WideText) => return Ok(()),
            read => read.unwrap(),
        };
        for ((path, written), read) in encoder.numbers.iter().zip(&found) {
            prop_assert_eq!(written, read, "{}", path);
        }
        prop_assert_eq!(&*found_text, encoder.texts.last().map_or(&[][..], |(_, text)| text));

        // A decoder that wants nothing must still see where the message ends.
        let idle = Decoder::new(&layout, &[], None).unwrap();
        for len in 0..payload.len() {
            let short = [decoder.read(&payload[..len], &mut found).is_err(), idle.read(&payload[..len], &mut []).is_err()];
            prop_assert!(encoder.wide || short == [true; 2], "{} of {}", len, payload.len());
        }
    }

    #[test]
    fn corrupt_bytes_never_panic(
        fields in fields(false), wire in wires(), language in languages(), seed: u64, at: prop::sample::Index, with: u8,
    ) {
        let encoder = Encoder::new(&fields, wire, language, seed);
        let layout = layout(wire, language, &fields);
        let decoder = Decoder::new(&layout, &[], None).unwrap();
        let mut payload = encoder.payload();
        if !payload.is_empty() {
            let at = at.index(payload.len());
            payload[at] = with;
        }
        let _ = decoder.read(&payload, &mut []);
    }

    #[test]
    fn any_text_as_a_schema_is_understood_or_refused(text in "(?s)([a-z]{1,9}(\\[(<=)?[0-9]{0,11}\\])? [a-z_]{1,3}(=[a-z0-9#]{0,3})?[ #\r\n]|={3,9}\n|MSG: [a-z/]{0,5}\n|.){0,30}") {
        for (message_encoding, encoding) in [("cdr", "ros2msg"), ("ros1", "ros1msg")] {
            let data = text.clone().into_bytes();
            let schema = Schema { id: 1, name: "a/b".into(), encoding: encoding.into(), data };
            if let Ok(layout) = Layout::new(message_encoding, Some(&schema)) {
                layout.vectors();
                let _ = Decoder::new(&layout, &[], None).map(|decoder| decoder.read(&[0; 64], &mut []));
            }
        }
    }
}
