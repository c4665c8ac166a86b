//! `ros1msg` and `ros2msg` schema texts: the definition of a message, followed by those of the messages inside it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use super::layout::{Count, Field, Kind, Message, Number, SchemaError, Wire};

/// Parses the messages in `text` that the root needs, the root first.
pub(super) fn parse(schema_name: &str, text: &str, wire: Wire) -> Result<Vec<Message>, SchemaError> {
    let root = normal(schema_name);
    let definitions = definitions(schema_name, &root, text)?;
    let mut resolver = RosResolver { schema_name, wire, definitions, messages: Vec::new(), ids: BTreeMap::new() };
    resolver.message(&root, 0)?;
    Ok(resolver.messages)
}

/// A field as written, its type not yet resolved.
#[derive(Clone, Debug, PartialEq, Eq)]
struct FieldLine {
    name: String,
    base: String,
    count: Count,
}

type RosDefinitions = BTreeMap<String, Vec<FieldLine>>;

fn definitions(schema_name: &str, root: &str, text: &str) -> Result<RosDefinitions, SchemaError> {
    let mut definitions = RosDefinitions::new();
    let mut name = Some(root.to_owned());
    let mut lines = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let error = |why: String| SchemaError::Line { name: schema_name.to_owned(), line: number + 1, why };
        let line = line.trim();
        if line.len() >= 3 && line.bytes().all(|byte| byte == b'=') {
            if let Some(name) = name.take() {
                add(&mut definitions, name, std::mem::take(&mut lines)).map_err(error)?;
            }
        } else if line.is_empty() || line.starts_with('#') {
        } else if name.is_some() {
            lines.extend(field(line).map_err(error)?);
        } else if let Some(next) = line.strip_prefix("MSG:") {
            name = Some(normal(next.trim()));
        } else {
            return Err(error(format!("expected `MSG: package/Type` behind the separator, found `{line}`")));
        }
    }
    if let Some(name) = name {
        add(&mut definitions, name, lines)
            .map_err(|why| SchemaError::Contradiction { name: schema_name.to_owned(), why })?;
    }
    Ok(definitions)
}

/// Adds a definition. Some recorders repeat one; two different ones are a contradiction.
fn add(definitions: &mut RosDefinitions, name: String, lines: Vec<FieldLine>) -> Result<(), String> {
    let mut names: Vec<_> = lines.iter().map(|line| &line.name).collect();
    names.sort_unstable();
    if let Some(pair) = names.windows(2).find(|pair| pair.first() == pair.last()) {
        return Err(format!("{name} has two fields `{}`", pair.first().map_or("", |name| name)));
    }
    match definitions.entry(name) {
        Entry::Vacant(vacant) => drop(vacant.insert(lines)),
        Entry::Occupied(present) if *present.get() == lines => {}
        Entry::Occupied(present) => return Err(format!("{} is defined twice, differently", present.key())),
    }
    Ok(())
}

/// Parses a line of a definition: a field, or `None` for a constant.
fn field(line: &str) -> Result<Option<FieldLine>, String> {
    let not_a_field = || format!("`{line}` is neither a field nor a constant");
    let (kind, rest) = line.split_once(char::is_whitespace).ok_or_else(not_a_field)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
    let (name, rest) = rest.split_at(end);
    if !name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        return Err(not_a_field());
    }
    // The rest may be a value, a default or a comment, in which anything is allowed.
    if !rest.is_empty() && !rest.starts_with(|c: char| c.is_whitespace() || c == '=' || c == '#') {
        return Err(not_a_field());
    }
    if rest.trim_start().starts_with('=') {
        return Ok(None);
    }
    let (base, count) = counted(kind)?;
    Ok(Some(FieldLine { name: name.to_owned(), base: unbounded(base)?.to_owned(), count }))
}

/// Splits `T`, `T[3]`, `T[]` or `T[<=3]`.
fn counted(kind: &str) -> Result<(&str, Count), String> {
    let Some(list) = kind.strip_suffix(']') else { return Ok((kind, Count::One)) };
    let (base, count) = list.split_once('[').ok_or_else(|| format!("`{kind}` is not a type"))?;
    let size = |digits: &str| digits.parse::<u32>().map_err(|_| format!("`{kind}` has no valid size"));
    let count = match count.strip_prefix("<=") {
        Some(bound) => size(bound).map(|_| Count::Sequence)?,
        None if count.is_empty() => Count::Sequence,
        None => Count::Array(size(count)?),
    };
    Ok((base, count))
}

/// Removes the bound of a bounded string.
fn unbounded(base: &str) -> Result<&str, String> {
    let Some((name, bound)) = base.split_once("<=") else { return Ok(base) };
    if !matches!(name, "string" | "wstring") || bound.parse::<u32>().is_err() {
        return Err(format!("`{base}` is not a type"));
    }
    Ok(name)
}

/// Normal form of a name: `package/msg/Type` becomes `package/Type`.
fn normal(name: &str) -> String {
    match name.split('/').collect::<Vec<_>>()[..] {
        [package, "msg", kind] => format!("{package}/{kind}"),
        _ => name.to_owned(),
    }
}

