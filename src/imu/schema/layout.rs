//! Fields of the messages of a channel, independent of the schema language.

use super::path::{Element, FieldPath};

/// Fields of a message and of the messages inside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    pub(in crate::imu) wire: Wire,
    /// Messages, the root first. No message contains itself.
    pub(in crate::imu) messages: Vec<Message>,
    /// Indices of the fields of each message, sorted by name: a message may have many, and each is looked up often.
    by_name: Vec<Vec<usize>>,
}

/// Serialisation of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::imu) enum Wire {
    Cdr,
    Ros1,
    Protobuf,
    Json,
}

#[derive(Clone, Debug, PartialEq)]
pub(in crate::imu) struct Message {
    /// Name as `package/Type`, or as the schema language writes it.
    pub(in crate::imu) name: String,
    pub(in crate::imu) fields: Vec<Field>,
    pub(in crate::imu) evolution: Evolution,
}

/// Extensibility of a message: if later versions may have more fields, XCDR2 writes its size first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::imu) enum Evolution {
    /// Not stated in the schema: the encapsulation of the root message decides.
    #[default]
    Unsaid,
    Final,
    Appendable,
}

#[derive(Clone, Debug, PartialEq)]
pub(in crate::imu) struct Field {
    pub(in crate::imu) name: String,
    pub(in crate::imu) kind: Kind,
    pub(in crate::imu) count: Count,
    /// Tag in protobuf; `None` in other encodings.
    pub(in crate::imu) tag: Option<Tag>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::imu) enum Kind {
    Number(Number),
    Text,
    /// UTF-16 text, which writers encode differently.
    WideText,
    /// Message, by its index into [`Layout::messages`].
    Message(usize),
    /// Unsupported type, in words. Used only if the rest of the message can still be read.
    Unread(&'static str),
}

/// Field number and coding of a protobuf field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::imu) struct Tag {
    pub(in crate::imu) number: u32,
    pub(in crate::imu) coding: Coding,
    /// Value of the field in a message that leaves it out; NaN if it has none.
    pub(in crate::imu) absent: f64,
}

/// Protobuf coding of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(in crate::imu) enum Coding {
    Varint,
    Zigzag,
    Fixed,
}

/// Type of a number in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(in crate::imu) enum Number {
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
pub(in crate::imu) enum Count {
    One,
    Array(u32),
    Sequence,
}

/// Place of a number or text in a layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    pub(in crate::imu) path: FieldPath,
    pub(in crate::imu) hops: Vec<Hop>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::imu) struct Hop {
    /// Index into [`Message::fields`].
    pub(in crate::imu) field: usize,
    pub(in crate::imu) element: Option<Element>,
}

impl Place {
    /// Whether it is one in every element of a list.
    pub(in crate::imu) fn is_listed(&self) -> bool {
        self.path.is_listed()
    }
}

/// Member that rosidl adds to a message without fields.
pub(in crate::imu) const PLACEHOLDER: &str = "structure_needs_at_least_one_member";

/// Reason why a channel's messages cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// The message encoding or schema language is not supported.
    #[error("the encoding {0} is not read")]
    Encoding(String),
    /// JSON without a schema, or with one that names no fields: its messages show them, see [`Layout::of_example`].
    #[error("JSON without a schema: its messages tell")]
    Untold,
    /// The channel has no schema.
    #[error("the channel has no schema, which the encoding {0} cannot be read without")]
    Missing(String),
    /// The schema defines nothing.
    #[error(
        "{} is empty: its recorder did not find the definition; record where the package is installed, or give the recording \
         its schema",
        called(name)
    )]
    Empty {
        /// Name of the schema.
        name: String,
    },
    /// The schema has only the member that generators of code put into messages without any.
    #[error(
        "{} is empty but for a placeholder: its messages hold nothing, or its recorder did not find the definition; then record \
         where the package is installed, or give the recording its schema",
        called(name)
    )]
    Placeholder {
        /// Name of the schema.
        name: String,
    },
    /// The schema was read for enough other channels.
    #[error(
        "one of many channels whose schemas, which others have, too, take more than 8 MiB in all; an [[imu]] of the configuration \
         names one that matters"
    )]
    Again,
    /// The schema is not text.
    #[error("the schema {name} is not UTF-8 at byte {offset}")]
    NotText {
        /// Name of the schema.
        name: String,
        /// Offset of the first byte that is not UTF-8.
        offset: usize,
    },
    /// A line of the schema cannot be parsed.
    #[error("schema {name}, line {line}: {why}")]
    Line {
        /// Name of the schema.
        name: String,
        /// Line, counted from 1.
        line: usize,
        /// Description of the problem.
        why: String,
    },
    /// The schema is inconsistent or incomplete.
    #[error("schema {name}: {why}")]
    Contradiction {
        /// Name of the schema.
        name: String,
        /// Description of the problem.
        why: String,
    },
}

/// A schema in a sentence.
fn called(name: &str) -> String {
    if name.is_empty() { "the schema".to_owned() } else { format!("the schema {name}") }
}

impl Layout {
    /// Layout of these messages, the root first.
    pub(super) fn of(wire: Wire, messages: Vec<Message>) -> Self {
        let sorted = |message: &Message| {
            let mut fields: Vec<_> = message.fields.iter().enumerate().collect();
            fields.sort_by(|(_, a), (_, b)| a.name.cmp(&b.name));
            fields.into_iter().map(|(index, _)| index).collect()
        };
        Self { wire, by_name: messages.iter().map(sorted).collect(), messages }
    }

    /// Index of the first field of this name in a message.
    pub(super) fn field(&self, message: usize, name: &str) -> Option<usize> {
        let (fields, by_name) = (&self.messages.get(message)?.fields, self.by_name.get(message)?);
        let name_of = |index: usize| fields.get(index).map(|field| field.name.as_str());
        let first = *by_name.get(by_name.partition_point(|&index| name_of(index) < Some(name)))?;
        (name_of(first) == Some(name)).then_some(first)
    }

    /// Whether the messages have no field but the one that generators of code put into messages without any, although their
    /// type is not called empty.
    pub(in crate::imu) fn is_placeholder(&self) -> bool {
        let fields = self.messages.first().map_or(&[][..], |root| &root.fields);
        let is_called_empty = self.name().rsplit(['/', '.']).next().is_some_and(|name| name.starts_with("Empty"));
        matches!(fields, [only] if only.name == PLACEHOLDER) && !is_called_empty
    }

    /// Type of the messages, as `package/Type`.
    pub fn name(&self) -> &str {
        self.messages.first().map_or("", |root| &root.name)
    }
}

impl Field {
    /// Field without a tag, placed by its position in the message.
    pub(in crate::imu) fn new(name: impl Into<String>, kind: Kind, count: Count) -> Self {
        Self { name: name.into(), kind, count, tag: None }
    }
}

impl Message {
    pub(in crate::imu) fn new(name: impl Into<String>, fields: Vec<Field>) -> Self {
        Self { name: name.into(), fields, evolution: Evolution::default() }
    }
}

impl Number {
    /// Size in bytes, which is also its alignment in XCDR1.
    pub(in crate::imu) fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}
