//! Fleet of simulated sensors, none of whose recordings suffices: each shows some faces a day. Biases and scales walk,
//! every second sensor takes a shock, and placements scatter as the fit assumes, or otherwise.
#![allow(dead_code, clippy::unwrap_used)]

use nalgebra::Vector3;
use rand::seq::{IndexedRandom as _, SliceRandom as _};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::Stamp;
use stillpoint::config::Config;
use stillpoint::merge::{Change, Merge, Merged, outcome};
use stillpoint::messages::{self, Segment, TriadMean, segment::Reason};
use stillpoint::report::Findings;

pub const GRAVITY: f64 = 9.80665;
pub const DAY: i64 = 86_400_000_000_000;
/// Scatter from placement to placement that the fit assumes, m/s² and rad/s.
pub const SCATTER: f64 = 0.01;
pub const RATE_SCATTER: f64 = 2e-4;
/// Pace of the scale relative to the bias, in units of gravity.
const SCALE: f64 = 0.3;

/// Population that sensors are drawn from.
#[derive(Clone, Copy, Debug)]
pub struct Population {
    pub name: &'static str,
    /// Way that the bias walks over all recordings, m/s² (one standard deviation).
    pub drift: f64,
    /// Scatter of the placements over what is assumed.
    pub scatter: f64,
    /// Share of its variance that the placements of one recording have in common.
    pub common: f64,
    /// Fewest and most faces that a recording shows.
    pub faces: [usize; 2],
    /// Number of recordings, one a day.
    pub recordings: i64,
    /// Size of the shock that every second sensor takes, in scatters of an axis; none if empty.
    pub shock: [f64; 2],
}

/// Population of the target: one to three faces, a drift of twice the scatter, shocks of three to ten scatters.
pub const USUAL: Population = Population {
    name: "one to three faces",
    drift: 2.0 * SCATTER,
    scatter: 1.0,
    common: 0.0,
    faces: [1, 3],
    recordings: 40,
    shock: [3.0, 10.0],
};

/// Properties of a sensor at one time.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub bias: Vector3<f64>,
    pub scale: Vector3<f64>,
    pub gyro: Vector3<f64>,
}

/// What was merged of one sensor, beside the truth.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub merged: Merged,
    /// Truth after the last recording.
    pub truth: Truth,
    /// Day of the shock.
    pub shock: Option<i64>,
}

pub fn normal(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Configuration with a known gravity.
pub fn config() -> Config {
    let mut config = Config::default();
    config.fit.gravity = Some(GRAVITY);
    config
}

impl Truth {
    pub fn new(rng: &mut impl Rng) -> Self {
        Self { bias: normal(rng) * 0.15, scale: Vector3::repeat(1.0) + normal(rng) * 0.01, gyro: normal(rng) * 0.005 }
    }

    /// Truth after a day of so many.
    pub fn drift(&mut self, rng: &mut impl Rng, population: &Population) {
        let days = (population.recordings as f64).sqrt();
        self.bias += normal(rng) * (population.drift / days);
        self.scale += normal(rng) * (SCALE * population.drift / GRAVITY / days);
        self.gyro += normal(rng) * (RATE_SCATTER * population.drift / SCATTER / 2.0 / days);
    }

    /// Reading of a rest on a face (axis and sign); `common` is the part of the scatter of its recording.
    fn rest(
        &self,
        rng: &mut impl Rng,
        (recording, number): (i64, u32),
        (axis, sign): (usize, f64),
        population: &Population,
        common: &[Vector3<f64>; 2],
    ) -> Segment {
        let mut up = normal(rng) * 0.03;
        up[axis] = sign;
        let own = population.scatter * (1.0 - population.common).sqrt();
        let force = up.normalize() * GRAVITY + common[0] + normal(rng) * (SCATTER * own);
        let accel = self.bias + self.scale.component_mul(&force) + normal(rng) * 0.001;
        let gyro = self.gyro + common[1] + normal(rng) * (RATE_SCATTER * own);
        let mean = |sensor: &str, mean: Vector3<f64>, std: f64| TriadMean {
            sensor: sensor.to_owned(),
            samples: 400,
            effective_samples: 400.0,
            mean: Some(messages::Vector3 { x: mean.x, y: mean.y, z: mean.z }),
            covariance: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].map(|one| one * std * std).to_vec(),
            std: None,
        };
        let start = Stamp::from_nanos(recording + i64::from(number) * 10_000_000_000);
        Segment {
            start: Some(start.into()),
            end: Some(start.plus_nanos(4_000_000_000).into()),
            accepted: true,
            reason: Reason::Accepted.into(),
            means: vec![mean("accelerometer", accel, 0.02), mean("gyroscope", gyro, 0.001)],
            placement: number,
            ..Segment::default()
        }
    }

    /// Recording of so many different faces.
    pub fn recording(&self, rng: &mut impl Rng, at: i64, faces: usize) -> Findings {
        self.recording_of(rng, at, faces, &USUAL)
    }

    fn recording_of(&self, rng: &mut impl Rng, at: i64, faces: usize, population: &Population) -> Findings {
        let mut all: Vec<_> = (0..6).map(|k| (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 })).collect();
        all.shuffle(rng);
        let shared = population.scatter * population.common.sqrt();
        let common = [normal(rng) * (SCATTER * shared), normal(rng) * (RATE_SCATTER * shared)];
        let mut findings = Findings::new("/imu", "/imu");
        for (i, face) in all.into_iter().take(faces).enumerate() {
            let rest = self.rest(rng, (at, i as u32 + 1), face, population, &common);
            let start = rest.start.unwrap();
            findings.rests.insert(start.seconds * 1_000_000_000 + i64::from(start.nanos), rest);
        }
        findings
    }
}

