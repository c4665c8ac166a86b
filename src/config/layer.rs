//! One source of configuration, a file or a `--set` option, with positions for error messages.

use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use super::Error;

/// TOML text and its origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    label: String,
    text: String,
    /// Whether line numbers help the reader.
    lines: bool,
}

impl Layer {
    /// The text of a file.
    pub fn file(name: &str, text: &str) -> Self {
        Self { label: name.to_owned(), text: text.to_owned(), lines: true }
    }

    /// A layer of one `key=value`: the key dotted, the value TOML or a bare word.
    ///
    /// # Errors
    ///
    /// [`Error::Set`] if it is anything else.
    pub fn set(argument: &str) -> Result<Self, Error> {
        let wrong = || Error::Set(argument.to_owned());
        let (key, value) = argument.split_once('=').ok_or_else(wrong)?;
        let bare = || format!("{key} = {}", toml::Value::String(value.trim().to_owned()));
        let text = [format!("{key} = {value}"), bare()].into_iter().find(|text| DeTable::parse(text).is_ok());
        Ok(Self { label: format!("--set {argument}"), text: text.ok_or_else(wrong)?, lines: false })
    }

    /// The text as it was given, a `--set` option as a line of TOML.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Parses the text as a value of some type.
    ///
    /// # Errors
    ///
    /// The fault and its position, in one line.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, Error> {
        let document = DeTable::parse(&self.text).map_err(|e| {
            let why = e.message().lines().collect::<Vec<_>>().join(", ");
            Error::Syntax { at: self.at(e.span()), why }
        })?;
        toml::from_str(&self.text).map_err(|e| {
            let path = e.span().and_then(|span| path_to(document.get_ref(), span.start)).unwrap_or_default();
            explain(self.at(e.span()), path.join("."), e.message())
        })
    }

    /// Position of the value with this dotted key (list items are counted from 0); `None` if it is missing.
    pub(super) fn locate_key(&self, key: &str) -> Option<String> {
        let document = DeTable::parse(&self.text).ok()?;
        let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
        let (name, mut value) = document.get_ref().get_key_value(first)?;
        let mut span = name.span();
        for name in rest.into_iter().flat_map(|rest| rest.split('.')) {
            (span, value) = match value.get_ref() {
                DeValue::Table(table) => table.get_key_value(name).map(|(key, value)| (key.span(), value))?,
                DeValue::Array(list) => list.get(name.parse::<usize>().ok()?).map(|value| (value.span(), value))?,
                _ => return None,
            };
        }
        Some(self.at(Some(span)))
    }

    fn at(&self, span: Option<Range<usize>>) -> String {
        match span {
            Some(span) if self.lines => {
                let before = self.text.get(..span.start).unwrap_or(&self.text);
                format!("{}:{}", self.label, before.matches('\n').count() + 1)
            }
            _ => self.label.clone(),
        }
    }
}

/// Merges `over` into `base`: tables key by key; other values are replaced.
pub fn overlay(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => overlay(below, above),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

/// Key that an error in a table without positions names, if any.
pub(super) fn key_of(error: &toml::de::Error) -> String {
    let text = error.to_string();
    text.split_once("in `").and_then(|(_, rest)| rest.split('`').next()).unwrap_or_default().to_owned()
}

/// Path of the key whose name or value is at a byte offset.
fn path_to(table: &DeTable<'_>, offset: usize) -> Option<Vec<String>> {
    // The span of a table with a header covers only the header, so every table is searched before it is compared.
    let within = |value: &DeValue<'_>| match value {
        DeValue::Table(table) => path_to(table, offset),
        DeValue::Array(list) => list.iter().find_map(|item| item.get_ref().as_table().and_then(|t| path_to(t, offset))),
        _ => None,
    };
    table.iter().find_map(|(key, value)| {
        let mut path = vec![key.get_ref().to_string()];
        match within(value.get_ref()) {
            Some(rest) => path.extend(rest),
            None if key.span().contains(&offset) || value.span().contains(&offset) => {}
            None => return None,
        }
        Some(path)
    })
}

/// Translates serde's messages.
fn explain(at: String, key: String, message: &str) -> Error {
    for (kind, start) in [("key", "unknown field `"), ("choice", "unknown variant `")] {
        let Some((name, valid)) = message.strip_prefix(start).and_then(|rest| rest.split_once('`')) else { continue };
        let valid: Vec<&str> = valid.split('`').skip(1).step_by(2).collect();
        return Error::Unknown { at, key, kind, name: name.to_owned(), advice: advice(name, &valid) };
    }
    Error::Value { at, key, why: plainly(message) }
}

/// A message of serde in one line, with the words of TOML instead of Rust's types.
pub fn plainly(message: &str) -> String {
    let message = message.replace("expected f64", "expected a number").replace('\n', ", ");
    match message.split_once("expected struct ") {
        Some((before, behind)) => {
            let rest = behind.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_');
            format!("{before}expected a table, {{key = value, …}}{rest}")
        }
        None => message,
    }
}

fn advice(name: &str, valid: &[&str]) -> String {
    let likeness = |other: &str| strsim::jaro_winkler(name, other);
    match valid.iter().copied().max_by(|a, b| likeness(a).total_cmp(&likeness(b))) {
        Some(nearest) if likeness(nearest) > 0.7 => format!("; did you mean `{nearest}`?"),
        Some(_) => format!("; valid: {}", valid.join(", ")),
        None => String::new(),
    }
}
