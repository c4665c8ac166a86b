//! Rests that were recorded twice: the readings of one are those of another, noise and all, so neither checks the other.

use std::collections::BTreeMap;

use super::fault::{Fault, FaultKind};
use super::rest_history::JudgedRest;
use crate::imu::Sensor;
use crate::still::{Rest, TriadMean};

/// Fewest samples whose noise makes a rest unlike any other.
const LEAST: u64 = 50;
/// Largest relative difference of sums over the same samples.
const ROUNDING: f64 = 1e-9;
/// Fewest hashes that two sketches of the same readings share.
const SHARED: usize = 2;

/// Faults of both sensors if a rest repeats another.
pub(super) fn detect(entries: &[JudgedRest]) -> Vec<Fault> {
    let rests: Vec<_> = entries.iter().filter(|entry| entry.verdict.is_at_rest()).map(|entry| &entry.rest).collect();
    let Some([one, other]) = with_the_same_readings(&rests).or_else(|| with_the_same_sums(rests)) else {
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

/// Two rests with long sequences of the same readings, wherever each begins and ends.
fn with_the_same_readings<'a>(rests: &[&'a Rest]) -> Option<[&'a Rest; 2]> {
    let mut known: BTreeMap<u64, &Rest> = BTreeMap::new();
    for rest in rests {
        let mut shared: BTreeMap<_, (usize, &Rest)> = BTreeMap::new();
        for hash in rest.accelerometer.sketch.hashes() {
            let before = *known.entry(*hash).or_insert(rest);
            if before.start != rest.start {
                shared.entry(before.start).or_insert((0, before)).0 += 1;
            }
        }
        if let Some((_, before)) = shared.into_values().find(|(count, _)| *count >= SHARED) {
            return Some([before, rest]);
        }
    }
    None
}

/// Two rests with the same sums, where nothing else is known of them, as where recordings are merged.
fn with_the_same_sums(mut rests: Vec<&Rest>) -> Option<[&Rest; 2]> {
    rests.sort_by(|a, b| a.accelerometer.mean.x.total_cmp(&b.accelerometer.mean.x));
    let mut pairs = rests.windows(2).filter_map(|pair| <[&Rest; 2]>::try_from(pair).ok());
    pairs.find(|[one, other]| is_repeated(&one.accelerometer, &other.accelerometer))
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
