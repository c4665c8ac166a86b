//! Paths to fields inside a message, `imu.accel[0]` or `packets[*].gyro` for instance.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Path from a message to one of its fields. The empty path is the message itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct FieldPath(Vec<Segment>);

/// One step of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::imu) struct Segment {
    pub(in crate::imu) name: String,
    /// Element, if the field is a list.
    pub(in crate::imu) element: Option<Element>,
}

/// Element of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::imu) enum Element {
    /// The one at an index.
    At(u32),
    /// Each of them, one after the other.
    Every,
}

/// Error of a malformed path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a field path; write names joined by dots, elements of lists as name[0], all of them as name[*]")]
pub struct PathSyntaxError(String);

impl FieldPath {
    pub(in crate::imu) fn segments(&self) -> &[Segment] {
        &self.0
    }

    /// Path of a field of the target.
    pub(in crate::imu) fn join(&self, name: &str) -> Self {
        let mut segments = self.0.clone();
        segments.push(Segment { name: name.to_owned(), element: None });
        Self(segments)
    }

    /// Path of the target of `inner` inside the target of `self`.
    pub(in crate::imu) fn within(&self, inner: &Self) -> Self {
        Self(self.0.iter().chain(&inner.0).cloned().collect())
    }

    /// Path of the message that holds the field; `None` for the message itself.
    pub(in crate::imu) fn parent(&self) -> Option<Self> {
        let (_, parent) = self.0.split_last()?;
        Some(Self(parent.to_vec()))
    }

    /// Path with the last segment replaced by one of its elements.
    pub(in crate::imu) fn element(&self, element: u32) -> Self {
        let mut segments = self.0.clone();
        if let Some(last) = segments.last_mut() {
            last.element = Some(Element::At(element));
        }
        Self(segments)
    }

    /// Path with the last segment replaced by all of its elements.
    pub(in crate::imu) fn every(&self) -> Self {
        let mut segments = self.0.clone();
        if let Some(last) = segments.last_mut() {
            last.element = Some(Element::Every);
        }
        Self(segments)
    }

    /// Whether it leads to all elements of a list.
    pub(in crate::imu) fn is_listed(&self) -> bool {
        self.0.iter().any(|segment| segment.element == Some(Element::Every))
    }

    /// Name in a sentence.
    pub(in crate::imu) fn called(&self) -> String {
        match self.0.is_empty() {
            true => "\"\", the message itself".to_owned(),
            false => format!("`{self}`"),
        }
    }

    /// Last name; empty for the message itself.
    pub(in crate::imu) fn name(&self) -> &str {
        self.0.last().map_or("", |segment| &segment.name)
    }
}

impl FromStr for FieldPath {
    type Err = PathSyntaxError;

    fn from_str(text: &str) -> Result<Self, PathSyntaxError> {
        if text.is_empty() {
            return Ok(Self::default());
        }
        let segments = text.split('.').map(Segment::parse).collect::<Option<_>>();
        segments.map(Self).ok_or_else(|| PathSyntaxError(text.to_owned()))
    }
}

impl Segment {
    fn parse(text: &str) -> Option<Self> {
        let (name, element) = match text.strip_suffix(']') {
            Some(list) => {
                let (name, element) = list.split_once('[')?;
                (name, Some(if element == "*" { Element::Every } else { Element::At(element.parse().ok()?) }))
            }
            None => (text, None),
        };
        let plain = !name.is_empty() && !name.contains(|c: char| c.is_whitespace() || "[]".contains(c));
        plain.then(|| Self { name: name.to_owned(), element })
    }
}

impl TryFrom<String> for FieldPath {
    type Error = PathSyntaxError;

    fn try_from(text: String) -> Result<Self, PathSyntaxError> {
        text.parse()
    }
}

impl From<FieldPath> for String {
    fn from(path: FieldPath) -> Self {
        path.to_string()
    }
}

impl fmt::Display for FieldPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, Segment { name, element }) in self.0.iter().enumerate() {
            write!(f, "{}{name}", if i == 0 { "" } else { "." })?;
            match element {
                Some(Element::At(index)) => write!(f, "[{index}]")?,
                Some(Element::Every) => f.write_str("[*]")?,
                None => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_reads_back_as_it_was_written() {
        for text in ["", "a", "a.b", "a[0].b[12]", "a[*].b", "a.b[*]"] {
            assert_eq!(text.parse::<FieldPath>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_is_not_a_path_is_refused() {
        for text in [".", "a.", "a..b", "a[", "a[]", "a[-1]", "a[**]", "a[0]b", "[0]", "a b", "a]"] {
            assert!(text.parse::<FieldPath>().is_err(), "{text}");
        }
    }
}
