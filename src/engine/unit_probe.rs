//! Unit probe: units from the data alone, by the magnitude of gravity at rest and the turns between rests, whatever the
//! noise.
//!
//! The detection of rests has ceilings in m/s² and rad/s, which readings in other units exceed. Here a rest is what is
//! quieter than the remainder of the recording, without a ceiling; nothing is calibrated by it.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::axes::{self, Stood, typical};
use super::units::{self, ForceScale, UnitFinding};
use crate::imu::{RateUnit, Sample, Sensor};
use crate::still::{self, Outcome, Rest, Segmenter};
use crate::turns::{Explanation, History};

/// Probe of the units of one IMU.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnitProbe {
    segmenter: Segmenter,
    turns: History,
    rests: VecDeque<Rest>,
    /// Number of all rests, and of those at the last conclusion.
    found: u64,
    concluded: u64,
}

/// Bound beyond any reading, in whatever unit. (Not infinite, which JSON cannot represent.)
const BEYOND: f64 = 1e15;
/// Largest number of rests stored.
const MOST_RESTS: usize = 65;
/// Shortest usable rest, s.
const SHORTEST: f64 = 0.5;

impl UnitProbe {
    /// Creates a probe with the configured windows.
    pub fn new(config: &still::Config) -> Self {
        let free = still::Config {
            accel_ceiling: BEYOND,
            gyro_ceiling: BEYOND,
            max_creep: BEYOND,
            detector: still::Detector::Adaptive,
            ..config.clone()
        };
        Self {
            segmenter: Segmenter::new(&free, 0),
            turns: History::default(),
            rests: VecDeque::new(),
            found: 0,
            concluded: 0,
        }
    }

    /// Takes a sample.
    pub fn push(&mut self, sensor: Sensor, sample: &Sample) {
        if !matches!(sensor, Sensor::Accelerometer | Sensor::Gyroscope) {
            return;
        }
        let outcome = self.segmenter.push(sensor, sample);
        if outcome == Outcome::Dropped {
            return;
        }
        match sensor {
            Sensor::Gyroscope => self.turns.push(sample),
            _ => self.turns.feel(sample),
        }
        if let Some((since, until)) = self.segmenter.open_rest() {
            self.turns.at_rest(since, until);
        }
        self.take_rests();
    }

    /// Closes an open rest at the end of the samples.
    pub fn finish(&mut self) {
        self.segmenter.finish();
        self.take_rests();
    }

    /// Whether enough rests were found since the last conclusion for another one.
    pub(super) fn is_due(&mut self) -> bool {
        let due = self.found > self.concluded + self.concluded / 3;
        if due {
            self.concluded = self.found;
        }
        due
    }

    /// Whether the conclusion will not change with more samples.
    pub fn is_settled(&mut self, unit: RateUnit) -> bool {
        self.is_due() && !matches!(self.gyroscope(unit), UnitFinding::Unknown)
    }

    /// Finding on the unit of a gyroscope that was taken to read in `unit`.
    pub fn gyroscope(&self, unit: RateUnit) -> UnitFinding<RateUnit> {
        match self.explanation(unit) {
            Explanation::Agrees => UnitFinding::Confirmed,
            Explanation::Otherwise { per_radian, or, axes } => {
                let (_, text) = units::otherwise(per_radian, or, axes, unit);
                UnitFinding::Other(text, units::rate_unit(per_radian, unit))
            }
            Explanation::Unknown | Explanation::Disagrees(_) => UnitFinding::Unknown,
        }
    }

    /// Magnitude of gravity at rest, in the assumed unit of the accelerometer; `None` without rests.
    pub fn gravity(&self) -> Option<f64> {
        typical(self.rests.iter().map(|rest| rest.accelerometer.mean.norm()))
    }

    /// Explanation of the turns by the gyroscope's readings.
    pub(super) fn explanation(&self, rate: RateUnit) -> Explanation {
        let stood = self.rests.iter().filter_map(|rest| {
            let rate = rest.gyroscope.as_ref()?.mean;
            Some(Stood { start: rest.start, force: rest.accelerometer.mean, rate })
        });
        axes::explanation(&self.turns, &stood.collect::<Vec<_>>(), rate)
    }

    /// Magnitude of gravity at rest, in assumed m/s², and the unit it seems to be in; `None` if it is as it should be.
    pub(super) fn force(&self, factor: f64) -> Option<(f64, ForceScale)> {
        let gravity = self.gravity()?;
        Some((gravity, ForceScale::of(gravity, factor)?))
    }

    fn take_rests(&mut self) {
        while let Some(rest) = self.segmenter.next_rest() {
            self.turns.rest(&rest);
            while self.segmenter.next_stretch().is_some() {}
            if rest.seconds() < SHORTEST {
                continue;
            }
            self.found += 1;
            if self.rests.len() == MOST_RESTS {
                self.rests.pop_front();
            }
            self.rests.push_back(rest);
        }
    }
}
