//! The generated code and the descriptor set are what `schemas/stillpoint.proto` says, and what it once said still holds.
//!
//! `STILLPOINT_UPDATE=1 cargo test --test annotate` writes them anew after the schema was edited.

use std::collections::BTreeMap;
use std::path::Path;

use prost::Message as _;
use prost_types::{DescriptorProto, FileDescriptorSet};

use crate::common::needs::root;

/// Fails if `path` does not hold `fresh`, or writes it when asked to.
pub fn expect_generated(path: &Path, fresh: &[u8]) {
    if std::env::var_os("STILLPOINT_UPDATE").is_some() {
        std::fs::write(path, fresh).unwrap();
    }
    let present = std::fs::read(path).unwrap_or_default();
    assert!(present == fresh, "{} is stale: run STILLPOINT_UPDATE=1 cargo test --test annotate", path.display());
}

#[test]
fn generated_code_and_descriptor_set_match_the_schema() {
    let schemas = root().join("schemas");
    let descriptors = protox::compile(["stillpoint.proto", "foxglove/Log.proto"], [&schemas]).unwrap();

    // Units and directions are said in our comments, so they travel with the recording. Positions do not.
    let mut embedded = descriptors.clone();
    for file in &mut embedded.file {
        if file.package() != "stillpoint" {
            file.source_code_info = None;
        }
        if let Some(info) = &mut file.source_code_info {
            info.location.retain(|place| place.leading_comments.is_some() || place.trailing_comments.is_some());
            info.location.iter_mut().for_each(|place| place.span = vec![0, 0, 0]);
        }
    }
    expect_generated(&schemas.join("descriptors.binpb"), &embedded.encode_to_vec());

    let out = tempfile::tempdir().unwrap();
    prost_build::Config::new()
        .out_dir(out.path())
        .enable_type_names()
        .type_attribute("stillpoint.Segment.Reason", "#[derive(serde::Serialize, serde::Deserialize)]")
        .type_attribute("stillpoint.Turn.Reason", "#[derive(serde::Serialize, serde::Deserialize)]")
        .compile_fds(descriptors)
        .unwrap();
    for package in ["stillpoint", "foxglove"] {
        let file = format!("{package}.rs");
        let fresh = std::fs::read(out.path().join(&file)).unwrap();
        expect_generated(&root().join("src/messages").join(&file), &fresh);
    }
}

/// Every name that the messages give: messages, fields, enums and constants, each with its path.
fn names(set: &FileDescriptorSet) -> Vec<(String, String)> {
    fn of(message: &DescriptorProto, path: &str, found: &mut Vec<(String, String)>) {
        let path = format!("{path}.{}", message.name());
        found.push((path.clone(), message.name().to_owned()));
        let fields = message.field.iter().map(|field| field.name().to_owned());
        let constants = message.enum_type.iter().flat_map(|constants| {
            let values = constants.value.iter().map(|value| value.name().to_owned());
            std::iter::once(constants.name().to_owned()).chain(values)
        });
        found.extend(fields.chain(constants).map(|name| (format!("{path}.{name}"), name)));
        message.nested_type.iter().for_each(|nested| of(nested, &path, found));
    }
    let mut found = Vec::new();
    for file in set.file.iter().filter(|file| file.package() == "stillpoint") {
        file.message_type.iter().for_each(|message| of(message, file.package(), &mut found));
    }
    found
}

