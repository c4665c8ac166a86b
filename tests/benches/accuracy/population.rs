//! The sensors and sessions over which intervals are counted: drawn from what the model assumes, or, of the placement
//! scatter alone, from something else.
//!
//! Bias uniform within ±0.5 m/s², scale 1 ± 2 %, cross-axis sensitivity ± 1 % an entry (one standard deviation, what the
//! model assumes of entries that it does not estimate), of the secondary ± 3.5 %, since it is mounted within 2°; faces put
//! down within 1° about each axis. The Earth turns the gyroscope about any axis, the same on every face: the worst that
//! the model allows for. Placements offset every axis of every triad by a normal error of its own: the assumed standard
//! deviation of that triad, times a factor. Each face is visited so often for two to four seconds, in a random order.

use std::fmt;

use nalgebra::{Matrix3, Vector3};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::fit;
use stillpoint::simulate::{Pose, Scenario, Sensitivity};

use super::trial::Trial;

/// Two degrees.
const MOUNTING: f64 = 0.035;

/// A line of the table.
#[derive(Clone, Copy, Debug)]
pub struct Population {
    /// How often each face is visited.
    visits: usize,
    /// Scatter of the placements over what is assumed.
    scatter: f64,
}

impl Population {
    pub const ALL: [Self; 8] = [
        Self { visits: 1, scatter: 1.0 },
        Self { visits: 2, scatter: 1.0 },
        Self { visits: 2, scatter: 1.0 / 3.0 },
        Self { visits: 2, scatter: 3.0 },
        Self { visits: 3, scatter: 1.0 / 3.0 },
        Self { visits: 3, scatter: 3.0 },
        Self { visits: 4, scatter: 1.0 / 3.0 },
        Self { visits: 4, scatter: 3.0 },
    ];

    /// What becomes of one of its sessions.
    pub fn trial(self, seed: u64) -> Trial {
        let mut random = ChaCha8Rng::seed_from_u64(!seed);
        let earth = Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal)).normalize() * fit::EARTH_RATE;
        Trial::run(&self.scenario(seed), earth)
    }

    /// One of its sessions.
    fn scenario(self, seed: u64) -> Scenario {
        const FACES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let assumed = fit::Config::default();
        let mut scenario = Scenario::builtin("thesis-sequence-1").unwrap();
        scenario.recording.seed = seed;
        scenario.tilt_scatter_deg = 1.0;
        scenario.motion.duration_s = 0.8;
        let primary = std::iter::once((&mut scenario.accelerometer, 0.01));
        for (triad, leak) in primary.chain(scenario.secondary.values_mut().map(|triad| (triad, MOUNTING))) {
            triad.bias = [(); 3].map(|()| random.random_range(-0.5..0.5));
            let mut normal = || random.sample::<f64, _>(StandardNormal);
            let matrix =
                Matrix3::from_fn(|row, column| if row == column { 1.0 + 0.02 * normal() } else { leak * normal() });
            triad.sensitivity = Sensitivity::Matrix(matrix.transpose().into());
            triad.placement_scatter = self.scatter * assumed.placement_std;
        }
        if let Some(gyroscope) = &mut scenario.gyroscope {
            gyroscope.placement_scatter = self.scatter * assumed.rate_std;
        }
        scenario.pose = FACES
            .iter()
            .flat_map(|face| std::iter::repeat_n(face, self.visits))
            .map(|face| Pose {
                face: Some((*face).to_owned()),
                rest_s: random.random_range(2.0..4.0),
                ..Pose::default()
            })
            .collect();
        scenario.pose.shuffle(&mut random);
        scenario
    }
}

impl fmt::Display for Population {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = if self.visits == 1 { "once" } else { "times" };
        let visits = if self.visits == 1 { String::new() } else { format!("{} ", self.visits) };
        write!(f, "each face {visits}{times}, {:.2} × the scatter", self.scatter)
    }
}
