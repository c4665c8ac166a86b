//! What following the advice on poses brings: six faces first, then what the next step names, until the worst-case error
//! is small; beside a session that shows the six faces in turn again and again.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stillpoint::simulate::{Pose, Scenario};

use super::next_step::{self, FACES};
use super::population::Population;
use super::trial::Trial;

/// Worst-case error at which a session ends, m/s².
pub const ENOUGH: f64 = 0.05;
/// Poses after which somebody gives up.
pub const PATIENCE: usize = 42;

/// A session that was continued pose by pose.
pub struct Course {
    /// Number of poses at which the worst-case error was small, if it ever was.
    pub poses: Option<usize>,
    /// What came over what was promised, for each promise that fell due.
    pub kept: Vec<f64>,
}

/// One kind of session: with a gyroscope or without, and the scatter of placements over what is assumed.
#[derive(Clone, Copy)]
pub struct Sessions {
    pub name: &'static str,
    pub gyroscope: bool,
    pub scatter: f64,
}

impl Sessions {
    pub const ALL: [Self; 3] = [
        Self { name: "accelerometer alone", gyroscope: false, scatter: 1.0 },
        Self { name: "with a gyroscope", gyroscope: true, scatter: 1.0 },
        Self { name: "accelerometer alone, scatter 5", gyroscope: false, scatter: 0.5 },
    ];

    /// Does what the next step says.
    pub fn advised(self, seed: u64) -> Course {
        self.course(seed, |shown, next_step| {
            let every_face = next_step.contains("every face").then(|| Vector3::from(FACES[shown % 6].1));
            next_step::pose(next_step).or(every_face)
        })
    }

    /// Shows the faces in turn.
    pub fn repeated(self, seed: u64) -> Course {
        self.course(seed, |shown, _| Some(Vector3::from(FACES[shown % 6].1)))
    }

    fn course(self, seed: u64, next: impl Fn(usize, &str) -> Option<Vector3<f64>>) -> Course {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0xb05e);
        let mut scenario = Population::new(1, self.scatter).scenario(seed);
        scenario.latitude_deg = None;
        scenario.secondary.clear();
        if !self.gyroscope {
            scenario.gyroscope = None;
        }
        let (mut due, mut kept) = (Vec::new(), Vec::new());
        loop {
            let trial = trial(&scenario);
            let shown = scenario.pose.len();
            let error = trial.worst_case_error();
            due.retain(|(when, promised): &(usize, f64)| {
                if *when == shown {
                    kept.extend(error.map(|error| error / promised));
                }
                *when > shown
            });
            if error.is_some_and(|error| error <= ENOUGH) {
                return Course { poses: Some(shown), kept };
            }
            due.extend(next_step::promise(&trial.next_step).map(|(poses, error)| (shown + poses, error)));
            let Some(up) = next(shown, &trial.next_step).filter(|_| shown < PATIENCE) else {
                return Course { poses: None, kept };
            };
            scenario.pose.push(Pose { up: Some(up.into()), rest_s: random.random_range(2.5..3.5), ..Pose::default() });
        }
    }
}

fn trial(scenario: &Scenario) -> Trial {
    Trial::altered(scenario, None, Vector3::zeros(), |_, _| {})
}