/// What no name may be: Python 3.13 (soft keywords included), C++23 and the macros of the C library that are common in
/// robotics code, OMG IDL 4.2 (which tells no cases apart), Rust 2024.
const KEYWORDS: [(&str, &str); 4] = [
    (
        "Python",
        "False None True and as assert async await break case class continue def del elif else except finally for from \
         global if import in is lambda match nonlocal not or pass raise return try type while with yield _",
    ),
    (
        "C++",
        "alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept auto bitand bitor bool break case \
         catch char char16_t char32_t char8_t class co_await co_return co_yield compl concept const const_cast consteval \
         constexpr constinit continue decltype default delete do double dynamic_cast else enum explicit export extern \
         false float for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr operator or \
         or_eq private protected public reflexpr register reinterpret_cast requires return short signed sizeof static \
         static_assert static_cast struct switch synchronized template this thread_local throw true try typedef typeid \
         typename union unsigned using virtual void volatile wchar_t while xor xor_eq NULL EOF ERROR DOMAIN OVERFLOW \
         UNDERFLOW INFINITY NAN",
    ),
    (
        "IDL",
        "abstract any alias attribute bitfield bitmask bitset boolean case char component connector const consumes \
         context custom default double exception emits enum eventtype factory FALSE finder fixed float getraises home \
         import in inout interface int8 int16 int32 int64 local long manages map mirrorport module multiple native Object \
         octet oneway out primarykey private port porttype provides public publishes raises readonly setraises sequence \
         short string struct supports switch TRUE truncatable typedef typeid typename typeprefix uint8 uint16 uint32 \
         uint64 unsigned union uses ValueBase valuetype void wchar wstring",
    ),
    (
        "Rust",
        "abstract as async await become box break const continue crate do dyn else enum extern false final fn for gen if \
         impl in let loop macro match mod move mut override priv pub ref return self Self static struct super trait true \
         try type typeof union unsafe unsized use virtual where while yield",
    ),
];

/// Names that code cannot be generated for.
fn unusable(set: &FileDescriptorSet) -> Vec<String> {
    let mut found = Vec::new();
    for (path, name) in names(set) {
        for (language, keywords) in KEYWORDS {
            let is = |keyword: &str| match language {
                "IDL" => keyword.eq_ignore_ascii_case(&name),
                _ => keyword == name,
            };
            if keywords.split_whitespace().any(is) {
                found.push(format!("{path} is a keyword of {language}"));
            }
        }
    }
    found
}

#[test]
fn no_name_is_a_keyword_of_a_language_that_code_is_generated_for() {
    let set = protox::compile(["stillpoint.proto"], [root().join("schemas")]).unwrap();
    assert_eq!(unusable(&set), Vec::<String>::new());
}

#[test]
fn a_keyword_in_any_place_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let text = "syntax = \"proto3\"; package stillpoint;
        message Span { string from = 1; Kind fixed_ = 2; enum Kind { NULL = 0; } message Inner { bool Fixed = 1; } }";
    std::fs::write(folder.path().join("bad.proto"), text).unwrap();
    let set = protox::compile(["bad.proto"], [folder.path()]).unwrap();
    let expected = [
        "stillpoint.Span.from is a keyword of Python",
        "stillpoint.Span.NULL is a keyword of C++",
        "stillpoint.Span.Inner.Fixed is a keyword of IDL",
    ];
    assert_eq!(unusable(&set), expected);
}

/// Fields and constants by their paths with number and type, as `schemas/contract.txt` keeps them.
fn contract(set: &FileDescriptorSet) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for file in set.file.iter().filter(|file| file.package() == "stillpoint") {
        for message in &file.message_type {
            for field in &message.field {
                let kind = match field.type_name() {
                    "" => format!("{:?}", field.r#type()).to_lowercase(),
                    name => name.trim_start_matches('.').to_owned(),
                };
                let label = match (field.label().as_str_name(), field.proto3_optional()) {
                    ("LABEL_REPEATED", _) => "repeated ",
                    (_, true) => "optional ",
                    _ => "",
                };
                found.insert(
                    format!("{} {}", message.name(), field.number()),
                    format!("{label}{kind} {}", field.name()),
                );
            }
            for constants in &message.enum_type {
                for value in &constants.value {
                    let place = format!("{}.{} {}", message.name(), constants.name(), value.number());
                    found.insert(place, value.name().to_owned());
                }
            }
        }
    }
    found
}

#[test]
fn what_the_contract_once_said_still_holds() {
    let set = protox::compile(["stillpoint.proto"], [root().join("schemas")]).unwrap();
    let (path, fresh) = (root().join("schemas/contract.txt"), contract(&set));
    let kept = std::fs::read_to_string(&path).unwrap();
    for line in kept.lines().filter(|line| !line.starts_with('#')) {
        let (place, said) = line.split_once(": ").unwrap();
        let says = fresh.get(place).map(String::as_str);
        assert_eq!(says, Some(said), "{place}: numbers and names are kept; add a field with a number of its own");
    }
    let head = kept.lines().filter(|line| line.starts_with('#')).map(|line| format!("{line}\n"));
    let lines = fresh.iter().map(|(place, says)| format!("{place}: {says}\n"));
    expect_generated(&path, head.chain(lines).collect::<String>().as_bytes());
}
