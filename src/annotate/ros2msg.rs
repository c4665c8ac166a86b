//! `ros2msg` text of an annotation's definition, with the comments of `schemas/`. The types of fields are those
//! of [`ros2`](super::ros2).

use std::fmt::Write as _;

use prost_reflect::{EnumDescriptor, FieldDescriptor, FileDescriptor, Kind, MessageDescriptor};
use prost_types::source_code_info::Location;

use super::ros2::{Type, element_type};

const SEPARATOR: &str = "================================================================================";

/// Path of the comment at the head of a file: its `syntax` statement (field 12 of `FileDescriptorProto`).
const HEAD_OF_FILE: &[i32] = &[12];

/// Note that the schema file does not contain, since it does not apply to protobuf.
const ABSENCE: &str = "In ROS 2, a float64 that is absent, or part of a message that is absent, reads NaN.\n\
    Whatever else is absent reads zero or empty.";

/// Definition of a message, followed by those of the messages in it.
pub fn schema(message: &MessageDescriptor) -> String {
    let file = message.parent_file();
    let mut text = String::new();
    write_block(&mut text, leading(comment(&file, HEAD_OF_FILE)));
    write_block(&mut text, ABSENCE);
    text.push('\n');
    write_definition(&mut text, message);
    for part in parts_of(message) {
        let _ = writeln!(text, "{SEPARATOR}\nMSG: {}", Type::of(&part).name());
        write_definition(&mut text, &part);
    }
    text
}

/// Messages inside a message, each once, in the order of their first mention.
fn parts_of(message: &MessageDescriptor) -> Vec<MessageDescriptor> {
    let mut found = vec![message.clone()];
    let mut next = 0;
    while let Some(message) = found.get(next).cloned() {
        next += 1;
        for field in message.fields() {
            if let Kind::Message(part) = field.kind()
                && !found.contains(&part)
            {
                found.push(part);
            }
        }
    }
    found.split_off(1)
}

fn write_definition(text: &mut String, message: &MessageDescriptor) {
    match Type::of(message) {
        Type::Time => text.push_str("int32 sec\nuint32 nanosec\n"),
        Type::Header => message.fields().for_each(|field| write_field(text, &field, None)),
        Type::Own(_) => {
            let file = message.parent_file();
            write_block(text, leading(comment(&file, message.path())));
            for field in message.fields() {
                if let Kind::Enum(constants) = field.kind() {
                    write_constants(text, &constants);
                }
                write_field(text, &field, comment(&file, field.path()));
            }
        }
    }
}

fn write_field(text: &mut String, field: &FieldDescriptor, comment: Option<&Location>) {
    let sequence = if field.is_list() { "[]" } else { "" };
    write_block(text, leading(comment));
    write_line(text, &format!("{}{sequence} {}", element_type(&field.kind()), field.name()), trailing(comment));
}

/// Appends constants. Their names need no prefix, since enum values of a message have different names in protobuf, too.
fn write_constants(text: &mut String, constants: &EnumDescriptor) {
    let file = constants.parent_file();
    for value in constants.values() {
        let comment = comment(&file, value.path());
        write_block(text, leading(comment));
        write_line(text, &format!("uint8 {}={}", value.name(), value.number()), trailing(comment));
    }
}

fn write_line(text: &mut String, line: &str, comment: &str) {
    text.push_str(line);
    if !comment.is_empty() {
        let _ = write!(text, "  # {}", comment.split_whitespace().collect::<Vec<_>>().join(" "));
    }
    text.push('\n');
}

fn write_block(text: &mut String, comment: &str) {
    for line in comment.lines() {
        let _ = writeln!(text, "{}", format!("# {}", line.trim()).trim_end());
    }
}

/// Comment in the file on the item at this path.
fn comment<'a>(file: &'a FileDescriptor, path: &[i32]) -> Option<&'a Location> {
    let info = file.file_descriptor_proto().source_code_info.as_ref()?;
    info.location.iter().find(|location| location.path == path)
}

fn leading(comment: Option<&Location>) -> &str {
    comment.map(Location::leading_comments).unwrap_or_default()
}

fn trailing(comment: Option<&Location>) -> &str {
    comment.map(Location::trailing_comments).unwrap_or_default()
}
