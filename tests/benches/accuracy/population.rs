//! The sensors and sessions over which intervals are counted: drawn from what the model assumes, or, of the placement
//! scatter alone, from something else.
//!
//! Bias uniform within ±0.5 m/s², scale 1 ± 2 %, cross-axis sensitivity ± 1 % an entry (one standard deviation, half of what
//! the data sheets of both sensors call typical or less); the secondary is further turned by 2° about each axis, since two
//! packages on a board are not parallel. Faces are put down within 1° about each axis. Placements offset every axis of
//! every triad by a normal error of its own: the assumed standard deviation of that triad, times a factor. Each face is
//! visited so often for two to four seconds, in a random order. The Earth turns the gyroscope, somewhere on it (uniform
//! over its surface); in one session of two the box keeps its edges along those of the bench, in the other it is put down
//! facing anywhere.

use std::fmt;

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::fit;
use stillpoint::simulate::{Pose, Scenario, Sensitivity};

use super::trial::Trial;

/// Of a secondary beside the primary, about each axis.
const MOUNTING_DEG: f64 = 2.0;

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

    pub fn new(visits: usize, scatter: f64) -> Self {
        Self { visits, scatter }
    }

    /// What becomes of one of its sessions.
    pub fn trial(self, seed: u64) -> Trial {
        Trial::run(&self.scenario(seed))
    }

    /// One of its sessions.
    pub fn scenario(self, seed: u64) -> Scenario {
        const FACES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let assumed = fit::Config::default();
        let mut scenario = Scenario::builtin("thesis-sequence-1").unwrap();
        scenario.recording.seed = seed;
        scenario.tilt_scatter_deg = 1.0;
        scenario.motion.duration_s = 0.8;
        scenario.latitude_deg = Some(random.random_range::<f64, _>(-1.0..1.0).asin().to_degrees());
        let primary = std::iter::once((&mut scenario.accelerometer, 0.0));
        for (triad, turned_deg) in primary.chain(scenario.secondary.values_mut().map(|triad| (triad, MOUNTING_DEG))) {
            triad.bias = [(); 3].map(|()| random.random_range(-0.5..0.5));
            let mut normal = || random.sample::<f64, _>(StandardNormal);
            let own =
                Matrix3::from_fn(|row, column| if row == column { 1.0 + 0.02 * normal() } else { 0.01 * normal() });
            let mounting = Rotation3::from_scaled_axis(Vector3::from_fn(|_, _| turned_deg.to_radians() * normal()));
            triad.sensitivity = Sensitivity::Matrix((own * mounting).transpose().into());
            triad.placement_scatter = self.scatter * assumed.placement_std;
        }
        if let Some(gyroscope) = &mut scenario.gyroscope {
            gyroscope.placement_scatter = self.scatter * assumed.rate_std;
        }
        let (heading_deg, anywhere) = (random.random_range(0.0..360.0), random.random());
        scenario.pose = FACES
            .iter()
            .flat_map(|face| std::iter::repeat_n(face, self.visits))
            .map(|face| Pose {
                face: Some((*face).to_owned()),
                heading_deg: if anywhere { random.random_range(0.0..360.0) } else { heading_deg },
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
