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
    /// Name of a field; empty for an element of a list that has no name, being one of a list itself.
    pub(in crate::imu) name: String,
    /// Element, if the field is a list.
    pub(in crate::imu) element: Option<Element>,
}

/// Element of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::imu) enum Element {
    /// The one at an index.
    At(u32),
    /// Each of those, one after the other.
    Each(Stride),
}

/// Elements of a list that follow each other at equal distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::imu) struct Stride {
    /// Index of the first one.
    from: u32,
    /// Distance from one to the next, at least 1.
    step: u32,
}

impl Stride {
    /// Largest distance, and index of the first one: more numbers make no reading.
    const MOST: u32 = 64;

    fn parse(text: &str) -> Option<Self> {
        if text == "*" {
            return Some(Self { from: 0, step: 1 });
        }
        let (from, step) = text.split_once("::")?;
        let from = if from.is_empty() { 0 } else { from.parse().ok()? };
        let step = step.parse().ok().filter(|step| (1..=Self::MOST).contains(step))?;
        (from <= Self::MOST).then_some(Self { from, step })
    }

    /// Index of the n-th of them, counted from 0.
    pub(in crate::imu) fn place(self, n: usize) -> Option<u32> {
        u32::try_from(n).ok()?.checked_mul(self.step)?.checked_add(self.from)
    }

    /// Whether the element at an index is one of them.
    #[inline]
    pub(in crate::imu) fn takes(self, index: u32) -> bool {
        index >= self.from && (index - self.from).is_multiple_of(self.step)
    }
}

impl fmt::Display for Stride {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self { from: 0, step: 1 } => f.write_str("*"),
            Self { from, step } => write!(f, "{from}::{step}"),
        }
    }
}

/// Error of a malformed path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a field path; write names joined by dots, elements of lists as name[0], all of them as name[*], every third as name[0::3]"
)]
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
        self.each(0, 1)
    }

    /// Path with the last segment replaced by its elements at equal distances.
    pub(in crate::imu) fn each(&self, from: u32, step: u32) -> Self {
        let mut segments = self.0.clone();
        if let Some(last) = segments.last_mut() {
            last.element = Some(Element::Each(Stride { from, step }));
        }
        Self(segments)
    }

    /// Path of a number in a list that is an element of a list itself.
    pub(in crate::imu) fn inner(&self, element: u32) -> Self {
        self.join("").element(element)
    }

    /// Whether it leads to several elements of a list.
    pub(in crate::imu) fn is_listed(&self) -> bool {
        self.0.iter().any(|segment| matches!(segment.element, Some(Element::Each(_))))
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
        let segments = text.split('.').map(Segment::parse).collect::<Option<Vec<_>>>();
        segments.map(|all| Self(all.concat())).ok_or_else(|| PathSyntaxError(text.to_owned()))
    }
}

impl Segment {
    /// Segment of a field, and one for each list inside its list: `rows[*][0]`.
    fn parse(text: &str) -> Option<Vec<Self>> {
        let (name, lists) = text.split_at(text.find('[').unwrap_or(text.len()));
        let plain = !name.is_empty() && !name.contains(|c: char| c.is_whitespace() || c == ']');
        plain.then_some(())?;
        let Some(lists) = lists.strip_prefix('[') else {
            return Some(vec![Self { name: name.to_owned(), element: None }]);
        };
        let elements = lists.strip_suffix(']')?.split("][");
        let names = [name].into_iter().chain(std::iter::repeat(""));
        let segment = |(name, element): (&str, &str)| {
            let at = || element.parse().ok().map(Element::At);
            Some(Self { name: name.to_owned(), element: Some(Stride::parse(element).map(Element::Each).or_else(at)?) })
        };
        names.zip(elements).map(segment).collect()
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
            write!(f, "{}{name}", if i == 0 || name.is_empty() { "" } else { "." })?;
            match element {
                Some(Element::At(index)) => write!(f, "[{index}]")?,
                Some(Element::Each(stride)) => write!(f, "[{stride}]")?,
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
        for text in ["", "a", "a.b", "a[0].b[12]", "a[*].b", "a.b[*]", "a[2::6]", "a[*][0]", "a.b[1::3].c", "a[*][0].b"]
        {
            assert_eq!(text.parse::<FieldPath>().unwrap().to_string(), text);
        }
        for (text, short) in [("a[::3]", "a[0::3]"), ("a[0::1]", "a[*]")] {
            assert_eq!(text.parse::<FieldPath>().unwrap().to_string(), short);
        }
    }

    #[test]
    fn what_is_not_a_path_is_refused() {
        for text in [
            ".", "a.", "a..b", "a[", "a[]", "a[-1]", "a[**]", "a[0]b", "[0]", "a b", "a]", "a[0::0]", "a[0::65]",
            "a[0:3]", "a[::]", "a[0][", "a[0]]", "a[0].[1]",
        ] {
            assert!(text.parse::<FieldPath>().is_err(), "{text}");
        }
    }
}
