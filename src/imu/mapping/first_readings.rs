//! First readings of a triad: their magnitude at rest, and the relation of two triads.

use nalgebra::{Matrix3, Vector3};

use crate::Stamp;
use crate::imu::sample::Sample;

/// First readings of a triad.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FirstReadings(Vec<Sample>);

/// Relation of two accelerometers with the same stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// Identical values.
    Same,
    /// One is an affine function of the other: a matrix and an offset.
    Affine,
}

/// Number of readings that are kept.
const MOST: usize = 1000;

/// Length of the windows, in readings; the quietest one is probably at rest.
const WINDOW: usize = 50;

impl FirstReadings {
    /// Adds a reading.
    pub fn push(&mut self, sample: Sample) {
        if self.wants_more() {
            self.0.push(sample);
        }
    }

    /// Whether there are too few readings yet.
    pub fn wants_more(&self) -> bool {
        self.0.len() < MOST
    }

    /// Magnitude of the readings in the quietest window, and whether their standard deviation there is below a tenth of
    /// it.
    pub fn at_rest(&self) -> Option<(f64, bool)> {
        let spread = |window: &&[Sample]| {
            let mean = mean(window);
            window.iter().map(|sample| (sample.value - mean).norm_squared()).sum::<f64>()
        };
        let windows = self.0.chunks_exact(WINDOW.min(self.0.len().max(1)));
        let quietest = windows.min_by(|a, b| spread(a).total_cmp(&spread(b)))?;
        let magnitude = mean(quietest).norm();
        let deviation = (spread(&quietest) / quietest.len() as f64).sqrt();
        Some((magnitude, deviation < magnitude / 10.0))
    }

    /// Whether two sensors seem to alternate: each reading is far from the previous one, and near the one before that.
    pub fn alternates(&self) -> bool {
        let steps = |distance: usize| {
            let pairs = self.0.iter().zip(self.0.iter().skip(distance));
            let mut steps: Vec<_> = pairs.map(|(a, b)| (a.value - b.value).norm()).collect();
            let middle = steps.len() / 2;
            (steps.len() > WINDOW).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
        };
        steps(1).zip(steps(2)).is_some_and(|(one, two)| one > 5.0 * two && one > 0.0)
    }

    /// Relation of this triad to another, if both have the same stamps and enough readings that differ.
    pub fn relation(&self, other: &Self) -> Option<Relation> {
        let pairs: Vec<_> = self.0.iter().filter_map(|a| other.at(a.stamp).map(|b| (a.value, b))).collect();
        let fewer = self.0.len().min(other.0.len());
        if pairs.len() < WINDOW || pairs.len() * 10 < fewer * 9 {
            return None;
        }
        if pairs.iter().all(|(a, b)| a == b) {
            return Some(Relation::Same);
        }
        is_affine(&pairs).then_some(Relation::Affine)
    }

    fn at(&self, stamp: Stamp) -> Option<Vector3<f64>> {
        // Stamps mostly increase; otherwise a reading may be missed.
        let at = self.0.binary_search_by_key(&stamp, |sample| sample.stamp).ok()?;
        self.0.get(at).map(|sample| sample.value)
    }
}

fn mean(samples: &[Sample]) -> Vector3<f64> {
    samples.iter().map(|sample| sample.value).sum::<Vector3<f64>>() / samples.len().max(1) as f64
}

/// Whether a least-squares map of the first vectors explains the second up to a thousandth of their deviation.
fn is_affine(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> bool {
    let n = pairs.len() as f64;
    let (a, b) = pairs.iter().fold((Vector3::zeros(), Vector3::zeros()), |(a, b), pair| (a + pair.0, b + pair.1));
    let (mean_a, mean_b) = (a / n, b / n);
    let mut within = Matrix3::zeros();
    let mut between = Matrix3::zeros();
    for (a, b) in pairs {
        let (a, b) = (a - mean_a, b - mean_b);
        within += a * a.transpose();
        between += b * a.transpose();
    }
    let Some(inverse) = within.try_inverse() else { return false };
    let map = between * inverse;
    let left = pairs.iter().map(|(a, b)| ((b - mean_b) - map * (a - mean_a)).norm_squared()).sum::<f64>();
    let all = pairs.iter().map(|(_, b)| (b - mean_b).norm_squared()).sum::<f64>();
    all > 0.0 && left <= 1e-6 * all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard gravity, m/s².
    const G: f64 = 9.80665;

    fn peek(value: impl Fn(f64) -> [f64; 3]) -> FirstReadings {
        let mut peek = FirstReadings::default();
        for i in 0..1500 {
            let value = value(f64::from(i)).into();
            peek.push(Sample { stamp: Stamp::from_nanos(i64::from(i) * 10), log_time: 0, value });
        }
        peek
    }

    fn noise(i: f64, k: f64) -> f64 {
        (i * k).sin() * 0.02
    }

    #[test]
    fn the_quietest_readings_are_taken_for_those_at_rest() {
        let shaken = |rest: f64| {
            peek(move |i| {
                let shake = if (400.0..600.0).contains(&i) { 0.0 } else { (i * 0.7).sin() * 20.0 };
                [noise(i, 1.3) + shake, noise(i, 2.1), rest + shake]
            })
        };
        let (rest, quiet) = shaken(9.81).at_rest().unwrap();
        assert!(quiet && (rest - 9.81).abs() < 0.02, "{rest}");
        assert!(!shaken(0.03).at_rest().unwrap().1);
        assert_eq!(FirstReadings::default().at_rest(), None);
    }

    #[test]
    fn two_sensors_that_take_turns_are_told_from_one_that_shakes() {
        let turns = peek(|i| [noise(i, 1.3), if i % 2.0 < 1.0 { 0.5 } else { -0.2 } + noise(i, 2.1), G]);
        assert!(turns.alternates());
        assert!(!peek(|i| [noise(i, 1.3), noise(i, 2.1), G]).alternates());
        assert!(!peek(|i| [(i * 0.1).sin(), 0.0, G]).alternates());
        assert!(!peek(|_| [0.0, 0.0, G]).alternates() && !FirstReadings::default().alternates());
    }

    #[test]
    fn a_copy_and_a_corrected_twin_are_told_from_another_sensor() {
        let raw = |i: f64| Vector3::new(noise(i, 1.3), noise(i, 2.1), G + noise(i, 3.7));
        let map = Matrix3::new(1.01, 0.002, 0.0, -0.001, 0.98, 0.01, 0.0, 0.0, 1.02);
        let this = peek(|i| raw(i).into());
        assert_eq!(this.relation(&peek(|i| raw(i).into())), Some(Relation::Same));
        let corrected = peek(|i| (map * raw(i) + Vector3::new(0.1, -0.2, 0.3)).into());
        assert_eq!(this.relation(&corrected), Some(Relation::Affine));
        assert_eq!(corrected.relation(&this), Some(Relation::Affine));
        assert_eq!(this.relation(&peek(|i| raw(i * 1.1).into())), None);
        let mut later = FirstReadings::default();
        (0..1000).for_each(|i| {
            let value = raw(f64::from(i));
            later.push(Sample { stamp: Stamp::from_nanos(i64::from(i) * 10 + 5), log_time: 0, value });
        });
        assert_eq!(this.relation(&later), None);
        assert_eq!(peek(|_| [0.0, 0.0, G]).relation(&peek(|_| [0.1, 0.0, G])), None);
    }
}
