//! Lookup of fields in a layout by their paths, with helpful errors.

use super::layout::{Count, Field, Hop, Kind, Layout, Number, PLACEHOLDER, Place, Wire};
use super::path::{Element, FieldPath, Segment};

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
    /// All elements of a list are requested, and one of them by itself.
    #[error("all elements of `{path}` are read, so none can be read by itself: write [*] at each path into it")]
    Mixed {
        /// Path of the list.
        path: String,
    },
}

impl Layout {
    /// Places of the three axes of a vector: `path` leads to a message with `x`, `y`, `z`, to a list of three numbers, to an
    /// element of a list that is such a list, or to a message with a list of each of `x`, `y`, `z`.
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
            Some(PathTarget { kind: Kind::Message(id), count: Count::One, .. }) if self.is_row(path, id) => {
                Ok([0, 1, 2].map(|axis| path.inner(axis)))
            }
            Some(PathTarget { kind: Kind::Message(_), count: Count::One, .. }) => {
                Ok(self.listed_axes(path).unwrap_or_else(|| ["x", "y", "z"].map(|axis| path.join(axis))))
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
        // An axis of readings is not a vector, although a list may have three of them.
        let is_axis = |path: &FieldPath| path.parent().is_some_and(|around| self.listed_axes(&around).is_some());
        paths.retain(|path| self.is_vector(path) && is_written(path) && !is_axis(path));
        paths
    }

    /// Paths of floating point numbers, of times none, in the order of the message, at most so many.
    pub(in crate::imu) fn floats(&self, most: usize) -> Vec<FieldPath> {
        let is_time = |path: &FieldPath| {
            let name = path.name().to_lowercase();
            ["sec", "nsec", "nanos", "stamp", "time", "t", "ts"].iter().any(|word| match word.len() {
                0..=2 => name == *word,
                _ => name.contains(word),
            })
        };
        let paths = self.paths().into_iter().filter(|path| is_written(path) && !is_time(path));
        let floats = paths.filter(|path| self.find(path).is_some_and(|f| f.count == Count::One && is_float(&f)));
        floats.take(most).collect()
    }

    /// Paths of all vectors in every element of a list, and of messages with a list of each of `x`, `y`, `z`.
    pub(in crate::imu) fn listed_vectors(&self) -> Vec<FieldPath> {
        let mut paths = self.paths_in_lists();
        paths.retain(|path| {
            is_written(path) && (path.is_listed() && self.is_vector(path) || self.listed_axes(path).is_some())
        });
        paths
    }

    /// [Triples](Self::triples) in every element of a list, and of lists.
    pub(in crate::imu) fn listed_triples(&self) -> Vec<(String, [FieldPath; 3])> {
        let axes = |axes: [FieldPath; 3]| if axes[0].is_listed() { axes } else { axes.map(|axis| axis.every()) };
        let triples = self.triples_of(&self.paths_in_lists(), true).into_iter();
        triples.map(|(stem, paths)| (stem, axes(paths))).collect()
    }

    /// Triples of numbers in one message whose names differ in the last letter, `ax`, `ay`, `az` or `gyro_x`, `gyro_y`,
    /// `gyro_z`, with the common part of the names in lowercase; and `alpha`, `beta`, `gamma`, or `roll`, `pitch`, `yaw`,
    /// with the name of the message around them.
    pub(in crate::imu) fn triples(&self) -> Vec<(String, [FieldPath; 3])> {
        self.triples_of(&self.paths(), false)
    }