struct RosResolver<'a> {
    schema_name: &'a str,
    wire: Wire,
    definitions: RosDefinitions,
    messages: Vec<Message>,
    /// Ids of the messages met; `None` while a message is being resolved.
    ids: BTreeMap<String, Option<usize>>,
}

/// Greatest depth of nesting: real schemas have less.
const MAX_DEPTH: usize = 32;

impl RosResolver<'_> {
    fn message(&mut self, name: &str, depth: usize) -> Result<usize, SchemaError> {
        match self.ids.get(name) {
            Some(Some(id)) => return Ok(*id),
            Some(None) => return Err(self.error(format!("{name} contains itself"))),
            None if depth > MAX_DEPTH => return Err(self.error(format!("{name} is nested too deeply"))),
            None => {}
        }
        let Some(lines) = self.definitions.remove(name).or_else(|| self.well_known(name)) else {
            return Err(self.error(format!("{name} is not defined")));
        };
        let id = self.messages.len();
        self.ids.insert(name.to_owned(), None);
        self.messages.push(Message::new(name, Vec::new()));
        let mut fields = Vec::with_capacity(lines.len());
        for FieldLine { name: field, base, count } in lines {
            let kind = self.kind(name, &base, depth)?;
            fields.push(Field::new(field, kind, count));
        }
        if fields.is_empty() && self.wire == Wire::Cdr {
            // https://design.ros2.org/articles/legacy_interface_definition.html: IDL does not allow empty structures.
            fields.push(Field::new("structure_needs_at_least_one_member", Kind::Number(Number::U8), Count::One));
        }
        if let Some(message) = self.messages.get_mut(id) {
            message.fields = fields;
        }
        self.ids.insert(name.to_owned(), Some(id));
        Ok(id)
    }

    fn kind(&mut self, package_of: &str, base: &str, depth: usize) -> Result<Kind, SchemaError> {
        if let Some(kind) = primitive(base, self.wire) {
            return Ok(kind);
        }
        let name = self.full_name(package_of, base);
        self.message(&name, depth + 1).map(Kind::Message)
    }

    /// Resolves a type name. Without package it is in the same package, or the header, or the only type of that name.
    fn full_name(&self, package_of: &str, base: &str) -> String {
        let known = |name: &String| self.definitions.contains_key(name) || self.ids.contains_key(name);
        match (base, self.wire) {
            ("time" | "duration", Wire::Ros1) => return base.to_owned(),
            ("time", Wire::Cdr) => return "builtin_interfaces/Time".into(),
            ("duration", Wire::Cdr) => return "builtin_interfaces/Duration".into(),
            _ if base.contains('/') => return normal(base),
            _ => {}
        }
        let package = package_of.split('/').next().unwrap_or_default();
        let sibling = format!("{package}/{base}");
        if known(&sibling) {
            return sibling;
        }
        if base == "Header" {
            return "std_msgs/Header".into();
        }
        let suffix = format!("/{base}");
        let mut others = self.definitions.keys().chain(self.ids.keys()).filter(|name| name.ends_with(&suffix));
        match (others.next(), others.next()) {
            (Some(only), None) => only.clone(),
            _ => sibling,
        }
    }

    /// Definitions of types that recorders may leave out.
    fn well_known(&self, name: &str) -> Option<Vec<FieldLine>> {
        let (seconds, nanos) = match (name, self.wire) {
            ("time", Wire::Ros1) => (("secs", "uint32"), ("nsecs", "uint32")),
            ("duration", Wire::Ros1) => (("secs", "int32"), ("nsecs", "int32")),
            ("builtin_interfaces/Time" | "builtin_interfaces/Duration", Wire::Cdr) => {
                (("sec", "int32"), ("nanosec", "uint32"))
            }
            _ => return None,
        };
        let line = |(name, base): (&str, &str)| FieldLine { name: name.into(), base: base.into(), count: Count::One };
        Some(vec![line(seconds), line(nanos)])
    }

    fn error(&self, why: String) -> SchemaError {
        SchemaError::Contradiction { name: self.schema_name.to_owned(), why }
    }
}

fn primitive(base: &str, wire: Wire) -> Option<Kind> {
    Some(Kind::Number(match (base, wire) {
        ("bool", _) => Number::Bool,
        ("byte", Wire::Ros1) | ("int8", _) => Number::I8,
        ("byte" | "char" | "uint8", _) => Number::U8,
        ("int16", _) => Number::I16,
        ("uint16", _) => Number::U16,
        ("int32", _) => Number::I32,
        ("uint32", _) => Number::U32,
        ("int64", _) => Number::I64,
        ("uint64", _) => Number::U64,
        ("float32", _) => Number::F32,
        ("float64", _) => Number::F64,
        ("string", _) => return Some(Kind::Text),
        ("wstring", Wire::Cdr) => return Some(Kind::WideText),
        _ => return None,
    }))
}
