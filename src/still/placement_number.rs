//! Number of the placement that a rest belongs to: rests between which the sensor was not moved away share one.
//!
//! Motion alone makes no new placement, since a knock of the table is motion too. The sensor must also have been
//! turned. A gyroscope shows that by the largest angle from the pose at rest; without one, the specific force shows it
//! by a change that lasts longer than a knock.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::rest::TriadMean;
use crate::Stamp;
use crate::imu::Sample;

/// Least angle by which a hand turns what it places anew, rad: eight degrees. A knock, a push, or one edge on a pencil stays
/// below, and may leave the sensor askew.
const TURNED: f64 = 0.14;
/// Least lasting change of specific force that is a turn of 15° or a lift, m/s².
const SHIFTED: f64 = 2.5;
/// Least difference between two rests in different poses, m/s²: eight degrees, or fifteen where a gyroscope saw no turn, as
/// after push upon push.
const OTHER_POSE: f64 = 1.37;
const PUSHED_FAR: f64 = 2.5;
/// Time constant of a lasting change, s; a knock is over in a fraction of it.
const LASTING: f64 = 0.5;
/// Longest interval between samples that is integrated across, s.
const GAP: f64 = 0.1;

/// Current placement of the IMU.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Placement {
    number: u32,
    /// Mean of the accelerometer in its first rest.
    first: Option<TriadMean>,
    /// Motion since the last rest, and whether there was any.
    journey: Journey,
    moved: bool,
}

/// Motion since the last rest.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Journey {
    /// Mean rate at the last rest, rad/s.
    bias: Vector3<f64>,
    last_rate: Option<Stamp>,
    /// Integral ∫ rate dt, rad; a knock turns back, so the order of small turns does not matter.
    turned: Vector3<f64>,
    furthest: f64,
    /// Whether there were readings of a gyroscope.
    followed: bool,
    last_force: Option<Stamp>,
    /// Low-passed difference of specific force from that of the rest, m/s².
    off: Vector3<f64>,
    furthest_off: f64,
}

impl Placement {
    /// Number of a rest's placement. Without motion since the last rest, after a split or a gap, it stays while the
    /// rest reads the same as the first one of the placement: a mean that wandered by more than `max_creep` (m/s²)
    /// makes a new placement, however slowly. After motion the placement is new if the sensor was moved away.
    pub(super) fn place(&mut self, mean: &TriadMean, rate: Option<&TriadMean>, max_creep: f64) -> u32 {
        let stays = self.first.as_ref().is_some_and(|first| {
            let apart = (mean.mean - first.mean).norm();
            if self.moved {
                let other_pose = if self.journey.followed { PUSHED_FAR } else { OTHER_POSE };
                return apart <= other_pose && !self.journey.leads_away();
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

    /// Number of the last rest's placement.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Records motion since the last rest.
    pub(super) fn moved(&mut self) {
        self.moved = true;
    }

    /// Drops the readings so far from later comparisons.
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

/// Largest difference of two means of one placement, m/s², for a given noise of their difference.
pub(super) fn creep_limit(max_creep: f64, noise: f64) -> f64 {
    max_creep + 4.0 * noise
}
