//! Lookup of fields in a layout by their paths, with helpful errors.

use super::layout::{Count, Field, Hop, Kind, Layout, Number, Place, Wire};
use super::path::{FieldPath, Segment};

/// Reason why a path leads to nothing usable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// There is no such field.
    #[error("{message} has no field `{path}`{}", nearest.as_ref().map(|n| format!("; the nearest is `{n}`")).unwrap_or_default())]
    Missing {
        /// Type of the message.
        message: String,
        /// Requested path.
        path: String,
        /// Existing field with the most similar spelling.
        nearest: Option<String>,
    },
    /// The field has another type.
    #[error("`{path}` of {message} is {found}, not {wanted}")]
    Wrong {
        /// Type of the message.
        message: String,
        /// Requested path.
        path: String,
        /// Type of the field.
        found: String,
        /// Required type.
        wanted: &'static str,
    },
    /// After unrolling, the message has more fields than any real one.
    #[error("{message} has more than {most} fields")]
    TooLarge {
        /// Type of the message.
        message: String,
        /// Largest number of fields.
        most: usize,
    },
}

impl Layout {
    /// Places of the three axes of a vector: `path` leads to a message with `x`, `y`, `z` or to a list of three
    /// numbers.
    ///
    /// # Errors
    /// If it leads nowhere, or to something else.
    pub fn vector(&self, path: &FieldPath) -> Result<[Place; 3], PathError> {
        let [x, y, z] = &self.axes(path)?;
        Ok([self.number(x)?, self.number(y)?, self.number(z)?])
    }

    /// Paths of the three axes of such a vector.
    pub(in crate::imu) fn axes(&self, path: &FieldPath) -> Result<[FieldPath; 3], PathError> {
        match self.find(path) {
            Some(PathTarget { kind: Kind::Message(_), count: Count::One, .. }) => {
                Ok(["x", "y", "z"].map(|axis| path.join(axis)))
            }
            Some(PathTarget { kind: Kind::Number(_), count: Count::Array(3) | Count::Sequence, .. }) => {
                Ok([0, 1, 2].map(|axis| path.element(axis)))
            }
            _ => Err(self.why_not(path, "a message with x, y, z or a list of three numbers")),
        }
    }

    /// Place of a number.
    ///
    /// # Errors
    /// If `path` leads nowhere, or to something else.
    pub fn number(&self, path: &FieldPath) -> Result<Place, PathError> {
        self.find_number(path).ok_or_else(|| self.why_not(path, "a number"))
    }

    /// Place of a text.
    ///
    /// # Errors
    /// If `path` leads nowhere, or to something else.
    pub fn text(&self, path: &FieldPath) -> Result<Place, PathError> {
        self.find_text(path).ok_or_else(|| self.why_not(path, "a text"))
    }

    /// Paths of all vectors: messages with `x`, `y`, `z` and no `w`, and arrays of three floating point numbers.
    pub fn vectors(&self) -> Vec<FieldPath> {
        let mut paths = self.paths();
        // JSON may contain names that cannot be written in a path.
        paths.retain(|path| self.is_vector(path) && path.to_string().parse().as_ref() == Ok(path));
        paths
    }

    /// Triples of numbers in one message whose names differ in the last letter, `ax`, `ay`, `az` or `gyro_x`, `gyro_y`,
    /// `gyro_z`, with the common part of the names in lowercase.
    pub(in crate::imu) fn triples(&self) -> Vec<(String, [FieldPath; 3])> {
        let paths = self.paths();
        let triple = |x: &FieldPath| {
            let (stem, letter) = x.name().split_at_checked(x.name().len().checked_sub(1)?)?;
            let letters = match letter {
                "x" => ["x", "y", "z"],
                "X" => ["X", "Y", "Z"],
                _ => return None,
            };
            let axes = letters.map(|letter| x.parent().unwrap_or_default().join(&format!("{stem}{letter}")));
            let stem = stem.trim_end_matches('_').to_lowercase();
            let is_float = |path: &FieldPath| {
                let found = self.find(path);
                let float =
                    |f: PathTarget| matches!(f.kind, Kind::Number(Number::F32 | Number::F64)) && f.count == Count::One;
                found.is_some_and(float) && path.to_string().parse().as_ref() == Ok(path)
            };
            (!stem.is_empty() && axes.iter().all(is_float)).then_some((stem, axes))
        };
        paths.iter().filter_map(triple).collect()
    }

    /// Paths and types of the messages inside the message, but not inside its lists.
    pub(in crate::imu) fn messages_inside(&self) -> Vec<(FieldPath, &str)> {
        let paths = self.paths().into_iter().skip(1);
        let named = paths.filter_map(|path| match self.find(&path)? {
            PathTarget { kind: Kind::Message(id), count: Count::One, .. } => {
                Some((path, self.messages.get(id)?.name.as_str()))
            }
            _ => None,
        });
        named.collect()
    }

