//! JSON messages: their fields according to a JSON Schema or, without one, a first message.

use serde_json::{Map, Value};

use super::layout::{Count, Field, Kind, Message, Number, SchemaError};

/// Parses the messages that a JSON Schema describes, the root first.
pub(super) fn parse(schema_name: &str, text: &str) -> Result<Vec<Message>, SchemaError> {
    let error = |why: String| SchemaError::Contradiction { name: schema_name.to_owned(), why };
    let schema: Value = serde_json::from_str(text).map_err(|e| error(format!("is not JSON: {e}")))?;
    let mut reader = Reader { root: &schema, messages: Vec::new() };
    let root = reader.dereferenced(&schema);
    let Some(properties) = properties(root) else { return Err(SchemaError::Untold) };
    reader.message(schema_name, properties, 0).map_err(error)?;
    Ok(reader.messages)
}

/// Messages in an example, the root first; `None` if it is not a JSON object.
pub(super) fn example(name: &str, data: &[u8]) -> Option<Vec<Message>> {
    let Value::Object(fields) = serde_json::from_slice(data).ok()? else { return None };
    let mut messages = Vec::new();
    object(name, &fields, &mut messages);
    Some(messages)
}

/// Greatest depth of nesting that is followed.
const MAX_DEPTH: usize = 32;

struct Reader<'a> {
    root: &'a Value,
    messages: Vec<Message>,
}

impl<'a> Reader<'a> {
    fn message(&mut self, name: &str, properties: &'a Map<String, Value>, depth: usize) -> Result<usize, String> {
        if depth > MAX_DEPTH {
            return Err(format!("{name} is nested too deeply"));
        }
        let id = self.messages.len();
        if id >= MAX_MESSAGES {
            return Err(format!("has more than {MAX_MESSAGES} objects"));
        }
        self.messages.push(Message::new(name, Vec::new()));
        for (field, schema) in properties {
            let (kind, count) = self.field(field, schema, depth)?;
            if let Some(message) = self.messages.get_mut(id) {
                message.fields.push(Field::new(field, kind, count));
            }
        }
        Ok(id)
    }

    fn field(&mut self, name: &str, schema: &'a Value, depth: usize) -> Result<(Kind, Count), String> {
        let schema = self.dereferenced(schema);
        if let Some(properties) = properties(schema) {
            return Ok((Kind::Message(self.message(name, properties, depth + 1)?), Count::One));
        }
        Ok(match kind(schema) {
            Some("number") => (Kind::Number(Number::F64), Count::One),
            Some("integer") => (Kind::Number(Number::I64), Count::One),
            Some("boolean") => (Kind::Number(Number::Bool), Count::One),
            Some("string") => (Kind::Text, Count::One),
            Some("array") => match schema.get("items") {
                Some(items) if depth < MAX_DEPTH => {
                    let size = |key| schema.get(key).and_then(Value::as_u64).and_then(|n| u32::try_from(n).ok());
                    match self.field(name, items, depth + 1)? {
                        (kind, Count::One) if size("minItems") == size("maxItems") => {
                            (kind, size("minItems").map_or(Count::Sequence, Count::Array))
                        }
                        (kind, Count::One) => (kind, Count::Sequence),
                        (Kind::Number(number), count) if self.messages.len() < MAX_MESSAGES => {
                            (row(name, number, count, &mut self.messages), Count::Sequence)
                        }
                        _ => (Kind::Unread("a list of lists"), Count::One),
                    }
                }
                _ => (Kind::Unread("a list"), Count::One),
            },
            _ => (Kind::Unread("of no one type"), Count::One),
        })
    }

    /// Target of a local `$ref`. A target that is a reference itself is not followed, since references may form a
    /// cycle.
    fn dereferenced(&self, schema: &'a Value) -> &'a Value {
        let pointer = schema.get("$ref").and_then(Value::as_str).and_then(|path| path.strip_prefix('#'));
        pointer.and_then(|path| self.root.pointer(path)).unwrap_or(schema)
    }
}

/// Largest number of objects: real schemas have fewer, but references can unroll to any number.
const MAX_MESSAGES: usize = 1024;

fn properties(schema: &Value) -> Option<&Map<String, Value>> {
    schema.get("properties")?.as_object().filter(|properties| !properties.is_empty())
}

/// Type of a schema, if it is a single one apart from null.
fn kind(schema: &Value) -> Option<&str> {
    match schema.get("type")? {
        Value::String(kind) => Some(kind),
        Value::Array(kinds) => {
            let mut kinds = kinds.iter().filter_map(Value::as_str).filter(|&kind| kind != "null");
            kinds.next().filter(|_| kinds.next().is_none())
        }
        _ => None,
    }
}

fn object(name: &str, fields: &Map<String, Value>, messages: &mut Vec<Message>) -> usize {
    let id = messages.len();
    messages.push(Message::new(name, Vec::new()));
    for (field, value) in fields {
        let (kind, count) = of_value(field, value, messages);
        if let Some(message) = messages.get_mut(id) {
            message.fields.push(Field::new(field, kind, count));
        }
    }
    id
}

fn of_value(name: &str, value: &Value, messages: &mut Vec<Message>) -> (Kind, Count) {
    match value {
        // A 0 without decimals does not imply that the field holds integers.
        Value::Number(_) => (Kind::Number(Number::F64), Count::One),
        Value::Bool(_) => (Kind::Number(Number::Bool), Count::One),
        Value::String(_) => (Kind::Text, Count::One),
        Value::Null => (Kind::Unread("null"), Count::One),
        Value::Object(fields) => (Kind::Message(object(name, fields, messages)), Count::One),
        Value::Array(elements) => match elements.first().map(|first| of_value(name, first, messages)) {
            Some((Kind::Number(number), Count::One)) if elements.iter().all(Value::is_number) => {
                (Kind::Number(number), u32::try_from(elements.len()).map_or(Count::Sequence, Count::Array))
            }
            Some((kind @ Kind::Message(_), Count::One)) => (kind, Count::Sequence),
            Some((Kind::Number(number), Count::Array(_))) if elements.iter().all(is_row) => {
                let length = |row: &Value| row.as_array().map(Vec::len);
                let same = elements.windows(2).all(|pair| length(&pair[0]) == length(&pair[1]));
                let count = elements.first().and_then(length).and_then(|length| u32::try_from(length).ok());
                let count = count.filter(|_| same).map_or(Count::Sequence, Count::Array);
                (row(name, number, count, messages), Count::Sequence)
            }
            Some(_) if elements.iter().all(Value::is_array) => (Kind::Unread("a list of lists"), Count::One),
            _ => (Kind::Unread("a list"), Count::One),
        },
    }
}

/// Message that stands for a list of numbers inside a list: a single field without a name.
fn row(name: &str, number: Number, count: Count, messages: &mut Vec<Message>) -> Kind {
    messages.push(Message::new(name, vec![Field::new("", Kind::Number(number), count)]));
    Kind::Message(messages.len() - 1)
}

fn is_row(value: &Value) -> bool {
    value.as_array().is_some_and(|numbers| numbers.iter().all(Value::is_number))
}
