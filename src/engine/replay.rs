//! Rests that were recorded twice: the readings of one are those of another, noise and all, so neither checks the other.

use super::fault::{Fault, FaultKind};
use super::rest_history::JudgedRest;
use crate::imu::Sensor;
use crate::still::TriadMean;

/// Fewest samples whose noise makes a rest unlike any other.
const LEAST: u64 = 50;
/// Largest relative difference of sums over the same samples.
const ROUNDING: f64 = 1e-9;

/// Faults of both sensors if a rest repeats another.
pub(super) fn detect(entries: &[JudgedRest]) -> Vec<Fault> {
    let mut rests: Vec<_> = entries.iter().filter(|entry| entry.verdict.is_at_rest()).map(|e| &e.rest).collect();
    rests.sort_by(|a, b| a.accelerometer.mean.x.total_cmp(&b.accelerometer.mean.x));
    let mut pairs = rests.windows(2).filter_map(|pair| <&[_; 2]>::try_from(pair).ok());
    let Some([one, other]) = pairs.find(|[one, other]| is_repeated(&one.accelerometer, &other.accelerometer)) else {
        return Vec::new();
    };
    let apart = other.start.seconds_since(one.start).abs();
    let text = format!(
        "the readings of one rest are those of another, noise and all, {apart:.0} s apart: the recording repeats itself, so its \
         rests do not check each other. Leave out the copies"
    );
    let fault = |sensor| Fault { sensor, kind: FaultKind::Replayed, text: text.clone() };
    [Sensor::Accelerometer, Sensor::Gyroscope].map(fault).into()
}

/// Whether two means are of the same samples. Readings without noise are always alike.
fn is_repeated(one: &TriadMean, other: &TriadMean) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
    one.samples == other.samples
        && one.samples >= LEAST
        && one.std().min() > 0.0
        && one.mean.iter().zip(&other.mean).all(|(a, b)| near(*a, *b))
        && one.std().iter().zip(&other.std()).all(|(a, b)| (a - b).abs() <= 1e-6 * a)
}
