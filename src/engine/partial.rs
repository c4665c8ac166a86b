//! Partial knowledge of triads that are not determined.

use super::refusal::Refusal;
use crate::messages::Combination;

/// Combinations of parameters that are known although not every parameter is.
#[derive(Clone, Debug)]
pub(super) struct Partial {
    /// Combinations of the primary accelerometer, or what speaks against all of them.
    pub(super) accelerometer: Result<Vec<Combination>, Refusal>,
    /// Combinations of the secondary ones.
    pub(super) secondary: Vec<Vec<Combination>>,
    /// Combinations of the gyroscope: its scale about the vertical.
    pub(super) gyroscope: Vec<Combination>,
}

impl Partial {
    /// Nothing is known.
    pub(super) fn nothing() -> Self {
        Self { accelerometer: Ok(Vec::new()), secondary: Vec::new(), gyroscope: Vec::new() }
    }
}
