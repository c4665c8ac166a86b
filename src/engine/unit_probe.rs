//! Units told by the data alone: by gravity's length at rest, and by the turns between rests, whatever the noise.
//!
//! Rests are believed only under ceilings in m/s² and rad/s, which readings in other units do not keep. Here rest is what is
//! quieter than the rest of the recording, without a ceiling; nothing is calibrated by it.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::axes::{self, Stood, typical};
use super::units::{self, ForceScale, UnitFinding};
use crate::imu::{RateUnit, Sample, Sensor};
use crate::still::{self, Outcome, Rest, Segmenter};
use crate::turns::{Explanation, History};

/// Looks at the samples of one IMU.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnitProbe {
    segmenter: Segmenter,
    turns: History,
    rests: VecDeque<Rest>,
    /// All rests, and with how many of them it last concluded.
    found: u64,
    concluded: u64,
}

/// More than any sensor reads, in whatever unit. (Not infinite, which JSON cannot say.)
const BEYOND: f64 = 1e15;
/// So many rests are remembered.
const MOST_RESTS: usize = 65;
/// Shorter rests say too little, s.
const SHORTEST: f64 = 0.5;

impl UnitProbe {
    /// With windows as configured.
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

    /// No more samples come.
    pub fn finish(&mut self) {
        self.segmenter.finish();
        self.take_rests();
    }

    /// Whether so many more rests were found since the last time that another look is worth it.
    pub(super) fn is_due(&mut self) -> bool {
        let due = self.found > self.concluded + self.concluded / 3;
        if due {
            self.concluded = self.found;
        }
        due
    }

    /// Whether so much is known that more samples will not change it.
    pub fn is_settled(&mut self, unit: RateUnit) -> bool {
        self.is_due() && !matches!(self.gyroscope(unit), UnitFinding::Unknown)
    }

    /// Unit of a gyroscope that was taken to read in this one.
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

    /// Magnitude of gravity at rest, in what the accelerometer was taken to read in; `None` without rests.
    pub fn gravity(&self) -> Option<f64> {
        typical(self.rests.iter().map(|rest| rest.accelerometer.mean.norm()))
    }

    /// What the turns say, if anything.
    pub(super) fn explanation(&self, rate: RateUnit) -> Explanation {
        let stood = self.rests.iter().filter_map(|rest| {
            let rate = rest.gyroscope.as_ref()?.mean;
            Some(Stood { start: rest.start, force: rest.accelerometer.mean, rate })
        });
        axes::explanation(&self.turns, &stood.collect::<Vec<_>>(), rate)
    }

    /// Gravity's length at rest, in what is taken for m/s², and what it seems to be in.
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
