//! Protobuf, against messages that `prost-reflect` encodes: random message types and values are read back as the same
//! numbers. Corners of the wire format are written byte by byte.

use std::fmt::Write as _;

use proptest::prelude::*;
use prost::Message as _;
use prost_reflect::{DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor, Value};
use stillpoint::imu::{Decoder, Layout, Malformed, Place, SchemaError};
use stillpoint::record::Schema;

/// Descriptor set of a `.proto` file.
pub(super) fn compile(text: &str) -> Vec<u8> {
    struct Source(String);
    impl protox::file::FileResolver for Source {
        fn open_file(&self, name: &str) -> Result<protox::file::File, protox::Error> {
            protox::file::File::from_source(name, &self.0)
        }
    }
    let mut compiler = protox::Compiler::with_file_resolver(Source(text.to_owned()));
    compiler.include_imports(true).open_file("t.proto").unwrap_or_else(|e| panic!("{e}: {text}"));
    compiler.file_descriptor_set().encode_to_vec()
}

fn parse(name: &str, data: Vec<u8>) -> Result<Layout, SchemaError> {
    let schema = Schema { id: 1, name: name.into(), encoding: "protobuf".into(), data };
    Layout::new("protobuf", Some(&schema))
}

fn layout(text: &str) -> Layout {
    // The package comes behind the syntax, if that is said.
    let text = match text.split_once("\"proto3\";") {
        Some((_, messages)) => format!("syntax = \"proto3\"; package t; {messages}"),
        None => format!("package t; {text}"),
    };
    parse("t.Root", compile(&text)).unwrap()
}

fn decoder(layout: &Layout, paths: &[&str]) -> Decoder {
    let places: Vec<_> = paths.iter().map(|path| layout.number(&path.parse().unwrap()).unwrap()).collect();
    Decoder::new(layout, &places, None).unwrap()
}

#[track_caller]
fn reads(text: &str, paths: &[&str], message: &[u8], expected: &[f64]) {
    let mut numbers = vec![-77.0; paths.len()];
    decoder(&layout(text), paths).read(message, &mut numbers).unwrap();
    assert_eq!(format!("{numbers:?}"), format!("{expected:?}"));
}

#[test]
fn of_a_number_that_comes_twice_the_last_counts_and_messages_are_merged() {
    let text = "syntax = \"proto3\"; message V { double x = 1; int32 y = 2; } message Root { int32 a = 1; V v = 2; }";
    let twice = [&[0x08, 1, 0x08, 2][..], &[0x12, 2, 0x10, 5], &[0x12, 9, 0x09], &4_f64.to_le_bytes()].concat();
    reads(text, &["a", "v.x", "v.y"], &twice, &[2.0, 4.0, 5.0]);
}

#[test]
fn what_is_left_out_is_the_default_and_in_a_message_that_is_left_out_nothing() {
    let text =
        "syntax = \"proto3\"; message V { double x = 1; } message Root { double a = 1; V v = 2; optional double o = 3;
                oneof one { double b = 4; double c = 5; } }";
    let nan = f64::NAN;
    reads(text, &["a", "v.x", "o", "b"], &[], &[0.0, nan, 0.0, nan]);
    reads(text, &["a", "v.x", "o", "b"], &[0x12, 0], &[0.0, 0.0, 0.0, nan]);
    let proto2 =
        "enum E { P = 1; Q = 7; } message Root { optional double a = 1 [default = 2.5]; optional E e = 2 [default = Q];
                  optional float f = 3 [default = inf]; required int32 r = 4; optional bool b = 5 [default = true]; }";
    reads(proto2, &["a", "e", "f", "r"], &[], &[2.5, 7.0, f64::INFINITY, 0.0]);
}

#[test]
fn lists_may_be_packed_or_not_whatever_the_schema_says() {
    for text in [
        "syntax = \"proto3\"; message Root { repeated sint32 a = 1; }",
        "syntax = \"proto3\"; message Root { repeated sint32 a = 1 [packed = false]; }",
    ] {
        let mixed = [&[0x0a, 2, 2, 1][..], &[0x08, 6], &[0x0a, 0], &[0x0a, 3, 0xff, 0x01, 8]].concat();
        reads(
            text,
            &["a[0]", "a[1]", "a[2]", "a[3]", "a[4]", "a[5]"],
            &mixed,
            &[1.0, -1.0, 3.0, -128.0, 4.0, f64::NAN],
        );
    }
}

