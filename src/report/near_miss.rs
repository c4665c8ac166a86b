//! Near misses: spans in which a sensor was nearly at rest, but not quiet enough or not long enough for a rest.

use nalgebra::Vector3;

use super::nanos;
use super::span_means::SpanMeans;
use crate::imu::{Sample, Sensor};
use crate::messages::Stillness;
use crate::messages::stillness::State;

/// Most spans that are kept; a recording of vibration has countless ones.
const KEPT: usize = 100;

/// A nearly still span of at most this length right after a rest is the transition out of it, ns.
const TRANSITION: i64 = 2_000_000_000;

/// Length of the window that the statistic is of, ns, about.
const WINDOW: i64 = 250_000_000;

/// Shortest span that a higher threshold may turn into a rest, ns.
const LASTING: i64 = 1_500_000_000;

/// A span that was nearly a rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearMiss {
    /// First nearly still stamp, ns.
    pub start: i64,
    /// Last nearly still stamp, ns.
    pub end: i64,
    /// Lowest statistic, in noise floors.
    pub lowest: f64,
    /// Threshold that the statistic had to fall below.
    pub enter: f64,
}

/// Near misses collected from the states of an IMU, in time order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NearMisses {
    all: Vec<NearMiss>,
    further: usize,
    /// A span that may still become a rest, and whether it began right after one.
    open: Option<(NearMiss, bool)>,
    /// Whether the last state was a rest.
    rested: bool,
    /// Readings of accelerometer and gyroscope.
    readings: [SpanMeans; 2],
}

impl NearMisses {
    /// Takes a reading. Without any, near misses have no face and no sensor.
    pub(crate) fn sample(&mut self, sensor: Sensor, sample: &Sample) {
        match sensor {
            Sensor::Accelerometer => self.readings[0].push(sample),
            Sensor::Gyroscope => self.readings[1].push(sample),
            _ => {}
        }
    }

    /// Takes the next state. A span that ends in a rest is no near miss, nor is the transition out of a rest.
    pub(super) fn note(&mut self, said: &Stillness) {
        let stamp = said.header.as_ref().map(|header| nanos(&header.stamp)).unwrap_or_default();
        let Stillness { statistic, enter, leave, .. } = *said;
        match said.state() {
            State::Moving if statistic < leave => {
                let begun = NearMiss { start: stamp, end: stamp, lowest: statistic, enter };
                let (open, _) = self.open.get_or_insert((begun, self.rested));
                open.end = stamp;
                open.lowest = open.lowest.min(statistic);
            }
            State::Moving => match self.open.take() {
                Some((miss, true)) if miss.end - miss.start < TRANSITION => {}
                Some((miss, _)) if self.all.len() < KEPT => self.all.push(miss),
                Some(_) => self.further += 1,
                None => {}
            },
            _ => self.open = None,
        }
        self.rested = said.state() == State::Still;
    }

    /// Mean of the accelerometer's readings, m/s², where a near miss was quietest, and the deviations √(Σ variance of the axes)
    /// of accelerometer and gyroscope there, m/s² and rad/s; `None` without readings.
    pub(super) fn told(&self, miss: &NearMiss) -> Option<(Vector3<f64>, f64, Option<f64>)> {
        let [accelerometer, gyroscope] = &self.readings;
        // The first state may tell of a window that began before.
        let (at, force) = accelerometer.quietest(miss.start.saturating_sub(WINDOW), miss.end)?;
        let rate = gyroscope.quietest(at, at).map(|(_, rate)| rate.deviation());
        Some((force.mean, force.deviation(), rate))
    }

    /// The spans that are kept.
    pub fn iter(&self) -> impl Iterator<Item = &NearMiss> {
        self.all.iter()
    }

    /// Number of near misses, kept or not.
    pub fn count(&self) -> usize {
        self.all.len() + self.further
    }

