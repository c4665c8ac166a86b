//! Schema text to [`Layout`]: the fields of a channel's messages, from ROS message definitions, IDL, protobuf
//! descriptors, JSON Schema, or a first JSON message.

mod descriptor;
mod idl;
mod jsonschema;
pub(super) mod layout;
pub(super) mod lookup;
pub(super) mod path;
mod rosmsg;

use layout::{Layout, SchemaError, Wire};

use crate::record::Schema;

/// Longest JSON message that is used as an example, in bytes (1 MiB), since all of it is parsed.
const LONGEST_EXAMPLE: usize = 1 << 20;

impl Layout {
    /// Layout that a schema describes, for messages of the given encoding.
    ///
    /// # Errors
    /// If the encoding is not supported, or the schema is malformed or inconsistent.
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
        if wire != Wire::Json && schema.data.trim_ascii().is_empty() {
            return Err(SchemaError::Empty { name: schema.name.clone() });
        }
        let messages = match (wire, schema.encoding.as_str()) {
            (Wire::Cdr, "ros2msg") | (Wire::Ros1, "ros1msg") => rosmsg::parse(&schema.name, text(schema)?, wire)?,
            (Wire::Cdr, "ros2idl" | "omgidl") => idl::parse(&schema.name, text(schema)?)?,
            (Wire::Protobuf, "protobuf") => descriptor::parse(&schema.name, &schema.data)?,
            (Wire::Json, "jsonschema") => jsonschema::parse(&schema.name, text(schema)?)?,
            (Wire::Json, "") => return Err(SchemaError::Untold),
            (_, "") => return unread(&format!("{message_encoding} with a schema that names no language")),
            (_, language) => return unread(&format!("{message_encoding} with a {language} schema")),
        };
        let layout = Self::of(wire, messages);
        match layout.is_placeholder() {
            true => Err(SchemaError::Placeholder { name: schema.name.clone() }),
            false => Ok(layout),
        }
    }

    /// Layout of JSON messages like this one; `None` if it is not a JSON object, or too long for an example.
    pub fn of_example(name: &str, data: &[u8]) -> Option<Self> {
        (data.len() <= LONGEST_EXAMPLE).then_some(())?;
        Some(Self::of(Wire::Json, jsonschema::example(name, data)?))
    }
}

fn text(schema: &Schema) -> Result<&str, SchemaError> {
    std::str::from_utf8(&schema.data)
        .map_err(|e| SchemaError::NotText { name: schema.name.clone(), offset: e.valid_up_to() })
}