#[test]
fn elements_of_lists_of_messages_are_counted() {
    let text =
        "syntax = \"proto3\"; message V { int32 x = 1; repeated int32 y = 2; } message Root { repeated V v = 1; }";
    let message = [&[0x0a, 2, 0x08, 1][..], &[0x0a, 0], &[0x0a, 5, 0x12, 1, 7, 0x10, 8]].concat();
    reads(text, &["v[0].x", "v[1].x", "v[2].x", "v[2].y[1]", "v[3].x"], &message, &[1.0, 0.0, 0.0, 8.0, f64::NAN]);
}

#[test]
fn unknown_fields_groups_and_wrong_wire_types_are_skipped() {
    let text = "syntax = \"proto3\"; message Root { int32 a = 1; double b = 2; }";
    let unknown = [
        &[0x98, 0x06, 0xff, 0x01][..],                  // 99: varint
        &[0x9b, 0x06, 0x1b, 0x08, 9, 0x1c, 0x9c, 0x06], // 99: a group with a group and a field 1 in it
        &[0x0a, 3, 1, 2, 3],                            // 1, but as bytes
        &[0x10, 5],                                     // 2, but as a varint
        &[0x9a, 0x06, 2, 0x08, 9],                      // 99: bytes that look like field 1
        &[0x08, 3],
    ]
    .concat();
    reads(text, &["a", "b"], &unknown, &[3.0, 0.0]);
}

#[test]
fn integers_of_all_codings_keep_their_signs() {
    let text =
        "syntax = \"proto3\"; message Root { int32 a = 1; int64 b = 2; sint64 c = 3; uint32 d = 4; sfixed32 e = 5;
                fixed64 f = 6; }";
    let minus_one = [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01];
    let message = [
        &[0x08][..],
        &minus_one,
        &[0x10],
        &minus_one,
        &[0x18, 3],
        &[0x20, 0xff, 0xff, 0xff, 0xff, 0x1f],
        &[0x2d, 0xfe, 0xff, 0xff, 0xff],
        &[0x31, 1, 0, 0, 0, 0, 0, 0, 0x80],
    ]
    .concat();
    let expected = [-1.0, -1.0, -2.0, 4_294_967_295.0, -2.0, 9_223_372_036_854_775_808.0];
    reads(text, &["a", "b", "c", "d", "e", "f"], &message, &expected);
}

#[test]
fn what_is_no_protobuf_is_refused_with_the_place() {
    let decoder =
        decoder(&layout("syntax = \"proto3\"; message V { double x = 1; } message Root { V v = 1; }"), &["v.x"]);
    let refused = |message: &[u8]| decoder.read(message, &mut [0.0]).unwrap_err();
    assert_eq!(refused(&[0x0a, 9, 0x09]), Malformed::Truncated { offset: 2, wanted: 9, len: 3 });
    assert_eq!(refused(&[0x0a, 3, 0x09, 0, 0]), Malformed::Truncated { offset: 3, wanted: 8, len: 5 });
    assert_eq!(refused(&[0x10]), Malformed::Truncated { offset: 1, wanted: 1, len: 1 });
    let protobuf = |offset, what| Malformed::Protobuf { offset, what };
    assert_eq!(refused(&[0x00]), protobuf(0, "an impossible field number"));
    assert_eq!(
        refused(&[0x10, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0]),
        protobuf(1, "a number of more than ten bytes")
    );
    assert_eq!(refused(&[0x14]), protobuf(1, "the end of a group that never began"));
    assert_eq!(refused(&[0x13, 0x1c]), protobuf(1, "a group that ends as another"));
    assert_eq!(refused(&[0x17]), protobuf(1, "an unknown wire type"));
    assert_eq!(refused(&[0x13]), Malformed::Truncated { offset: 1, wanted: 1, len: 1 });
}

#[test]
fn what_no_path_leads_into_is_named() {
    let text =
        "message Root { map<string, int32> m = 1; optional bytes b = 2; optional group G = 3 { optional int32 x = 1; }
                optional Root r = 4; optional int32 a = 5; }";
    let layout = layout(text);
    let why = |path: &str| layout.number(&path.parse().unwrap()).unwrap_err().to_string();
    assert_eq!(why("b"), "`b` of t.Root is bytes, not a number");
    assert_eq!(why("r"), "`r` of t.Root is a message inside itself, not a number");
    assert!(why("m").contains("a map[]"), "{}", why("m"));
    assert!(why("g").contains("is a group"), "{}", why("g"));
}