impl Population {
    /// What becomes of one of its sensors; those with an even seed take a shock.
    pub fn sensor(&self, seed: u64) -> Outcome {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = Truth::new(&mut rng);
        let shaken = seed.is_multiple_of(2) && self.shock[1] > 0.0;
        let shock = shaken.then(|| rng.random_range(self.recordings / 5..self.recordings * 5 / 8));
        let mut merge = Merge::default();
        for day in 0..self.recordings {
            if shock == Some(day) {
                let mut by = |scatter: f64| {
                    let size = rng.random_range(self.shock[0]..self.shock[1]) * scatter;
                    Vector3::from_fn(|_, _| *[-size, size].choose(&mut rng).unwrap())
                };
                truth.bias += by(SCATTER);
                truth.gyro += by(RATE_SCATTER);
            }
            let faces = rng.random_range(self.faces[0]..=self.faces[1]);
            merge.join(Merge::of("/imu", &truth.recording_of(&mut rng, day * DAY, faces, self)));
            if day + 1 < self.recordings {
                truth.drift(&mut rng, self);
            }
        }
        let mut merged = outcome(&merge, &config());
        assert_eq!(merged.len(), 1);
        Outcome { merged: merged.pop().unwrap(), truth, shock }
    }
}

impl Outcome {
    /// Errors of the accelerometer's bias, of its scale, and of the gyroscope's bias, over their standard deviations;
    /// `None` without a calibration.
    pub fn scores(&self) -> Option<[[f64; 3]; 3]> {
        let calibration = self.merged.findings.calibration.as_ref()?;
        let (accelerometer, gyroscope) = (calibration.accelerometer.as_ref()?, calibration.gyroscope.as_ref()?);
        let list = |v: &Option<messages::Vector3>| v.as_ref().map(|v| [v.x, v.y, v.z]);
        let score = |value: &Option<messages::Vector3>, std: &Option<messages::Vector3>, truth: &Vector3<f64>| {
            let (value, std) = (list(value)?, list(std)?);
            Some([0, 1, 2].map(|axis| (value[axis] - truth[axis]) / std[axis]))
        };
        Some([
            score(&accelerometer.bias, &accelerometer.bias_std, &self.truth.bias)?,
            score(&accelerometer.scale, &accelerometer.scale_std, &self.truth.scale)?,
            score(&gyroscope.bias, &gyroscope.bias_std, &self.truth.gyro)?,
        ])
    }

    /// Whether the shock was found within one recording.
    pub fn is_found(&self) -> bool {
        self.merged.history.changes.iter().any(|change| self.is_shock(change))
    }

    /// Number of changes that were none.
    pub fn false_alarms(&self) -> usize {
        self.merged.history.changes.iter().filter(|change| !self.is_shock(change)).count()
    }

    fn is_shock(&self, change: &Change) -> bool {
        self.shock.is_some_and(|day| (change.before.nanos() / DAY - day).abs() <= 1)
    }
}
