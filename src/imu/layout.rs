//! What the messages of a channel hold, whatever language the schema was written in. How they are laid out in bytes is
//! left to [`Decoder`](super::Decoder).

use super::path::FieldPath;
use super::{descriptor, idl, jsonschema, rosmsg};
use crate::record::Schema;

/// The fields of a message and of the messages inside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    pub(super) wire: Wire,
    /// The root first. No message contains itself.
    pub(super) messages: Vec<Message>,
}

/// How messages become bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wire {
    Cdr,
    Ros1,
    Protobuf,
    Json,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Message {
    /// `package/Type`, or as its language writes it.
    pub(super) name: String,
    pub(super) fields: Vec<Field>,
    pub(super) evolution: Evolution,
}

/// Whether later versions of a message may have more fields, in which case XCDR2 writes its size first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Evolution {
    /// The schema does not say: as the encapsulation of the whole says.
    #[default]
    Unsaid,
    Final,
    Appendable,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) count: Count,
    /// How protobuf writes it; none elsewhere.
    pub(super) tag: Option<Tag>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Number(Number),
    Text,
    /// UTF-16 text, of which writers do not agree on the bytes.
    WideText,
    /// Index into [`Layout::messages`].
    Message(usize),
    /// Something that no path leads into: what, in words. Only where messages can be read past it.
    Unread(&'static str),
}

/// What a protobuf field is written with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tag {
    pub(super) number: u32,
    pub(super) coding: Coding,
    /// What a message that leaves it out says; NaN if that is nothing.
    pub(super) absent: f64,
}

/// How protobuf writes a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum Coding {
    Varint,
    Zigzag,
    Fixed,
}

/// A number as it stands in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum Number {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Count {
    One,
    Array(u32),
    Sequence,
}

/// Where a number or text stands in a layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    pub(super) path: FieldPath,
    pub(super) hops: Vec<Hop>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hop {
    /// Index into [`Message::fields`].
    pub(super) field: usize,
    pub(super) element: Option<u32>,
}

/// Why a channel's messages cannot be understood.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// An unknown message encoding or schema language.
    #[error("the encoding {0} is not read")]
    Encoding(String),
    /// JSON whose schema, if there is one, names no fields: its messages tell, see [`Layout::of_example`].
    #[error("JSON without a schema: its messages tell")]
    Untold,
    /// The channel has no schema.
    #[error("the channel has no schema, which the encoding {0} cannot be read without")]
    Missing(String),
    /// The schema is not text.
    #[error("the schema {name} is not UTF-8 at byte {offset}")]
    NotText {
        /// Of the schema.
        name: String,
        /// Of the first byte that is not.
        offset: usize,
    },
    /// A line of the schema cannot be understood.
    #[error("schema {name}, line {line}: {why}")]
    Line {
        /// Of the schema.
        name: String,
        /// Counted from 1.
        line: usize,
        /// What is wrong with it.
        why: String,
    },
    /// The schema contradicts itself, or leaves something out.
    #[error("schema {name}: {why}")]
    Contradiction {
        /// Of the schema.
        name: String,
        /// What is wrong with it.
        why: String,
    },
}

impl Layout {
    /// The layout that a schema describes, for messages of the given encoding.
    ///
    /// # Errors
    /// If the encoding is not read, or the schema is not understood or contradicts itself.
    pub fn new(message_encoding: &str, schema: Option<&Schema>) -> Result<Self, SchemaError> {
        let unread = |encoding: &str| Err(SchemaError::Encoding(encoding.into()));
        let wire = match message_encoding {
            "cdr" => Wire::Cdr,
            "ros1" => Wire::Ros1,
            "protobuf" => Wire::Protobuf,
            "json" => Wire::Json,
            "" => return unread("(none)"),
            other => return unread(other),
        };
        let schema = match schema {
            None if wire == Wire::Json => return Err(SchemaError::Untold),
            schema => schema.ok_or_else(|| SchemaError::Missing(message_encoding.into()))?,
        };
        let messages = match (wire, schema.encoding.as_str()) {
            (Wire::Cdr, "ros2msg") | (Wire::Ros1, "ros1msg") => rosmsg::parse(&schema.name, text(schema)?, wire)?,
            (Wire::Cdr, "ros2idl" | "omgidl") => idl::parse(&schema.name, text(schema)?)?,
            (Wire::Protobuf, "protobuf") => descriptor::parse(&schema.name, &schema.data)?,
            (Wire::Json, "jsonschema") => jsonschema::parse(&schema.name, text(schema)?)?,
            (Wire::Json, "") => return Err(SchemaError::Untold),
            (_, language) => return unread(&format!("{message_encoding} with a {language} schema")),
        };
        Ok(Self { wire, messages })
    }

    /// The layout of JSON messages like this one; none if it is not a JSON object.
    pub fn of_example(name: &str, data: &[u8]) -> Option<Self> {
        Some(Self { wire: Wire::Json, messages: jsonschema::example(name, data)? })
    }

    /// Type of the messages, as `package/Type`.
    pub fn name(&self) -> &str {
        self.messages.first().map_or("", |root| &root.name)
    }
}

fn text(schema: &Schema) -> Result<&str, SchemaError> {
    std::str::from_utf8(&schema.data)
        .map_err(|e| SchemaError::NotText { name: schema.name.clone(), offset: e.valid_up_to() })
}

impl Field {
    /// A field that stands where its place in the message says.
    pub(super) fn new(name: impl Into<String>, kind: Kind, count: Count) -> Self {
        Self { name: name.into(), kind, count, tag: None }
    }
}

impl Message {
    pub(super) fn new(name: impl Into<String>, fields: Vec<Field>) -> Self {
        Self { name: name.into(), fields, evolution: Evolution::default() }
    }
}

impl Number {
    /// How many bytes it takes, which is also what XCDR1 aligns it to.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}
