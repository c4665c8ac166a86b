//! Protobuf schemas: a serialised `FileDescriptorSet` with all dependencies of the message.

use std::collections::{BTreeMap, BTreeSet};

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorSet};

use super::layout::{Coding, Count, Field, Kind, Message, Number, SchemaError, Tag};

/// Parses the messages of the set that the root needs, the root first.
pub(super) fn parse(schema_name: &str, data: &[u8]) -> Result<Vec<Message>, SchemaError> {
    let error = |why: String| SchemaError::Contradiction { name: schema_name.to_owned(), why };
    if parts(data, DESCRIBED_DEPTH, MOST_PARTS).is_none() {
        return Err(error(format!("describes more than {MOST_PARTS} files, messages, fields and names")));
    }
    let set = FileDescriptorSet::decode(data).map_err(|e| error(format!("is not a descriptor set: {e}")))?;
    let mut definitions = DescriptorIndex::default();
    for file in &set.file {
        definitions.add(file.package(), &file.message_type, &file.enum_type).map_err(error)?;
    }
    let mut resolver = DescriptorResolver { definitions, messages: Vec::new(), ids: BTreeMap::new() };
    resolver.message(schema_name.trim_start_matches('.'), 0).map_err(error)?;
    Ok(resolver.messages)
}

/// Largest number of parts of a set. Even a set of all messages of a large company has fewer. Each part takes some
/// hundred bytes once decoded, and as few as two before.
const MOST_PARTS: usize = 200_000;
/// Levels of nesting that are counted: set, file, message, field, options.
const DESCRIBED_DEPTH: usize = 4;

/// Rest of `most` after subtracting the parts of a wire message and their parts; `None` if there are more. A text may
/// look like parts, too, but has no more of them than bytes.
fn parts(mut data: &[u8], depth: usize, most: usize) -> Option<usize> {
    let mut left = most;
    while !data.is_empty() {
        let Ok((tag, wire)) = prost::encoding::decode_key(&mut data) else { return Some(left) };
        left = left.checked_sub(1)?;
        if wire == prost::encoding::WireType::LengthDelimited {
            let Ok(length) = prost::encoding::decode_varint(&mut data) else { return Some(left) };
            let Some(part) = usize::try_from(length).ok().and_then(|length| data.get(..length)) else {
                return Some(left);
            };
            data = &data[part.len()..];
            if depth > 0 {
                left = parts(part, depth - 1, left)?;
            }
        } else if prost::encoding::skip_field(wire, tag, &mut data, Default::default()).is_err() {
            return Some(left);
        }
    }
    Some(left)
}

/// Definitions by full name, without the leading dot.
#[derive(Default)]
struct DescriptorIndex<'a> {
    messages: BTreeMap<String, &'a DescriptorProto>,
    enums: BTreeMap<String, &'a EnumDescriptorProto>,
}

impl<'a> DescriptorIndex<'a> {
    fn add(
        &mut self,
        scope: &str,
        messages: &'a [DescriptorProto],
        enums: &'a [EnumDescriptorProto],
    ) -> Result<(), String> {
        let full = |name: &str| if scope.is_empty() { name.to_owned() } else { format!("{scope}.{name}") };
        let twice = |name: &str| format!("{name} is defined twice, differently");
        for inner in enums {
            let name = full(inner.name());
            if self.enums.insert(name.clone(), inner).is_some_and(|other| other != inner) {
                return Err(twice(&name));
            }
        }
        for message in messages {
            let name = full(message.name());
            self.add(&name, &message.nested_type, &message.enum_type)?;
            if self.messages.insert(name.clone(), message).is_some_and(|other| other != message) {
                return Err(twice(&name));
            }
        }
        Ok(())
    }
}

struct DescriptorResolver<'a> {
    definitions: DescriptorIndex<'a>,
    messages: Vec<Message>,
    /// Ids of the messages met; `None` while a message is being resolved.
    ids: BTreeMap<String, Option<usize>>,
}

/// Greatest depth of nesting that is followed.
const MAX_DEPTH: usize = 32;

