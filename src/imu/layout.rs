//! What the messages of a channel hold, whatever language the schema was written in. How they are laid out in bytes is
//! left to [`Decoder`](super::Decoder).

use super::path::{FieldPath, Segment};
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

/// Why a path leads to nothing usable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// There is no such field.
    #[error("{message} has no field `{path}`{}", nearest.as_ref().map(|n| format!("; the nearest is `{n}`")).unwrap_or_default())]
    Missing {
        /// Type of the message.
        message: String,
        /// What was asked for.
        path: String,
        /// The existing field that is spelt most like it.
        nearest: Option<String>,
    },
    /// The field is something else.
    #[error("`{path}` of {message} is {found}, not {wanted}")]
    Wrong {
        /// Type of the message.
        message: String,
        /// What was asked for.
        path: String,
        /// What it is.
        found: String,
        /// What it would have to be.
        wanted: &'static str,
    },
    /// The field stands behind one whose size on the wire is ambiguous.
    #[error("`{path}` of {message} stands behind a wstring, whose size in bytes differs from writer to writer")]
    BehindWideText {
        /// Type of the message.
        message: String,
        /// What was asked for.
        path: String,
    },
    /// Unrolled, the message has more fields than any real one.
    #[error("{message} has more than {most} fields")]
    TooLarge {
        /// Type of the message.
        message: String,
        /// How many are read.
        most: usize,
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

    /// Where the three axes of a vector stand, if `path` leads to a message with `x`, `y`, `z` or to a list of three.
    ///
    /// # Errors
    /// If it leads nowhere, or to something else.
    pub fn vector(&self, path: &FieldPath) -> Result<[Place; 3], PathError> {
        let found = self.find(path)?;
        match (found.kind, found.count) {
            (Kind::Message(_), Count::One) => {
                let axis = |name| self.number(&path.join(name));
                Ok([axis("x")?, axis("y")?, axis("z")?])
            }
            (Kind::Number(_), Count::Array(3) | Count::Sequence) => {
                let axis = |element| self.number(&path.element(element));
                Ok([axis(0)?, axis(1)?, axis(2)?])
            }
            _ => Err(self.wrong(path, &found, "a message with x, y, z or a list of three numbers")),
        }
    }

    /// Where a number stands.
    ///
    /// # Errors
    /// If `path` leads nowhere, or to something else.
    pub fn number(&self, path: &FieldPath) -> Result<Place, PathError> {
        let found = self.find(path)?;
        match (found.kind, found.count) {
            (Kind::Number(number), Count::One) if number != Number::Bool => {
                Ok(Place { path: path.clone(), hops: found.hops })
            }
            _ => Err(self.wrong(path, &found, "a number")),
        }
    }

    /// Where a text stands.
    ///
    /// # Errors
    /// If `path` leads nowhere, or to something else.
    pub fn text(&self, path: &FieldPath) -> Result<Place, PathError> {
        let found = self.find(path)?;
        match (found.kind, found.count) {
            (Kind::Text, Count::One) => Ok(Place { path: path.clone(), hops: found.hops }),
            _ => Err(self.wrong(path, &found, "a text")),
        }
    }

    /// Paths of all vectors: messages with `x`, `y`, `z` and no `w`, and arrays of three floating point numbers.
    pub fn vectors(&self) -> Vec<FieldPath> {
        let mut paths = vec![FieldPath::default()];
        self.collect(0, &FieldPath::default(), &mut paths);
        paths.retain(|path| {
            let quaternion = self.find(&path.join("w")).is_ok();
            let float = |place: &Place| {
                self.find(&place.path).is_ok_and(|f| matches!(f.kind, Kind::Number(Number::F32 | Number::F64)))
            };
            let list = self.find(path).is_ok_and(|f| f.count == Count::Sequence);
            !quaternion && !list && self.vector(path).is_ok_and(|axes| axes.iter().all(float))
        });
        paths
    }

    fn find(&self, path: &FieldPath) -> Result<Found, PathError> {
        let mut found = Found { hops: Vec::new(), kind: Kind::Message(0), count: Count::One };
        for segment in path.segments() {
            found = self.step(found, segment).ok_or_else(|| self.missing(path))?;
        }
        Ok(found)
    }

    fn step(&self, from: Found, segment: &Segment) -> Option<Found> {
        let (Kind::Message(message), Count::One) = (from.kind, from.count) else { return None };
        let fields = &self.messages.get(message)?.fields;
        let field = fields.iter().position(|field| field.name == segment.name)?;
        let Field { kind, count, .. } = *fields.get(field)?;
        let count = match (segment.element, count) {
            (None, count) => count,
            (Some(element), Count::Array(n)) if element < n => Count::One,
            (Some(element), Count::Sequence) if element < MAX_ELEMENT => Count::One,
            _ => return None,
        };
        let mut hops = from.hops;
        hops.push(Hop { field, element: segment.element });
        Some(Found { hops, kind, count })
    }

    fn missing(&self, path: &FieldPath) -> PathError {
        let mut paths = Vec::new();
        self.collect(0, &FieldPath::default(), &mut paths);
        let wanted = path.to_string();
        let nearest = nearest(&wanted, paths.iter().map(FieldPath::to_string));
        PathError::Missing { message: self.name().to_owned(), path: wanted, nearest }
    }

    fn wrong(&self, path: &FieldPath, found: &Found, wanted: &'static str) -> PathError {
        let kind = match found.kind {
            Kind::Number(number) => format!("{number:?}").to_lowercase(),
            Kind::Text => "a string".to_owned(),
            Kind::WideText => "a wstring".to_owned(),
            Kind::Message(id) => self.messages.get(id).map_or_else(String::new, |m| m.name.clone()),
        };
        let found = match found.count {
            Count::One => kind,
            Count::Array(n) => format!("{kind}[{n}]"),
            Count::Sequence => format!("{kind}[]"),
        };
        let path = path.to_string();
        PathError::Wrong { message: self.name().to_owned(), path, found, wanted }
    }

    /// Appends the paths of the fields of `message` and of the messages inside it, but not inside its lists.
    fn collect(&self, message: usize, path: &FieldPath, paths: &mut Vec<FieldPath>) {
        let Some(message) = self.messages.get(message) else { return };
        for field in &message.fields {
            if paths.len() >= MAX_PATHS {
                return;
            }
            let path = path.join(&field.name);
            paths.push(path.clone());
            if let (Kind::Message(inner), Count::One) = (field.kind, field.count) {
                self.collect(inner, &path, paths);
            }
        }
    }
}

/// What a path leads to.
struct Found {
    hops: Vec<Hop>,
    kind: Kind,
    count: Count,
}

/// Elements of a sequence that can be asked for; a message with fewer is refused.
const MAX_ELEMENT: u32 = 64;

/// How many paths are looked at for suggestions.
const MAX_PATHS: usize = 4096;

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

/// The candidate that is spelt most like `wanted`, the first of several.
pub(super) fn nearest(wanted: &str, candidates: impl IntoIterator<Item = String>) -> Option<String> {
    let mut best = None;
    for candidate in candidates {
        let score = strsim::normalized_damerau_levenshtein(wanted, &candidate);
        if best.as_ref().is_none_or(|(highest, _)| score > *highest) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}