#[test]
fn schemas_that_contradict_themselves_are_refused_with_the_reason() {
    let refused = |name: &str, data: Vec<u8>| parse(name, data).unwrap_err().to_string();
    let set = compile("syntax = \"proto3\"; package t; message Root { int32 a = 1; }");
    assert_eq!(refused("t.Other", set.clone()), "schema t.Other: t.Other is not in the descriptor set");
    assert!(refused("t.Root", set[..set.len() - 3].to_vec()).contains("is not a descriptor set"));
    let changed = |change: fn(&mut prost_types::DescriptorProto)| {
        let mut set = prost_types::FileDescriptorSet::decode(&*set).unwrap();
        change(&mut set.file[0].message_type[0]);
        set.encode_to_vec()
    };
    let twice = changed(|message| message.field.push(message.field[0].clone()));
    assert!(refused("t.Root", twice).contains("has two fields `a` or numbered 1"));
    let zero = changed(|message| message.field[0].number = Some(0));
    assert!(refused("t.Root", zero).contains("has the impossible number 0"));
    let missing = changed(|message| {
        message.field[0].set_type(prost_types::field_descriptor_proto::Type::Message);
        message.field[0].type_name = Some(".t.Gone".into());
    });
    assert!(refused("t.Root", missing).contains("t.Gone is not in the descriptor set"));
    let untyped = changed(|message| message.field[0].r#type = None);
    assert!(refused("t.Root", untyped).contains("t.Root.a: has no known type"));
}

/// A field of a random message: its type, and whether it is a list.
#[derive(Clone, Debug)]
struct Field {
    kind: Type,
    list: Option<bool>,
}

#[derive(Clone, Debug)]
enum Type {
    Scalar(&'static str),
    Message(Vec<Field>),
}

fn fields() -> impl Strategy<Value = Vec<Field>> {
    const SCALARS: [&str; 15] = [
        "double", "float", "int32", "int64", "uint32", "uint64", "sint32", "sint64", "fixed32", "fixed64", "sfixed32",
        "sfixed64", "bool", "string", "bytes",
    ];
    let scalar = prop::sample::select(&SCALARS[..]).prop_map(Type::Scalar);
    let list = || prop_oneof![3 => Just(None), 1 => any::<bool>().prop_map(Some)];
    let field = move |kind| (kind, list()).prop_map(|(kind, list)| Field { kind, list });
    let kind =
        scalar.prop_recursive(3, 24, 6, move |inner| prop::collection::vec(field(inner), 0..6).prop_map(Type::Message));
    prop::collection::vec((kind, list()).prop_map(|(kind, list)| Field { kind, list }), 0..8)
}

fn proto(fields: &[Field]) -> String {
    fn message(name: &str, fields: &[Field], text: &mut String) {
        writeln!(text, "message {name} {{").unwrap();
        for (i, Field { kind, list }) in fields.iter().enumerate() {
            let kind = match kind {
                Type::Scalar(name) => (*name).to_owned(),
                Type::Message(inner) => {
                    message(&format!("M{i}"), inner, text);
                    format!("M{i}")
                }
            };
            let is_packable = !matches!(kind.as_str(), "string" | "bytes") && !kind.starts_with('M');
            let (label, packed) = match list {
                None => ("", String::new()),
                Some(packed) if is_packable => ("repeated ", format!(" [packed = {packed}]")),
                Some(_) => ("repeated ", String::new()),
            };
            writeln!(text, "{label}{kind} f{i} = {}{packed};", i * 17 + 1).unwrap();
        }
        text.push_str("}\n");
    }
    let mut text = "syntax = \"proto3\"; package t;\n".to_owned();
    message("Root", fields, &mut text);
    text
}

/// A message with random values, and the numbers in it by path.
struct Filler {
    random: u64,
    numbers: Vec<(String, f64)>,
}

impl Filler {
    fn next(&mut self) -> u64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.random ^ self.random >> 29
    }

    fn message(&mut self, of: MessageDescriptor, path: &str) -> DynamicMessage {
        let mut message = DynamicMessage::new(of.clone());
        for field in of.fields() {
            let path = format!("{path}{}{}", if path.is_empty() { "" } else { "." }, field.name());
            if field.is_list() {
                let list = (0..self.next() % 4).map(|i| self.value(&field, &format!("{path}[{i}]")));
                message.set_field(&field, Value::List(list.collect()));
            } else {
                let value = self.value(&field, &path);
                message.set_field(&field, value);
            }
        }
        message
    }

    fn value(&mut self, field: &FieldDescriptor, path: &str) -> Value {
        let bits = self.next();
        let (value, number) = match field.kind() {
            Kind::Double => (Value::F64(bits as i64 as f64 / 3.0), bits as i64 as f64 / 3.0),
            Kind::Float => (Value::F32(bits as i32 as f32 / 3.0), f64::from(bits as i32 as f32 / 3.0)),
            Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => (Value::I32(bits as i32), f64::from(bits as i32)),
            Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => (Value::I64(bits as i64), bits as i64 as f64),
            Kind::Uint32 | Kind::Fixed32 => (Value::U32(bits as u32), f64::from(bits as u32)),
            Kind::Uint64 | Kind::Fixed64 => (Value::U64(bits), bits as f64),
            Kind::Bool => return Value::Bool(bits & 1 == 1),
            Kind::String => return Value::String("x".repeat(bits as usize % 5)),
            Kind::Bytes => return Value::Bytes(vec![bits as u8; bits as usize % 5].into()),
            Kind::Message(inner) => return Value::Message(self.message(inner, path)),
            Kind::Enum(_) => unreachable!(),
        };
        self.numbers.push((path.to_owned(), number));
        value
    }
}

proptest! {
    #![proptest_config(super::cases(200))]

    #[test]
    fn numbers_are_read_as_they_were_written(fields in fields(), random: u64) {
        let set = compile(&proto(&fields));
        let pool = DescriptorPool::decode(&*set).unwrap();
        let mut filler = Filler { random, numbers: Vec::new() };
        let message = filler.message(pool.get_message_by_name("t.Root").unwrap(), "");
        let payload = message.encode_to_vec();
        let layout = parse("t.Root", set).unwrap();
        let places: Vec<Place> = filler.numbers.iter().map(|(p, _)| layout.number(&p.parse().unwrap()).unwrap()).collect();
        for (written, place) in filler.numbers.chunks(12).zip(places.chunks(12)) {
            // More parts than a decoder is made for are refused; a few at a time are not.
            let decoder = Decoder::new(&layout, place, None).unwrap();
            let mut found = vec![f64::NAN; place.len()];
            decoder.read(&payload, &mut found).unwrap();
            for ((path, written), read) in written.iter().zip(&found) {
                prop_assert_eq!(written, read, "{}", path);
            }
            for len in 0..payload.len() {
                let _ = decoder.read(&payload[..len], &mut found);
            }
        }
    }
}

#[test]
fn rewritten_numbers_read_as_told_even_where_zeros_were_left_out() {
    let text = "syntax = \"proto3\"; message V { double x = 1; double y = 2; float z = 3; } \
                message In { V v = 2; } message Root { In in = 1; string name = 3; repeated double list = 4; int32 n = 5; }";
    let paths = ["in.v.x", "in.v.y", "in.v.z", "list[1]", "n"];
    let pool =
        DescriptorPool::decode(compile(&text.replacen("\"proto3\";", "\"proto3\"; package t;", 1)).as_slice()).unwrap();
    let root = pool.get_message_by_name("t.Root").unwrap();
    let mut message = DynamicMessage::new(root.clone());
    let set = |message: &mut DynamicMessage, name: &str, value| message.set_field_by_name(name, value);
    let mut v = DynamicMessage::new(pool.get_message_by_name("t.V").unwrap());
    // x is zero, and so is not there.
    set(&mut v, "y", Value::F64(2.0));
    set(&mut v, "z", Value::F32(3.0));
    let mut inner = DynamicMessage::new(pool.get_message_by_name("t.In").unwrap());
    set(&mut inner, "v", Value::Message(v));
    set(&mut message, "in", Value::Message(inner));
    set(&mut message, "name", Value::String("imu".into()));
    set(&mut message, "list", Value::List(vec![Value::F64(0.0), Value::F64(0.0)]));
    set(&mut message, "n", Value::I32(4));
    let bytes = message.encode_to_vec();

    let decoder = decoder(&layout(text), &paths);
    let told = [(0, 1.5), (1, -2.5), (2, 0.25), (3, 8.0)];
    let rewritten = decoder.rewrite(&bytes, paths.len(), &told).unwrap();
    let read = DynamicMessage::decode(root, rewritten.as_slice()).unwrap();
    let field = |message: &DynamicMessage, name: &str| message.get_field_by_name(name).unwrap().into_owned();
    let inner = field(&read, "in");
    let v = field(inner.as_message().unwrap(), "v");
    let v = v.as_message().unwrap();
    assert_eq!([field(v, "x"), field(v, "y"), field(v, "z")], [Value::F64(1.5), Value::F64(-2.5), Value::F32(0.25)]);
    assert_eq!(field(&read, "list"), Value::List(vec![Value::F64(0.0), Value::F64(8.0)]));
    assert_eq!((field(&read, "name"), field(&read, "n")), (Value::String("imu".into()), Value::I32(4)));
    assert_eq!(decoder.rewrite(&bytes, paths.len(), &[(4, 1.0)]), None, "an integer cannot hold it");
}