    /// Advice on how to turn half of them or more into rests, as a sentence; `None` without any.
    pub fn advice(&self) -> Option<String> {
        let mut lowest: Vec<_> = self.all.iter().map(|miss| miss.lowest).collect();
        lowest.sort_by(f64::total_cmp);
        let middle = lowest.get(lowest.len() / 2)?;
        // One that was quiet enough needs no other threshold.
        let lasts = |miss: &&NearMiss| miss.end - miss.start >= LASTING && miss.lowest >= miss.enter;
        let mut lasting: Vec<_> = self.all.iter().filter(lasts).map(|miss| miss.lowest).collect();
        lasting.sort_by(f64::total_cmp);
        if self.all.iter().all(|miss| *middle < miss.enter) {
            return Some("hold it still for longer: it was quiet enough, but not for long enough".to_owned());
        }
        // Thresholds take none that is over too soon.
        let Some(middle) = lasting.get(lasting.len() / 2) else {
            return Some("hold it against something firm, or set it down, for longer".to_owned());
        };
        let enter = (middle * 2.0).floor() / 2.0 + 0.5;
        Some(format!(
            "hold it against something firm, or set it down; if it vibrates by nature, --set still.enter={enter} \
             --set still.leave={} may take those that lasted",
            enter + 2.0
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::Header;

    fn misses(states: &[(State, f64)]) -> NearMisses {
        let mut misses = NearMisses::default();
        for (second, (state, statistic)) in states.iter().enumerate() {
            let stamp = prost_types::Timestamp { seconds: second as i64, nanos: 0 };
            let header = Some(Header { stamp: Some(stamp), frame_id: String::new() });
            let said = Stillness { header, state: (*state).into(), statistic: *statistic, enter: 3.0, leave: 5.0 };
            misses.note(&said);
        }
        misses
    }

    #[test]
    fn a_plateau_between_the_thresholds_is_one_and_what_became_a_rest_is_none() {
        use State::{Moving, Still, Unknown};
        let quiet = [(Moving, 90.0), (Moving, 4.1), (Moving, 3.6), (Moving, 3.9), (Moving, 90.0)];
        let found = misses(&quiet);
        let second = 1_000_000_000;
        let expected = NearMiss { start: second, end: 3 * second, lowest: 3.6, enter: 3.0 };
        assert_eq!(found.iter().copied().collect::<Vec<_>>(), [expected]);
        assert!(found.advice().unwrap().contains("still.enter=4 --set still.leave=6"));
        // What was quiet enough and lasted does not ask for the threshold that it has.
        let short = [(Moving, 90.0), (Moving, 4.1), (Moving, 3.6), (Moving, 90.0)];
        let one = [&short[..], &short, &[(Moving, 2.8), (Moving, 4.4), (Moving, 4.4), (Moving, 90.0)]].concat();
        assert!(misses(&one).advice().is_some_and(|advice| !advice.contains("--set")), "{:?}", misses(&one).advice());
        let brief = misses(&[(Moving, 90.0), (Moving, 4.1), (Moving, 3.6), (Moving, 90.0)]);
        assert!(brief.advice().is_some_and(|advice| !advice.contains("--set")), "{:?}", brief.advice());
        let short = misses(&[(Moving, 90.0), (Moving, 4.1), (Moving, 2.9), (Moving, 90.0)]);
        assert!(short.advice().unwrap().contains("not for long enough"), "{:?}", short.advice());
        for other in [
            &[(Moving, 90.0), (Moving, 4.1), (Still, 1.0), (Moving, 90.0)][..],
            &[(Moving, 90.0), (Moving, 5.5), (Moving, 90.0)],
            &[(Unknown, 4.0), (Unknown, f64::NAN), (Moving, 90.0)],
            &[(Still, 1.0), (Moving, 4.6), (Moving, 4.8), (Moving, 90.0)],
        ] {
            assert_eq!((misses(other).count(), misses(other).advice()), (0, None), "{other:?}");
        }
        let shaken_after_a_rest = [(Still, 1.0), (Moving, 4.6), (Moving, 4.6), (Moving, 4.6), (Moving, 90.0)];
        assert_eq!(misses(&shaken_after_a_rest).count(), 1);
        let many: Vec<_> = (0..KEPT + 5).flat_map(|_| quiet).collect();
        assert_eq!((misses(&many).count(), misses(&many).iter().count()), (KEPT + 5, KEPT));
    }
}