    pub(in crate::imu) fn find_number(&self, path: &FieldPath) -> Option<Place> {
        let PathTarget { kind: Kind::Number(number), count: Count::One, hops } = self.find(path)? else { return None };
        (number != Number::Bool).then(|| Place { path: path.clone(), hops })
    }

    pub(in crate::imu) fn find_text(&self, path: &FieldPath) -> Option<Place> {
        let PathTarget { kind: Kind::Text, count: Count::One, hops } = self.find(path)? else { return None };
        Some(Place { path: path.clone(), hops })
    }

    fn is_vector(&self, path: &FieldPath) -> bool {
        let is_float = |found: &PathTarget| matches!(found.kind, Kind::Number(Number::F32 | Number::F64));
        match self.find(path) {
            Some(PathTarget { kind: Kind::Message(_), count: Count::One, .. }) => {
                let is_axis = |name| self.find(&path.join(name)).is_some_and(|f| f.count == Count::One && is_float(&f));
                ["x", "y", "z"].into_iter().all(is_axis) && self.find(&path.join("w")).is_none()
            }
            Some(list) => {
                // Without fixed sizes, any list may be a vector.
                let any = matches!(self.wire, Wire::Protobuf | Wire::Json) && list.count == Count::Sequence;
                (any || list.count == Count::Array(3)) && is_float(&list)
            }
            None => false,
        }
    }

    fn find(&self, path: &FieldPath) -> Option<PathTarget> {
        let root = PathTarget { hops: Vec::new(), kind: Kind::Message(0), count: Count::One };
        path.segments().iter().try_fold(root, |found, segment| self.step(found, segment))
    }

    fn step(&self, from: PathTarget, segment: &Segment) -> Option<PathTarget> {
        let (Kind::Message(message), Count::One) = (from.kind, from.count) else { return None };
        let fields = &self.messages.get(message)?.fields;
        let field = fields.iter().position(|field| field.name == segment.name)?;
        let Field { kind, count, .. } = *fields.get(field)?;
        let count = match (segment.element, count) {
            (None, count) => count,
            (Some(element), Count::Array(n)) if element < n => Count::One,
            (Some(element), Count::Sequence) if element < MAX_ELEMENT => Count::One,
            _ => return None,
        };
        let mut hops = from.hops;
        hops.push(Hop { field, element: segment.element });
        Some(PathTarget { hops, kind, count })
    }

    fn why_not(&self, path: &FieldPath, wanted: &'static str) -> PathError {
        let (message, text) = (self.name().to_owned(), path.to_string());
        let Some(found) = self.find(path) else {
            let nearest = nearest(&text, self.paths().iter().skip(1).map(FieldPath::to_string));
            return PathError::Missing { message, path: text, nearest };
        };
        let kind = match found.kind {
            Kind::Number(number) => format!("{number:?}").to_lowercase(),
            Kind::Text => "a string".to_owned(),
            Kind::WideText => "a wstring".to_owned(),
            Kind::Unread(what) => what.to_owned(),
            Kind::Message(id) => self.messages.get(id).map_or_else(String::new, |m| m.name.clone()),
        };
        let found = match found.count {
            Count::One => kind,
            Count::Array(n) => format!("{kind}[{n}]"),
            Count::Sequence => format!("{kind}[]"),
        };
        PathError::Wrong { message, path: text, found, wanted }
    }

    /// Paths of the message itself and of all fields that are not inside lists.
    fn paths(&self) -> Vec<FieldPath> {
        let mut paths = vec![FieldPath::default()];
        self.collect(0, &FieldPath::default(), &mut paths);
        paths
    }

    /// Appends the paths of the fields of `message` and of the messages inside it, but not inside its lists.
    fn collect(&self, message: usize, path: &FieldPath, paths: &mut Vec<FieldPath>) {
        let Some(message) = self.messages.get(message) else { return };
        for field in &message.fields {
            if paths.len() >= MAX_PATHS {
                return;
            }
            let path = path.join(&field.name);
            paths.push(path.clone());
            if let (Kind::Message(inner), Count::One) = (field.kind, field.count) {
                self.collect(inner, &path, paths);
            }
        }
    }
}

/// Target of a path.
struct PathTarget {
    hops: Vec<Hop>,
    kind: Kind,
    count: Count,
}

/// Number of elements of a sequence that can be requested. A message with fewer than requested is refused.
const MAX_ELEMENT: u32 = 64;

/// Largest number of paths considered for suggestions.
const MAX_PATHS: usize = 4096;

/// Candidate with the spelling most similar to `wanted`, the first of several.
pub(in crate::imu) fn nearest(wanted: &str, candidates: impl IntoIterator<Item = String>) -> Option<String> {
    let mut best = None;
    // The member that rosidl adds to a message without fields is not a real one.
    for candidate in candidates.into_iter().filter(|name| !name.ends_with("structure_needs_at_least_one_member")) {
        let score = strsim::normalized_damerau_levenshtein(wanted, &candidate);
        if best.as_ref().is_none_or(|(highest, _)| score > *highest) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}
