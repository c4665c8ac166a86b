//! Outcome of an output.

/// Outcome of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Written {
    /// Written now.
    Now,
    /// It existed already, with the bytes that would have been written.
    Before,
}

impl Written {
    /// Outcome of two outputs together.
    pub(crate) fn and(self, other: Self) -> Self {
        if self == Self::Now { self } else { other }
    }
}