    fn triples_of(&self, paths: &[FieldPath], listed: bool) -> Vec<(String, [FieldPath; 3])> {
        const NAMED: [[&str; 3]; 2] = [["alpha", "beta", "gamma"], ["roll", "pitch", "yaw"]];
        let triple = |x: &FieldPath| {
            let around = x.parent().unwrap_or_default();
            let (stem, axes) = match NAMED.into_iter().find(|[first, ..]| x.name() == *first) {
                Some(names) => (around.name().to_lowercase(), names.map(|name| around.join(name))),
                None => {
                    let (stem, letter) = x.name().split_at_checked(x.name().len().checked_sub(1)?)?;
                    let letters = match letter {
                        "x" => ["x", "y", "z"],
                        "X" => ["X", "Y", "Z"],
                        _ => return None,
                    };
                    let stem_of = stem.trim_end_matches('_').to_lowercase();
                    (!stem_of.is_empty()).then_some(())?;
                    (stem_of, letters.map(|letter| around.join(&format!("{stem}{letter}"))))
                }
            };
            let is_float = |path: &FieldPath| {
                let found = self.find(path);
                let float = |f: PathTarget| {
                    let is_list = matches!(f.count, Count::Array(_) | Count::Sequence);
                    let is_one = f.count == Count::One && listed == path.is_listed();
                    is_float(&f) && (is_one || listed && is_list && !path.is_listed())
                };
                found.is_some_and(float) && is_written(path)
            };
            axes.iter().all(is_float).then_some((stem, axes))
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
        (!path.is_listed()).then_some(())?;
        Some(Place { path: path.clone(), hops })
    }

    /// Whether a message is a list of three numbers or of unknown length, which is an element of a list itself.
    fn is_row(&self, path: &FieldPath, message: usize) -> bool {
        if path.segments().last().is_none_or(|last| last.element.is_none()) {
            return false;
        }
        let fields = self.messages.get(message).map_or(&[][..], |message| &message.fields);
        let [Field { name, kind: Kind::Number(_), count, .. }] = fields else { return false };
        name.is_empty() && matches!(count, Count::Array(3) | Count::Sequence)
    }

    /// Paths of the axes of lists in which x, y and z follow each other, reading by reading, as far as lengths tell.
    pub(in crate::imu) fn flat_lists(&self) -> Vec<(FieldPath, [FieldPath; 3])> {
        let is_flat = |path: &FieldPath| {
            let is_long = |count| match count {
                Count::Array(n) => n > 3 && n.is_multiple_of(3),
                // A list of any length may be a vector itself where languages have no fixed lengths.
                Count::Sequence => matches!(self.wire, Wire::Cdr | Wire::Ros1),
                Count::One => false,
            };
            self.find(path).is_some_and(|found| is_long(found.count) && is_float(&found)) && is_written(path)
        };
        let is_axis = |path: &FieldPath| path.parent().is_some_and(|around| self.listed_axes(&around).is_some());
        let flat = self.paths().into_iter().filter(|path| is_flat(path) && !is_axis(path));
        flat.map(|path| (path.clone(), [0, 1, 2].map(|axis| path.each(axis, 3)))).collect()
    }

    /// Paths of the lists of numbers that are elements of a list, but no vectors.
    pub(in crate::imu) fn rows(&self) -> Vec<FieldPath> {
        let is_row = |path: &FieldPath| match self.find(path) {
            Some(PathTarget { kind: Kind::Message(id), count: Count::One, .. }) => {
                let fields = self.messages.get(id).map_or(&[][..], |message| &message.fields);
                matches!(fields, [field] if field.name.is_empty()) && !self.is_row(path, id)
            }
            _ => false,
        };
        self.paths_in_lists().into_iter().filter(|path| path.is_listed() && is_row(path)).collect()
    }

    /// Paths and descriptions of the lists whose elements are no numbers and no messages.
    pub(in crate::imu) fn unread_lists(&self) -> Vec<(FieldPath, &'static str)> {
        let unread = self.paths().into_iter().filter_map(|path| match self.find(&path)?.kind {
            Kind::Unread(what) if what.starts_with("a list") => Some((path, what)),
            _ => None,
        });
        unread.collect()
    }

    fn is_vector(&self, path: &FieldPath) -> bool {
        match self.find(path) {
            Some(PathTarget { kind: Kind::Message(id), count: Count::One, .. }) if self.is_row(path, id) => true,
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

    /// Paths of every element of the lists `x`, `y` and `z` of a message that is not in a list itself.
    fn listed_axes(&self, path: &FieldPath) -> Option<[FieldPath; 3]> {
        let axes = ["x", "y", "z"].map(|axis| path.join(axis).every());
        axes.iter().all(|axis| self.find_number(axis).is_some()).then_some(axes)
    }

    fn find(&self, path: &FieldPath) -> Option<PathTarget> {
        let root = PathTarget { hops: Vec::new(), kind: Kind::Message(0), count: Count::One };
        path.segments().iter().try_fold(root, |found, segment| self.step(found, segment))
    }

    fn step(&self, from: PathTarget, segment: &Segment) -> Option<PathTarget> {
        let (Kind::Message(message), Count::One) = (from.kind, from.count) else { return None };
        let fields = &self.messages.get(message)?.fields;
        let field = self.field(message, &segment.name)?;
        let Field { kind, count, .. } = *fields.get(field)?;
        let count = match (segment.element, count) {
            (None, count) => count,
            (Some(Element::At(element)), Count::Array(n)) if element < n => Count::One,
            (Some(Element::At(element)), Count::Sequence) if element < MAX_ELEMENT => Count::One,
            (Some(Element::Each(_)), Count::Array(_) | Count::Sequence) => {
                // Only one of several lists inside each other holds the readings.
                from.hops.iter().all(|hop| !matches!(hop.element, Some(Element::Each(_)))).then_some(Count::One)?
            }
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
        self.collect(0, &FieldPath::default(), false, &mut paths);
        paths
    }

    /// These, and the paths of all fields in every element of a list.
    fn paths_in_lists(&self) -> Vec<FieldPath> {
        let mut paths = vec![FieldPath::default()];
        self.collect(0, &FieldPath::default(), true, &mut paths);
        paths
    }

    /// Appends the paths of the fields of `message` and of the messages inside it, and of those inside its lists only if
    /// `listed`.
    fn collect(&self, message: usize, path: &FieldPath, listed: bool, paths: &mut Vec<FieldPath>) {
        let Some(message) = self.messages.get(message) else { return };
        for field in &message.fields {
            if paths.len() >= MAX_PATHS {
                return;
            }
            let path = path.join(&field.name);
            paths.push(path.clone());
            match (field.kind, field.count) {
                (Kind::Message(inner), Count::One) => self.collect(inner, &path, listed, paths),
                (Kind::Message(inner), _) if listed && !path.is_listed() => {
                    paths.push(path.every());
                    self.collect(inner, &path.every(), listed, paths);
                }
                _ => {}
            }
        }
    }
}

/// Whether it can be written; JSON may contain names that cannot.
fn is_written(path: &FieldPath) -> bool {
    path.to_string().parse().as_ref() == Ok(path)
}

fn is_float(found: &PathTarget) -> bool {
    matches!(found.kind, Kind::Number(Number::F32 | Number::F64))
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
    for candidate in candidates.into_iter().filter(|name| !name.ends_with(PLACEHOLDER)) {
        let score = strsim::normalized_damerau_levenshtein(wanted, &candidate);
        if best.as_ref().is_none_or(|(highest, _)| score > *highest) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}
