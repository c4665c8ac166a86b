//! Properties of the stream of one triad as a whole, whatever it measured.

use super::saturation::ReadingRange;

/// Properties of a triad's stream so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Lowest and highest readings.
    pub extremes: ReadingRange,
    /// Smallest step between two readings of one axis, an upper bound of the resolution; `None` if nothing changed.
    pub step: Option<f64>,
    /// Standard deviation of one axis at rest, if known.
    pub noise: Option<f64>,
    /// Number of readings.
    pub readings: u64,
    /// Number of sensors whose readings seem to take turns; 1 unless most readings look like that.
    pub sensors: usize,
    /// Typical distance between a reading and the next at rest, if it is more than noise: that of sensors in turn, or a
    /// vibration at half the sampling rate.
    pub apart: Option<f64>,
    /// Number of readings that equal the reading before in all three axes.
    pub repeated: u64,
}

impl Signal {
    /// Whether noise hides the steps of the converter. Then a reading at rest hardly ever repeats another by chance,
    /// and the lowest and highest ones are rare.
    pub fn is_fine(&self) -> bool {
        let step = self.step.unwrap_or(f64::INFINITY);
        self.noise.is_some_and(|noise| noise > 2.5 * step)
    }
}
