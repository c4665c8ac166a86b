//! `ros2idl` and `omgidl` schemas: IDL text of a message and of all its dependencies.

mod definitions;
mod lexer;
mod parser;
mod resolver;
mod token_stream;

use super::layout::{Message, SchemaError};

/// Parses the messages in `text` that the root needs, the root first.
pub(super) fn parse(schema_name: &str, text: &str) -> Result<Vec<Message>, SchemaError> {
    let name = || schema_name.to_owned();
    let definitions = parser::parse(text).map_err(|(line, why)| match line {
        0 => SchemaError::Contradiction { name: name(), why },
        line => SchemaError::Line { name: name(), line, why },
    })?;
    resolver::resolve(schema_name, &definitions).map_err(|why| SchemaError::Contradiction { name: name(), why })
}
