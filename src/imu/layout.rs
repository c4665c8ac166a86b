//! What the messages of a channel hold, whatever language the schema was written in. How they are laid out in bytes is
//! left to [`Decoder`](super::Decoder).

use super::path::FieldPath;
use super::rosmsg;
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
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Message {
    /// `package/Type`.
    pub(super) name: String,
    pub(super) fields: Vec<Field>,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) count: Count,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Number(Number),
    Text,
    /// UTF-16 text, of which writers do not agree on the bytes.
    WideText,
    /// Index into [`Layout::messages`].
    Message(usize),
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
    /// A message encoding or schema language of later versions, or none at all.
    #[error("the encoding {0} is not read yet")]
    Encoding(String),
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
        let (wire, language) = match message_encoding {
            "cdr" => (Wire::Cdr, "ros2msg"),
            "ros1" => (Wire::Ros1, "ros1msg"),
            "" => return Err(SchemaError::Encoding("(none)".into())),
            other => return Err(SchemaError::Encoding(other.into())),
        };
        let schema = schema.ok_or_else(|| SchemaError::Missing(message_encoding.into()))?;
        if schema.encoding != language {
            return Err(SchemaError::Encoding(format!("{message_encoding} with a {} schema", schema.encoding)));
        }
        let text = std::str::from_utf8(&schema.data)
            .map_err(|e| SchemaError::NotText { name: schema.name.clone(), offset: e.valid_up_to() })?;
        let messages = rosmsg::parse(&schema.name, text, wire)?;
        Ok(Self { wire, messages })
    }

    /// Type of the messages, as `package/Type`.
    pub fn name(&self) -> &str {
        self.messages.first().map_or("", |root| &root.name)
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
