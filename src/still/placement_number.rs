//! Number of the placement that a rest belongs to: rests between which the sensor was not moved away share one.
//!
//! Motion alone makes no new placement, since a knock of the table is motion too. In between the sensor must have been
//! turned, which its gyroscope shows by the furthest that it ever was from where it lay; without a gyroscope, which way
//! the specific force went for longer than a knock lasts.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::rest::TriadMean;
use crate::Stamp;
use crate::imu::Sample;

/// A hand turns what it lifts by more than this, in rad: five degrees; a knock does not.
const TURNED: f64 = 0.087;
/// Specific force that lasts and is off by so much is a turn of 15° or a lift, in m/s².
const SHIFTED: f64 = 2.5;
/// Two rests that read further apart than this lie in another pose, in m/s²: five degrees.
const OTHER_POSE: f64 = 0.85;
/// A knock is over in a fraction of this, in seconds.
const LASTING: f64 = 0.5;
/// Samples further apart than this say nothing of the time between them, in seconds.
const GAP: f64 = 0.1;

/// The placement that the IMU is in.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Placement {
    number: u32,
    /// What its first rest read.
    first: Option<TriadMean>,
    /// Since the last rest, if it has moved at all.
    journey: Journey,
    moved: bool,
}

/// Motion since the last rest.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Journey {
    /// What the gyroscope read at rest, rad/s.
    bias: Vector3<f64>,
    last_rate: Option<Stamp>,
    /// ∫ rate dt, rad; a knock turns back, so the order of small turns does not matter.
    turned: Vector3<f64>,
    furthest: f64,
    /// Whether a gyroscope followed it.
    followed: bool,
    last_force: Option<Stamp>,
    /// Specific force off that of the rest, low-passed, m/s².
    off: Vector3<f64>,
    furthest_off: f64,
}

impl Placement {
    /// The number of a rest's placement. Without motion since the last rest, after a split or a gap, it is the same as
    /// long as it reads what the first rest of the placement read: what wandered by more than `max_creep` (m/s²) is another,
    /// however slowly it went. After motion it is another if the sensor was moved away.
    pub(super) fn place(&mut self, mean: &TriadMean, rate: Option<&TriadMean>, max_creep: f64) -> u32 {
        let stays = self.first.as_ref().is_some_and(|first| {
            let apart = (mean.mean - first.mean).norm();
            if self.moved {
                return apart <= OTHER_POSE && !self.journey.leads_away();
            }
            let noise = (first.mean_variance() + mean.mean_variance()).sum().sqrt();
            apart <= creep_limit(max_creep, noise)
        });
        if !stays {
            self.number = self.number.saturating_add(1);
            self.first = Some(mean.clone());
        }
        self.moved = false;
        self.journey = Journey { bias: rate.map_or(Vector3::zeros(), |rate| rate.mean), ..Journey::default() };
        self.number
    }

    /// The number of the last rest's.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// There was motion.
    pub(super) fn moved(&mut self) {
        self.moved = true;
    }

    /// Nothing that was read before is to be compared with what is read from now on.
    pub(super) fn forget(&mut self) {
        self.first = None;
    }

    /// Takes a reading of the gyroscope between rests.
    pub(super) fn turn(&mut self, sample: &Sample) {
        let journey = &mut self.journey;
        let step = journey.last_rate.replace(sample.stamp).map_or(0.0, |last| sample.stamp.seconds_since(last));
        journey.followed = true;
        if (0.0..=GAP).contains(&step) {
            journey.turned += (sample.value - journey.bias) * step;
            journey.furthest = journey.furthest.max(journey.turned.norm());
        }
    }

    /// Takes a reading of the accelerometer between rests.
    pub(super) fn feel(&mut self, sample: &Sample) {
        let Some(first) = &self.first else { return };
        let journey = &mut self.journey;
        let step = journey.last_force.replace(sample.stamp).map_or(0.0, |last| sample.stamp.seconds_since(last));
        if (0.0..=GAP).contains(&step) {
            journey.off += (sample.value - first.mean - journey.off) * (step / LASTING);
            journey.furthest_off = journey.furthest_off.max(journey.off.norm());
        }
    }
}

impl Journey {
    fn leads_away(&self) -> bool {
        if self.followed { self.furthest > TURNED } else { self.furthest_off > SHIFTED }
    }
}

/// How far two means of one placement may differ, m/s², when their difference has so much noise.
pub(super) fn creep_limit(max_creep: f64, noise: f64) -> f64 {
    max_creep + 4.0 * noise
}
