//! Triads of one IMU, with their windows and noise floors, and what they say together.
//!
//! Accelerometer and gyroscope vote on whether the sensor rests; secondary accelerometers do not.

use serde::{Deserialize, Serialize};

use super::config::{Config, Detector};
use super::placement_number::creep_limit;
use super::rest::{Rest, TriadMean};
use super::triad_track::{NoiseReference, TriadTrack};
use crate::Stamp;
use crate::imu::Sensor;

/// Longest silence of a gyroscope that still votes, ns.
const GYRO_SILENCE: i64 = 1_000_000_000;

/// Tracks of the triads.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Triads {
    pub(super) accelerometer: TriadTrack,
    pub(super) gyroscope: Option<TriadTrack>,
    pub(super) secondary: Vec<TriadTrack>,
}

impl Triads {
    /// Triads of an IMU with so many secondary accelerometers.
    pub(super) fn new(config: &Config, secondary: usize) -> Self {
        Self {
            accelerometer: TriadTrack::new(config, NoiseReference::accelerometer(config)),
            gyroscope: None,
            secondary: vec![TriadTrack::new(config, NoiseReference::None); secondary],
        }
    }

    /// Triad of a sensor; that of a gyroscope begins with its first sample.
    pub(super) fn of(&mut self, sensor: Sensor, config: &Config) -> Option<&mut TriadTrack> {
        match sensor {
            Sensor::Accelerometer => Some(&mut self.accelerometer),
            Sensor::Gyroscope => {
                Some(self.gyroscope.get_or_insert_with(|| TriadTrack::new(config, NoiseReference::gyroscope(config))))
            }
            Sensor::Secondary(i) => self.secondary.get_mut(i),
            Sensor::Reference(_) => None,
        }
    }

    /// Triad of a sensor, if there are samples of it.
    pub(super) fn get(&self, sensor: Sensor) -> Option<&TriadTrack> {
        match sensor {
            Sensor::Accelerometer => Some(&self.accelerometer),
            Sensor::Gyroscope => self.gyroscope.as_ref(),
            Sensor::Secondary(i) => self.secondary.get(i),
            Sensor::Reference(_) => None,
        }
    }

    /// Whether a rest is still one by the current floors.
    pub(super) fn are_quiet(&self, rest: &Rest, enter: f64) -> bool {
        let (accelerometer, gyroscope) = self.loudness(rest);
        accelerometer <= enter && gyroscope <= enter
    }

    /// Deviations of accelerometer and gyroscope during a rest, relative to their current floors.
    pub(super) fn loudness(&self, rest: &Rest) -> (f64, f64) {
        let over = |mean: &TriadMean, track: Option<&TriadTrack>| {
            let floor = track.filter(|track| track.is_learned()).and_then(TriadTrack::level);
            floor.map_or(0.0, |floor| mean.deviation() / floor)
        };
        let gyroscope = rest.gyroscope.as_ref().map_or(0.0, |mean| over(mean, self.gyroscope.as_ref()));
        (over(&rest.accelerometer, Some(&self.accelerometer)), gyroscope)
    }

    /// Whether the accelerometer's mean has moved away from that of the rest: a slow slide has little variance.
    pub(super) fn creep(&self, config: &Config) -> bool {
        let (Some(now), Some((mean, count))) = (self.accelerometer.window_mean(), self.accelerometer.open_mean())
        else {
            return false;
        };
        let (window, count) = (self.accelerometer.window_size() as f64, count as f64);
        let off = (now - mean).norm();
        // A mean of few samples says little: right after a split there is only one.
        if count < window || off <= config.max_creep || config.detector != Detector::Adaptive {
            return false;
        }
        let noise = self.accelerometer.level().unwrap_or(0.0) * (1.0 / window + 1.0 / count).sqrt();
        off > creep_limit(config.max_creep, noise)
    }

    /// Whether a floor has fallen since the rest began, so that its beginning was motion.
    pub(super) fn are_outdated(&self, enter: f64) -> bool {
        let outdated = |track: &TriadTrack| track.is_outdated(enter);
        outdated(&self.accelerometer) || self.gyroscope.as_ref().is_some_and(outdated)
    }

    /// Largest statistic of a triad that votes, over its floor.
    pub(super) fn statistic(&self) -> Option<f64> {
        let accelerometer = self.accelerometer.statistic()?;
        match self.voting_gyroscope() {
            None => Some(accelerometer),
            Some(gyroscope) => gyroscope.statistic().map(|gyroscope| gyroscope.max(accelerometer)),
        }
    }

    /// Longest time covered by a voting triad's window, ns: motion that far back shows in it.
    pub(super) fn window_span(&self) -> Option<i64> {
        let gyroscope = self.voting_gyroscope().and_then(TriadTrack::window_span);
        self.accelerometer.window_span().map(|span| span.max(gyroscope.unwrap_or(0)))
    }

    /// Stamp since which every voting triad's window is quiet.
    pub(super) fn window_start(&self) -> Option<Stamp> {
        let gyroscope = self.voting_gyroscope().and_then(TriadTrack::window_start);
        self.accelerometer.window_start().max(gyroscope)
    }

    /// Whether the floors of all triads that vote are credible.
    pub(super) fn are_credible(&self) -> bool {
        self.accelerometer.is_credible() && self.voting_gyroscope().is_none_or(TriadTrack::is_credible)
    }

    /// The gyroscope, unless it has been silent for long.
    fn voting_gyroscope(&self) -> Option<&TriadTrack> {
        let now = self.accelerometer.last_stamp()?;
        self.gyroscope
            .as_ref()
            .filter(|gyroscope| gyroscope.last_stamp().is_some_and(|last| now.since(last) < GYRO_SILENCE))
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &TriadTrack> {
        std::iter::once(&self.accelerometer).chain(&self.gyroscope).chain(&self.secondary)
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut TriadTrack> {
        std::iter::once(&mut self.accelerometer).chain(&mut self.gyroscope).chain(&mut self.secondary)
    }
}
