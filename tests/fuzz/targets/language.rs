//! Schemas made from arbitrary bytes, in each language.

use arbitrary::{Result, Unstructured};
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, MessageOptions};
use stillpoint::record::Schema;

/// Encoding of messages, and language of the schema.
type Language = (&'static str, &'static str);

const LANGUAGES: [Language; 5] =
    [("cdr", "ros2msg"), ("ros1", "ros1msg"), ("cdr", "ros2idl"), ("protobuf", "protobuf"), ("json", "jsonschema")];

/// Encoding of messages, and their schema: of words of its language, or of any bytes.
pub fn schema(u: &mut Unstructured<'_>) -> Result<(&'static str, Schema)> {
    let (messages, language) = *u.choose(&LANGUAGES)?;
    let data = match language {
        _ if u.ratio(1, 8)? => {
            let length = u.arbitrary_len::<u8>()?;
            u.bytes(length)?.to_vec()
        }
        "protobuf" => descriptors(u)?,
        "jsonschema" => words(JSON, u)?,
        "ros2idl" => words(IDL, u)?,
        _ => words(ROS, u)?,
    };
    let name = if language == "protobuf" { "p.R" } else { "p/msg/R" };
    Ok((messages, Schema { id: 1, name: name.into(), encoding: language.into(), data }))
}

fn words(words: &[&str], u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let count = u.int_in_range(0..=80)?;
    let text: Result<String> = (0..count).map(|_| u.choose(words).copied()).collect();
    Ok(text?.into_bytes())
}

const ROS: &[&str] = &[
    "p/R r\n",
    "p/A a\n",
    "A b\n",
    "p/A[] c\n",
    "p/A[9] d\n",
    "p/A[<=3] e\n",
    "uint8 f\n",
    "float64 x\n",
    "float64 y\n",
    "float64 z\n",
    "float32[3] g\n",
    "float64[] h\n",
    "float64[4294967295] i\n",
    "string s\n",
    "string<=5 t\n",
    "wstring w\n",
    "bool k\n",
    "char l\n",
    "byte m\n",
    "int64[2] n\n",
    "time o\n",
    "duration q\n",
    "Header header\n",
    "builtin_interfaces/Time stamp\n",
    "uint8 X=1\n",
    "string Y='a # b'\n",
    "float64 v 1.5\n",
    "===\n",
    "================================================================================\n",
    "MSG: p/A\n",
    "MSG: p/R\n",
    "MSG: std_msgs/Header\n",
    "MSG: geometry_msgs/Vector3\n",
    "geometry_msgs/Vector3 linear_acceleration\n",
    "geometry_msgs/Vector3[] list\n",
    "# text\n",
    "\n",
    " ",
    "\t",
    "\r\n",
    "[",
    "]",
    "é",
    "\u{0}",
    "99999999999999999999",
];

const IDL: &[&str] = &[
    "module p { ",
    "module msg { ",
    "struct R { ",
    "struct A { ",
    "}; ",
    "typedef double D[3]; ",
    "typedef sequence<A> L; ",
    "typedef R Q; ",
    "typedef Q R; ",
    "enum E { e1, e2 }; ",
    "const long N = 3; ",
    "union U switch (long) { case 1: long a; }; ",
    "bitmask B { f }; ",
    "double x; ",
    "double y; ",
    "double z; ",
    "float a[3]; ",
    "double n[N]; ",
    "D d; ",
    "L l; ",
    "A s; ",
    "R r; ",
    "p::msg::A t; ",
    "::p::msg::R w; ",
    "sequence<double> b; ",
    "sequence<A, 3> c; ",
    "string<5> e; ",
    "wstring f; ",
    "long long g; ",
    "unsigned short h; ",
    "octet i; ",
    "boolean k; ",
    "E j; ",
    "sequence<sequence<long>> m; ",
    "double o[4294967295]; ",
    "double q[2][3]; ",
    "@optional ",
    "@appendable ",
    "@mutable ",
    "@final ",
    "@key ",
    "@verbatim(language=\"comment\", text=\"a\" \"b\") ",
    "@default(value=1) ",
    "// text\n",
    "/* text */ ",
    "/*",
    "#include \"a.idl\"\n",
    "IDL: p/msg/A\n",
    "================================================================================\n",
    "{",
    "}",
    "(",
    ")",
    "<",
    ">",
    ";",
    ",",
    "\"",
    "'",
    "\\",
    "é",
    "\u{0}",
    "0x10",
    "99999999999999999999",
    ": A ",
];

