//! The `ros2msg` text of an annotation's definition, with the comments of `schemas/` in it. Which type a field has is
//! left to [`ros2`](super::ros2).

use std::fmt::Write as _;

use prost_reflect::{EnumDescriptor, FieldDescriptor, FileDescriptor, Kind, MessageDescriptor};
use prost_types::source_code_info::Location;

use super::ros2::{Type, element_type};

const SEPARATOR: &str = "================================================================================";

/// Where the comment at the head of a file hangs: on its `syntax` statement (field 12 of `FileDescriptorProto`).
const HEAD_OF_FILE: &[i32] = &[12];

/// What the schema file cannot say, since in protobuf it is not so.
const ABSENCE: &str = "In ROS 2, a float64 that is absent, or part of a message that is absent, reads NaN.\n\
    Whatever else is absent reads zero or empty.";

/// The definition of a message, followed by those of the messages in it.
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

/// The messages that a message is made of, each once, in the order of their first mention.
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

/// Protobuf keeps the names of all enums of a message apart, so that they need no prefix as constants either.
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

/// What the file says about the thing at that path.
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
