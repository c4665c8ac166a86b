//! Noise of stretches of rest: the time between two motions, however many rests it was split into.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::allan_variance::AllanSums;
use super::triads::Triads;
use crate::imu::Sensor;

/// Largest number of stretches that wait for a credible floor.
const MOST: usize = 8;
/// Shortest stretch that may show a random walk of a bias, s …
const LASTING: f64 = 45.0;
/// … and that of an accelerometer, which is put down by hand and goes on tilting for a while.
const LASTING_ON_A_TABLE: f64 = 120.0;

/// Noise of an IMU in one stretch of rest, however many rests it was split into.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Stretch {
    /// Placement of its last rest.
    pub placement: u32,
    /// Allan sums of each triad with readings.
    pub noise: Vec<(Sensor, AllanSums)>,
}

/// Queue of stretches, oldest first.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Stretches(VecDeque<Stretch>);

impl Stretches {
    /// Adds the noise of the rests of these triads since the last motion. Of too many, the oldest is lost.
    pub(super) fn end(&mut self, placement: u32, triads: &Triads) {
        let Triads { accelerometer, gyroscope, secondary } = triads;
        let noise = std::iter::once((Sensor::Accelerometer, accelerometer.stretch(LASTING_ON_A_TABLE)))
            .chain(gyroscope.iter().map(|track| (Sensor::Gyroscope, track.stretch(LASTING))))
            .chain((0..).zip(secondary).map(|(i, track)| (Sensor::Secondary(i), track.stretch(LASTING_ON_A_TABLE))))
            .filter_map(|(sensor, sums)| Some((sensor, sums?)));
        if self.0.len() == MOST {
            self.0.pop_front();
        }
        self.0.push_back(Stretch { placement, noise: noise.collect() });
    }

    /// The next stretch.
    pub(super) fn next(&mut self) -> Option<Stretch> {
        self.0.pop_front()
    }
}
