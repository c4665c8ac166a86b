//! The ROS 2 interface package `schemas/stillpoint_msgs` holds the very definitions that recordings carry.

use std::collections::BTreeMap;

use stillpoint::annotate::Encoding;

use crate::common::needs::root;
use crate::messages::{alone, one_of_each};
use crate::schemas::expect_generated;

/// Definitions of `stillpoint_msgs` by name, as they stand in the schema records of recordings.
fn definitions() -> BTreeMap<String, String> {
    const SEPARATOR: &str = "================================================================================\n";
    let mut found = BTreeMap::new();
    for message in one_of_each() {
        let (topic, _) = alone(Encoding::Ros2, message);
        let text = String::from_utf8(topic.schema).unwrap();
        let mut parts = text.split(SEPARATOR);
        let first = parts.next().unwrap().to_owned();
        let named = parts.map(|part| {
            let (head, text) = part.split_once('\n').unwrap();
            (head.strip_prefix("MSG: ").unwrap().to_owned(), text.to_owned())
        });
        let all = std::iter::once((topic.schema_name.replacen("/msg/", "/", 1), first)).chain(named);
        for (name, text) in all {
            if let Some(own) = name.strip_prefix("stillpoint_msgs/") {
                // At the head of a file the conventions are said once more; the definition is the same.
                let known = found.entry(own.to_owned()).or_insert_with(|| text.clone());
                if text.len() > known.len() {
                    *known = text;
                }
            }
        }
    }
    found
}

fn manifest() -> String {
    "<?xml version=\"1.0\"?>
<package format=\"3\">
  <name>stillpoint_msgs</name>
  <version>2.0.0</version>
  <description>The annotations that Stillpoint writes into recordings</description>
  <maintainer email=\"stillpoint@example.invalid\">The maintainers of Stillpoint</maintainer>
  <license>MIT</license>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>builtin_interfaces</depend>
  <depend>std_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"
    .to_owned()
}

fn build_file<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let messages: String = names.map(|name| format!("  \"msg/{name}.msg\"\n")).collect();
    format!(
        "cmake_minimum_required(VERSION 3.8)
project(stillpoint_msgs)

find_package(ament_cmake REQUIRED)
find_package(builtin_interfaces REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(std_msgs REQUIRED)

rosidl_generate_interfaces(${{PROJECT_NAME}}
{messages}  DEPENDENCIES builtin_interfaces std_msgs
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"
    )
}

#[test]
fn the_interface_package_holds_the_definitions_of_recordings() {
    let package = root().join("schemas/stillpoint_msgs");
    let definitions = definitions();
    for (name, text) in &definitions {
        expect_generated(&package.join(format!("msg/{name}.msg")), text.as_bytes());
    }
    expect_generated(&package.join("package.xml"), manifest().as_bytes());
    expect_generated(&package.join("CMakeLists.txt"), build_file(definitions.keys()).as_bytes());

    let files = std::fs::read_dir(package.join("msg")).unwrap();
    let files = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    let strangers: Vec<_> =
        files.filter(|file| !file.strip_suffix(".msg").is_some_and(|name| definitions.contains_key(name))).collect();
    assert_eq!(strangers, Vec::<String>::new(), "of no message");
}

#[test]
fn names_are_such_as_the_generator_of_ros_2_accepts() {
    // rosidl_adapter/parser.py: VALID_FIELD_NAME_PATTERN, VALID_CONSTANT_NAME_PATTERN, VALID_MESSAGE_NAME_PATTERN.
    let field = |name: &str| {
        name.starts_with(|c: char| c.is_ascii_lowercase())
            && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
            && !name.contains("__")
            && !name.ends_with('_')
    };
    for (name, text) in definitions() {
        assert!(name.starts_with(|c: char| c.is_ascii_uppercase()) && name.chars().all(|c| c.is_ascii_alphanumeric()));
        for line in text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
            let (_, rest) = line.split_once(' ').unwrap();
            match rest.split_once('=') {
                Some((constant, _)) => assert!(field(&constant.to_ascii_lowercase()), "{name}: {line}"),
                None => assert!(field(rest.split_whitespace().next().unwrap()), "{name}: {line}"),
            }
        }
    }
}
