//! What the stream of one triad is like as a whole, whatever it measured. What that says about the sensor is left to the
//! [`engine`](crate::engine).

use super::saturation::ReadingRange;

/// The character of a triad's stream so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Its lowest and highest readings.
    pub extremes: ReadingRange,
    /// Smallest step between two readings of one axis, an upper bound of the resolution; `None` where nothing changed.
    pub step: Option<f64>,
    /// Standard deviation of one axis at rest, as far as it is known.
    pub noise: Option<f64>,
    /// How many readings.
    pub readings: u64,
    /// How many of them were, in all three axes, the reading before.
    pub repeated: u64,
}

impl Signal {
    /// Whether noise hides the steps of the converter: a reading at rest hardly ever repeats another by itself, and the
    /// lowest and highest ones are rare.
    pub fn is_fine(&self) -> bool {
        let step = self.step.unwrap_or(f64::INFINITY);
        self.noise.is_some_and(|noise| noise > 2.5 * step)
    }
}
