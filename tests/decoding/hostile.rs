//! Whatever bytes stand in a schema or a message: no panic, and no memory that they do not justify.

use allocation_counter::measure;
use proptest::prelude::*;
use stillpoint::imu::{Decoder, Layout};
use stillpoint::record::Schema;

const LANGUAGES: [(&str, &str); 5] =
    [("cdr", "ros2msg"), ("ros1", "ros1msg"), ("cdr", "ros2idl"), ("protobuf", "protobuf"), ("json", "jsonschema")];

/// What unrolls from a schema is limited by itself; only beyond this must memory be justified by its length.
const UNROLLED: u64 = 32 << 20;

type Language = (&'static str, &'static str);

/// Understands a schema or refuses it, and compiles a decoder for what it can.
fn understand((message_encoding, encoding): Language, data: &[u8]) -> Option<Decoder> {
    let name = if encoding == "protobuf" { "p.R" } else { "p/msg/R" };
    let schema = Schema { id: 1, name: name.into(), encoding: encoding.into(), data: data.to_vec() };
    let layout = Layout::new(message_encoding, Some(&schema)).ok()?;
    let places: Vec<_> =
        layout.vectors().iter().filter_map(|path| layout.vector(path).ok()).flatten().take(9).collect();
    Decoder::new(&layout, &places, None).ok()
}

/// Text that looks like a schema of any language, here and there.
fn schema_text() -> impl Strategy<Value = String> {
    let words = [
        "module ",
        "struct ",
        "typedef ",
        "enum ",
        "const ",
        "union ",
        "sequence<",
        "string<",
        "double ",
        "octet ",
        "R ",
        "a ",
        "b",
        "p",
        "::",
        "{",
        "}",
        "};",
        ";",
        ";\n",
        ",",
        "<",
        ">",
        "[",
        "]",
        "[3]",
        "[4294967295]",
        "(",
        ")",
        "@",
        "@optional ",
        "@appendable ",
        "\"",
        "'",
        "\\",
        "/*",
        "*/",
        "//",
        "\n",
        "\r\n",
        "#",
        "===\n",
        "IDL: x\n",
        "MSG: p/R\n",
        "uint8 a\n",
        "float64 x\n",
        "float64 y\n",
        "float64 z\n",
        "string s\n",
        "p/R r\n",
        "p/A[] r\n",
        "p/A[9] r\n",
        "MSG: p/A\n",
        "{\"properties\":",
        "{\"type\":\"number\"}",
        "\"x\":",
        "{\"$ref\":\"#\"}",
        "[",
        "]",
        "9",
        "0x",
        "é",
        "\u{0}",
    ];
    prop::collection::vec(prop::sample::select(words.to_vec()), 0..60).prop_map(|words| words.concat())
}

/// A message whose parts have all the shapes that a decoder walks over, in each language.
fn schemas() -> [(Language, Vec<u8>, usize); 5] {
    let ros = "V v\nstring s\nuint8 pad\nfloat64[] n\nstring[] t\nV[] vs\nV[2] pair\nfloat32[3] accel\n===\nMSG: p/V\nfloat64 x\nfloat64 y\nfloat64 z\nuint16[] w\n";
    let idl = "module p { module msg { @appendable struct V { double x; double y; double z; sequence<uint16> w; };
               struct R { V v; string s; octet pad; sequence<double> n; sequence<string> t; sequence<V> vs; V pair[2]; wstring u;
               float accel[3]; }; }; };";
    let proto =
        "syntax = \"proto3\"; package p; message V { double x = 1; double y = 2; double z = 3; repeated uint32 w = 4; }
                 message R { V v = 1; string s = 2; repeated double accel = 3; repeated V vs = 4; sint64 i = 5; }";
    let json = r#"{"properties": {"v": {"properties": {"x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"}}},
                  "accel": {"type": "array", "items": {"type": "number"}}}}"#;
    [
        (LANGUAGES[0], ros.into(), 0),
        (LANGUAGES[1], ros.into(), 0),
        (LANGUAGES[2], idl.into(), 0),
        (LANGUAGES[3], super::protobuf::compile(proto), 0),
        (LANGUAGES[4], json.into(), 64),
    ]
}

proptest! {
    #![proptest_config(super::cases(600))]

    #[test]
    fn any_text_is_understood_or_refused(text in schema_text(), message: [u8; 64]) {
        for language in LANGUAGES {
            let memory = measure(|| {
                if let Some(decoder) = understand(language, text.as_bytes()) {
                    let _ = decoder.read(&message, &mut [0.0; 9]);
                }
            });
            prop_assert!(memory.bytes_max <= UNROLLED + 1000 * text.len() as u64, "{:?}: {:?}", language, memory);
        }
    }

    #[test]
    fn any_bytes_are_understood_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        for language in LANGUAGES {
            let memory = measure(|| drop(understand(language, &bytes)));
            prop_assert!(memory.bytes_max <= UNROLLED + 1000 * bytes.len() as u64);
        }
    }

    /// A schema with one byte changed says something else, mostly, but often something.
    #[test]
    fn damaged_schemas_are_understood_or_refused(at: prop::sample::Index, with: u8, message: [u8; 64]) {
        for (language, mut data, _) in schemas() {
            let at = at.index(data.len());
            data[at] = with;
            if let Some(decoder) = understand(language, &data) {
                let _ = decoder.read(&message, &mut [0.0; 9]);
            }
        }
    }

    /// Not even lengths of billions are believed.
    #[test]
    fn any_bytes_are_a_message_or_refused_without_memory(
        bytes in prop::collection::vec(prop_oneof![3 => any::<u8>(), 1 => Just(0), 1 => Just(255)], 0..300),
        encapsulation in 0..10_u8,
    ) {
        for (language, data, factor) in schemas() {
            let decoder = understand(language, &data).unwrap();
            let mut payload = bytes.clone();
            if matches!(language.0, "cdr") && payload.len() > 2 {
                payload[..2].copy_from_slice(&[0, encapsulation]);
            }
            let memory = measure(|| drop(decoder.read(&payload, &mut [0.0; 9])));
            prop_assert!(memory.bytes_max <= (factor * (payload.len() + 4)) as u64, "{:?}: {:?}", language, memory);
        }
    }
}

#[test]
fn decoders_for_the_damage_tests_read_something() {
    for (language, data, _) in schemas() {
        assert!(understand(language, &data).is_some(), "{:?}", language);
    }
}