impl DescriptorResolver<'_> {
    fn message(&mut self, name: &str, depth: usize) -> Result<usize, String> {
        if let Some(Some(id)) = self.ids.get(name) {
            return Ok(*id);
        }
        let Some(&definition) = self.definitions.messages.get(name) else {
            return Err(format!("{name} is not in the descriptor set"));
        };
        let id = self.messages.len();
        self.ids.insert(name.to_owned(), None);
        self.messages.push(Message::new(name, Vec::new()));
        let mut fields: Vec<Field> = Vec::with_capacity(definition.field.len());
        let (mut names, mut numbers) = (BTreeSet::new(), BTreeSet::new());
        for field in &definition.field {
            let tag = self.tag(field).map_err(|why| format!("{name}.{}: {why}", field.name()))?;
            if !names.insert(field.name()) || !numbers.insert(tag.number) {
                return Err(format!("{name} has two fields `{}` or numbered {}", field.name(), tag.number));
            }
            let kind = self.kind(field, depth).map_err(|why| format!("{name}.{}: {why}", field.name()))?;
            let count = if field.label() == Label::Repeated { Count::Sequence } else { Count::One };
            fields.push(Field { tag: Some(tag), ..Field::new(field.name(), kind, count) });
        }
        if let Some(message) = self.messages.get_mut(id) {
            message.fields = fields;
        }
        self.ids.insert(name.to_owned(), Some(id));
        Ok(id)
    }

    fn kind(&mut self, field: &FieldDescriptorProto, depth: usize) -> Result<Kind, String> {
        let name = field.type_name().trim_start_matches('.');
        Ok(match field.r#type.and_then(|kind| Type::try_from(kind).ok()) {
            Some(Type::String) => Kind::Text,
            Some(Type::Bytes) => Kind::Unread("bytes"),
            Some(Type::Group) => Kind::Unread("a group"),
            Some(Type::Message) => {
                let definition = self.definitions.messages.get(name);
                if definition.is_some_and(|d| d.options.as_ref().is_some_and(|options| options.map_entry())) {
                    Kind::Unread("a map")
                } else if self.ids.get(name) == Some(&None) {
                    Kind::Unread("a message inside itself")
                } else if depth >= MAX_DEPTH {
                    Kind::Unread("nested too deeply")
                } else {
                    Kind::Message(self.message(name, depth + 1)?)
                }
            }
            Some(kind) => match number(kind) {
                Some((number, _)) => Kind::Number(number),
                None => return Err("has no known type".into()),
            },
            None => return Err("has no known type".into()),
        })
    }

    fn tag(&self, field: &FieldDescriptorProto) -> Result<Tag, String> {
        let number = u32::try_from(field.number()).ok().filter(|n| (1..1 << 29).contains(n));
        let number = number.ok_or_else(|| format!("has the impossible number {}", field.number()))?;
        let coding = number_of(field).map_or(Coding::Varint, |(_, coding)| coding);
        Ok(Tag { number, coding, absent: self.absent(field)? })
    }

    /// Value of a field that a message leaves out.
    fn absent(&self, field: &FieldDescriptorProto) -> Result<f64, String> {
        // The other members of a oneof are not zero but absent.
        if field.oneof_index.is_some() && !field.proto3_optional() {
            return Ok(f64::NAN);
        }
        let Some(default) = field.default_value.as_deref() else { return Ok(0.0) };
        match field.r#type() {
            Type::Enum => {
                let definition = self.definitions.enums.get(field.type_name().trim_start_matches('.'));
                let value = definition.and_then(|d| d.value.iter().find(|value| value.name() == default));
                value.map(|value| value.number().into()).ok_or_else(|| format!("has the unknown default {default}"))
            }
            Type::Bool => Ok(f64::from(default == "true")),
            kind if number(kind).is_some() => {
                default.parse().map_err(|_| format!("has a default that is no number: {default}"))
            }
            _ => Ok(0.0),
        }
    }
}

fn number_of(field: &FieldDescriptorProto) -> Option<(Number, Coding)> {
    number(Type::try_from(field.r#type?).ok()?)
}

/// Type and coding of a number; `None` for a type that is not a number.
fn number(kind: Type) -> Option<(Number, Coding)> {
    Some(match kind {
        Type::Double => (Number::F64, Coding::Fixed),
        Type::Float => (Number::F32, Coding::Fixed),
        Type::Int64 => (Number::I64, Coding::Varint),
        Type::Uint64 => (Number::U64, Coding::Varint),
        Type::Int32 | Type::Enum => (Number::I32, Coding::Varint),
        Type::Fixed64 => (Number::U64, Coding::Fixed),
        Type::Fixed32 => (Number::U32, Coding::Fixed),
        Type::Bool => (Number::Bool, Coding::Varint),
        Type::Uint32 => (Number::U32, Coding::Varint),
        Type::Sfixed32 => (Number::I32, Coding::Fixed),
        Type::Sfixed64 => (Number::I64, Coding::Fixed),
        Type::Sint32 => (Number::I32, Coding::Zigzag),
        Type::Sint64 => (Number::I64, Coding::Zigzag),
        Type::String | Type::Bytes | Type::Group | Type::Message => return None,
    })
}
