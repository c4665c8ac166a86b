//! Dependence of a bias on the temperature: a polynomial of order 1 to 3, from the rests.
//!
//! Two kinds of evidence, which are independent and are joined by their information. *Within* a placement nothing moves,
//! so what the readings change by is the change of the bias, on all axes; where the sensor lies does not matter.
//! *Between* placements a gyroscope at rest shows its biases again, but for what placements scatter by, and an
//! accelerometer shows that along gravity, from the length of its readings.
//!
//! A polynomial is believed only over enough of a range, if its highest term is beyond chance, and if the temperature
//! explains the readings better than time does: what drifts while the sensor warms need not drift because of it.

mod bias_course;
mod choice;
mod evidence;
mod points;

pub use self::bias_course::BiasCourse;
pub use self::choice::{HIGHEST, TemperatureFit};
pub use self::evidence::{Between, LengthEquation};
use self::evidence::{Estimated, Evidence, Regressors};
pub use self::points::WarmReading;

/// Reason why the dependence of a bias on the temperature is not told.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unclear {
    /// The temperature changed too little.
    #[error(
        "{:.1} to {:.1} °C are too little of a range to tell how the bias depends on the temperature: 10 °C show a line, 20 a \
         parabola, 30 a cubic",
        range[0], range[1]
    )]
    Span {
        /// Lowest and highest temperature, °C.
        range: [f64; 2],
    },
    /// Too few rests at different temperatures.
    #[error(
        "too few rests between {:.1} and {:.1} °C to tell how the bias depends on the temperature: let it lie still while it \
         warms, or show its faces again at other temperatures",
        range[0], range[1]
    )]
    Few {
        /// Lowest and highest temperature, °C.
        range: [f64; 2],
    },
    /// Some rests have no temperature.
    #[error(
        "{without} of {of} rests have no temperature, so how the bias depends on it is not told: record both together"
    )]
    Gaps {
        /// Number of those.
        without: usize,
        /// Number of rests.
        of: usize,
    },
    /// The bias does not change with the temperature beyond chance.
    #[error("the bias does not visibly depend on the temperature from {:.1} to {:.1} °C", range[0], range[1])]
    Steady {
        /// Lowest and highest temperature, °C.
        range: [f64; 2],
    },
    /// Time explains the readings as well.
    #[error(
        "time explains the changes of the bias as well as the temperature does ({:.1} to {:.1} °C): let it cool down and warm \
         up again while recording",
        range[0], range[1]
    )]
    Time {
        /// Lowest and highest temperature, °C.
        range: [f64; 2],
    },
}

/// Least range of temperature for each order, °C: 10 for a line, 20 for a parabola, 30 for a cubic.
pub const LEAST_SPAN: f64 = 10.0;
/// Coefficient beyond chance, in standard deviations of which 1.96 are half of a 95 % interval: 99.9 %.
const BEYOND_CHANCE: f64 = 3.29;
/// Logarithm of the odds by which the temperature must be likelier than time: 20 to 1.
const LIKELIER: f64 = 3.0;

/// Learns how a bias depends on the temperature, at most by a polynomial of order `most`. The readings of a placement
/// scatter by `within` between its rests, and placements by `between`, until they show otherwise (standard deviations in
/// the unit of the triad). The coefficients are about the temperature `reference`, °C.
///
/// # Errors
/// Reason why it is not told.
pub fn learn(
    readings: &[WarmReading],
    lengths: Between<'_>,
    most: usize,
    [within, between]: [f64; 2],
    reference: f64,
) -> Result<BiasCourse, Unclear> {
    let celsius = || readings.iter().map(|reading| reading.celsius);
    let range = [celsius().fold(f64::INFINITY, f64::min), celsius().fold(f64::NEG_INFINITY, f64::max)];
    let span = range[1] - range[0];
    let orders = (1..=most.min(HIGHEST)).rev().filter(|order| span >= LEAST_SPAN * *order as f64);
    let orders: Vec<_> = orders.collect();
    if orders.is_empty() {
        return Err(Unclear::Span { range });
    }
    let evidence = Evidence::new(readings, lengths, range, [within, between]);
    let (mut seen, mut like_time) = (false, false);
    for order in orders {
        let Some(alone) = evidence.estimate(Regressors { temperature: order, time: 0, drift: false }) else { continue };
        seen = true;
        if !is_clear(&alone, order) {
            continue;
        }
        let by_time = evidence.estimate(Regressors { temperature: 0, time: order, drift: false });
        let likelier = by_time.is_none_or(|by_time| alone.likelihood_over(&by_time) >= LIKELIER);
        // A bias may drift beside what the temperature does to it: the two are told apart, or neither is believed.
        let beside_drift = evidence.estimate(Regressors { temperature: order, time: 0, drift: true });
        match beside_drift.filter(|found| likelier && is_clear(found, order)) {
            Some(found) => {
                return Ok(BiasCourse::about(reference, range, &found.coefficients, &found.covariance, order));
            }
            None => like_time = true,
        }
    }
    Err(match (like_time, seen) {
        (true, _) => Unclear::Time { range },
        (false, true) => Unclear::Steady { range },
        (false, false) => Unclear::Few { range },
    })
}

/// Whether the term of highest degree in temperature is beyond chance on some axis.
fn is_clear(found: &Estimated, order: usize) -> bool {
    (0..3).any(|axis| {
        let at = 3 * (order - 1) + axis;
        found.coefficients[at].abs() > BEYOND_CHANCE * found.covariance[(at, at)].max(0.0).sqrt()
    })
}

#[cfg(test)]
mod tests;