const JSON: &[&str] = &[
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "{\"type\":\"object\",\"properties\":{",
    "\"properties\":",
    "\"type\":",
    "\"object\"",
    "\"number\"",
    "\"integer\"",
    "\"array\"",
    "\"string\"",
    "\"x\":",
    "\"y\":",
    "\"z\":",
    "\"a\":",
    "{\"type\":\"number\"}",
    "{\"type\":\"array\",\"items\":{\"type\":\"number\"}}",
    "\"items\":",
    "\"$ref\":\"#\"",
    "\"$ref\":\"#/definitions/A\"",
    "\"$ref\":\"#/$defs/A\"",
    "\"definitions\":{\"A\":",
    "\"$defs\":{\"A\":",
    "\"allOf\":[",
    "\"oneOf\":[",
    "\"minItems\":3",
    "\"prefixItems\":[",
    "true",
    "null",
    "1e999",
    "\"\\ud800\"",
    "\"~1\"",
    "é",
    "\u{0}",
    " ",
];

fn descriptors(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let mut files = Vec::new();
    for _ in 0..u.int_in_range(0..=2)? {
        let mut file = FileDescriptorProto {
            name: Some((*u.choose(&["a.proto", "b.proto"])?).to_owned()),
            package: Some((*u.choose(&["p", "", "p.q"])?).to_owned()),
            syntax: u.arbitrary::<bool>()?.then(|| "proto3".to_owned()),
            ..FileDescriptorProto::default()
        };
        if u.arbitrary()? {
            file.dependency = vec![(*u.choose(&["a.proto", "b.proto", "none.proto"])?).to_owned()];
        }
        for _ in 0..u.int_in_range(0..=3)? {
            file.message_type.push(message(u, 0)?);
        }
        files.push(file);
    }
    let mut bytes = FileDescriptorSet { file: files }.encode_to_vec();
    if u.ratio(1, 4)? && !bytes.is_empty() {
        let at = u.choose_index(bytes.len())?;
        bytes[at] = u.arbitrary()?;
    }
    Ok(bytes)
}

fn message(u: &mut Unstructured<'_>, depth: u32) -> Result<DescriptorProto> {
    let mut message = DescriptorProto { name: Some((*u.choose(&["R", "A", "V"])?).to_owned()), ..Default::default() };
    for _ in 0..u.int_in_range(0..=6)? {
        message.field.push(FieldDescriptorProto {
            name: Some((*u.choose(&["x", "y", "z", "a", "r", "stamp"])?).to_owned()),
            number: Some(*u.choose(&[1, 2, 3, 4, 5, 15, 16, 536_870_911, 0, -1, i32::MAX])?),
            label: Some(*u.choose(&[Label::Optional, Label::Repeated, Label::Required])? as i32),
            r#type: match u.ratio(1, 10)? {
                true => None,
                false => Some(u.int_in_range(Type::Double as i32..=Type::Sint64 as i32)?),
            },
            type_name: match u.ratio(1, 2)? {
                true => Some(
                    (*u.choose(&[".p.R", ".p.A", ".p.V", "A", ".p.R.A", ".google.protobuf.Timestamp", ""])?).to_owned(),
                ),
                false => None,
            },
            oneof_index: u.ratio(1, 12)?.then_some(0),
            ..Default::default()
        });
    }
    if depth < 3 && u.ratio(1, 4)? {
        message.nested_type.push(self::message(u, depth + 1)?);
    }
    if u.ratio(1, 16)? {
        message.options = Some(MessageOptions { map_entry: Some(true), ..Default::default() });
    }
    Ok(message)
}
