//! A reader of ROS 2 messages that knows nothing but the text of a schema, as any reader of a recording does. It shares
//! no code with the library.

use std::collections::{BTreeMap, HashMap};

/// A decoded value. NaN equals NaN.
#[derive(Clone, Debug)]
pub enum Value {
    Bool(bool),
    Integer(i128),
    Float(f64),
    Text(String),
    Sequence(Vec<Value>),
    Message(BTreeMap<String, Value>),
}

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Bool(a), Self::Bool(b)) => a == b,
            (Self::Integer(a), Self::Integer(b)) => a == b,
            (Self::Float(a), Self::Float(b)) => a == b || (a.is_nan() && b.is_nan()),
            (Self::Text(a), Self::Text(b)) => a == b,
            (Self::Sequence(a), Self::Sequence(b)) => a == b,
            (Self::Message(a), Self::Message(b)) => a == b,
            _ => false,
        }
    }
}

/// The definitions in a schema.
pub struct Schema {
    root: String,
    types: HashMap<String, Definition>,
}

/// Fields in order, as (type, name), and constants by name.
#[derive(Default)]
struct Definition {
    fields: Vec<(String, String)>,
    constants: BTreeMap<String, i128>,
}

impl Schema {
    pub fn parse(name: &str, text: &str) -> Self {
        let root = name.replacen("/msg/", "/", 1);
        let (mut current, mut types) = (root.clone(), HashMap::new());
        types.insert(root.clone(), Definition::default());
        for line in text.lines() {
            if let Some(next) = line.strip_prefix("MSG: ") {
                current = next.to_owned();
                assert!(types.insert(current.clone(), Definition::default()).is_none(), "{current} is defined twice");
                continue;
            }
            let line = line.split('#').next().unwrap().trim();
            if line.is_empty() || line.starts_with("====") {
                continue;
            }
            let (kind, rest) = line.split_once(' ').unwrap();
            let definition = types.get_mut(&current).unwrap();
            match rest.split_once('=') {
                Some((name, value)) => {
                    assert!(name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_'), "{name}");
                    let value = value.parse().unwrap();
                    assert!(definition.constants.insert(name.to_owned(), value).is_none(), "{name} twice");
                }
                None => definition.fields.push((kind.to_owned(), rest.trim().to_owned())),
            }
        }
        Self { root, types }
    }

    /// The constants of the type that the schema is about.
    pub fn constants(&self) -> &BTreeMap<String, i128> {
        &self.types[&self.root].constants
    }

    /// Decodes a message to its last byte.
    pub fn decode(&self, bytes: &[u8]) -> Value {
        assert_eq!(&bytes[..4], [0, 1, 0, 0], "little-endian CDR");
        let mut cursor = Cursor { body: &bytes[4..], at: 0 };
        let value = self.read(&self.root, &mut cursor);
        assert_eq!(cursor.at, cursor.body.len(), "bytes left over");
        value
    }

    fn read(&self, kind: &str, cursor: &mut Cursor) -> Value {
        if let Some(element) = kind.strip_suffix("[]") {
            let length = u32::from_le_bytes(cursor.take());
            return Value::Sequence((0..length).map(|_| self.read(element, cursor)).collect());
        }
        match kind {
            "bool" => match u8::from_le_bytes(cursor.take()) {
                0 => Value::Bool(false),
                1 => Value::Bool(true),
                other => panic!("{other} is not a bool"),
            },
            "uint8" => Value::Integer(u8::from_le_bytes(cursor.take()).into()),
            "int32" => Value::Integer(i32::from_le_bytes(cursor.take()).into()),
            "uint32" => Value::Integer(u32::from_le_bytes(cursor.take()).into()),
            "uint64" => Value::Integer(u64::from_le_bytes(cursor.take()).into()),
            "float64" => Value::Float(f64::from_le_bytes(cursor.take())),
            "string" => Value::Text(cursor.text()),
            message => {
                let definition = self.types.get(message).unwrap_or_else(|| panic!("{message} is not defined"));
                let read = |(kind, name): &(String, String)| (name.clone(), self.read(kind, cursor));
                Value::Message(definition.fields.iter().map(read).collect())
            }
        }
    }
}

struct Cursor<'a> {
    body: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        while !self.at.is_multiple_of(N) {
            assert_eq!(self.body[self.at], 0, "padding");
            self.at += 1;
        }
        self.at += N;
        self.body[self.at - N..self.at].try_into().unwrap()
    }

    fn text(&mut self) -> String {
        let length = u32::from_le_bytes(self.take()) as usize;
        let (text, end) = self.body[self.at..self.at + length].split_at(length - 1);
        assert_eq!(end, [0], "terminator");
        self.at += length;
        String::from_utf8(text.to_vec()).unwrap()
    }
}
