//! Fleet of simulated sensors, none of whose recordings suffices: each shows some faces a day. Biases and scales walk,
//! every second sensor takes a shock, and placements scatter as the fit assumes, or otherwise.
#![allow(dead_code, clippy::unwrap_used)]

use nalgebra::{SMatrix, SVector, Vector3};
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
    /// Least standard deviations of any estimate of the accelerometer's bias and scale, and of the gyroscope's bias.
    pub bound: [[f64; 3]; 3],
    /// Day of the shock.
    pub shock: Option<i64>,
}

/// Error of a number, its standard deviation as published, and the least that any estimate has.
#[derive(Clone, Copy, Debug)]
pub struct Error {
    pub error: f64,
    pub std: f64,
    pub bound: f64,
}

/// Counts over errors.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    /// Share inside of the 95 % intervals.
    pub covered: f64,
    /// Root mean square of the errors over their bounds.
    pub over_bound: f64,
}

impl Score {
    pub fn of(errors: impl Iterator<Item = Error>) -> Self {
        let (mut count, mut inside, mut squares) = (0.0, 0.0, 0.0);
        for Error { error, std, bound } in errors {
            count += 1.0;
            inside += f64::from(error.abs() <= 1.96 * std);
            squares += (error / bound).powi(2);
        }
        Self { covered: inside / count, over_bound: (squares / count).sqrt() }
    }
}

/// Cramér–Rao bound: covariance of an estimator that knows scatter, drift, and the day of a shock. Bias and scale of the
/// accelerometer, lean of its axes, and the offset that one recording has in common; bias and offset of the gyroscope.
struct Bound {
    accelerometer: SMatrix<f64, 12, 12>,
    gyroscope: SMatrix<f64, 6, 6>,
    population: Population,
}

pub fn normal(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Evidence of recordings of one sensor.
pub fn joined<'a>(all: impl IntoIterator<Item = &'a Findings>) -> Merge {
    all.into_iter().fold(Merge::default(), |mut sum, findings| {
        sum.join(Merge::of("/imu", findings));
        sum
    })
}

/// What it comes to.
pub fn only(merge: &Merge) -> Merged {
    let mut merged = outcome(merge, &config());
    assert_eq!(merged.len(), 1);
    merged.pop().unwrap()
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
        let [bias, scale, gyro] = population.steps();
        self.bias += normal(rng) * bias;
        self.scale += normal(rng) * scale;
        self.gyro += normal(rng) * gyro;
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
        let gyro = self.gyro + common[1] + normal(rng) * (RATE_SCATTER * own) + normal(rng) * 5e-5;
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

    /// Recording of a sensor of some population.
    pub fn recording_of(&self, rng: &mut impl Rng, at: i64, faces: usize, population: &Population) -> Findings {
        let mut all: Vec<_> = (0..6).map(|k| (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 })).collect();
        all.shuffle(rng);
        all.truncate(faces);
        self.recording_on(rng, at, &all, population)
    }

    /// Recording on these faces, by axis and sign.
    pub fn recording_on(
        &self,
        rng: &mut impl Rng,
        at: i64,
        faces: &[(usize, f64)],
        population: &Population,
    ) -> Findings {
        let shared = population.scatter * population.common.sqrt();
        let common = [normal(rng) * (SCATTER * shared), normal(rng) * (RATE_SCATTER * shared)];
        let mut findings = Findings::new("/imu", "/imu");
        for (i, face) in faces.iter().enumerate() {
            let rest = self.rest(rng, (at, i as u32 + 1), *face, population, &common);
            let start = rest.start.unwrap();
            findings.rests.insert(start.seconds * 1_000_000_000 + i64::from(start.nanos), rest);
        }
        findings
    }
}

impl Bound {
    fn new(population: Population) -> Self {
        let prior = SVector::from_fn(|i, _| [2.0_f64, 0.1, 0.015, 0.0][i / 3].powi(2));
        let gyroscope = SVector::from_fn(|i, _| [0.1_f64, 0.0][i / 3].powi(2));
        Self {
            accelerometer: SMatrix::from_diagonal(&prior),
            gyroscope: SMatrix::from_diagonal(&gyroscope),
            population,
        }
    }

    fn shake(&mut self) {
        for axis in 0..3 {
            self.accelerometer[(axis, axis)] += 4.0;
            self.gyroscope[(axis, axis)] += 0.01;
        }
    }

    fn drift(&mut self) {
        let [bias, scale, rate] = self.population.steps().map(|step| step * step);
        for axis in 0..3 {
            self.accelerometer[(axis, axis)] += bias;
            self.accelerometer[(3 + axis, 3 + axis)] += scale;
            self.gyroscope[(axis, axis)] += rate;
        }
    }

    fn learn(&mut self, findings: &Findings, truth: &Truth) {
        let Population { scatter, common, .. } = self.population;
        let [force, rate] = [SCATTER, RATE_SCATTER].map(|one| (one * scatter).powi(2));
        // The offset is another in every recording.
        for axis in 0..3 {
            for other in 0..12 {
                self.accelerometer[(9 + axis, other)] = 0.0;
                self.accelerometer[(other, 9 + axis)] = 0.0;
            }
            for other in 0..6 {
                self.gyroscope[(3 + axis, other)] = 0.0;
                self.gyroscope[(other, 3 + axis)] = 0.0;
            }
            self.accelerometer[(9 + axis, 9 + axis)] = force * common;
            self.gyroscope[(3 + axis, 3 + axis)] = rate * common;
        }
        for rest in findings.rests.values() {
            let mean = rest.means[0].mean.as_ref().unwrap();
            let force_seen = (Vector3::new(mean.x, mean.y, mean.z) - truth.bias).component_div(&truth.scale);
            let up = force_seen.normalize();
            let mut by = SVector::<f64, 12>::zeros();
            for axis in 0..3 {
                by[axis] = up[axis];
                by[3 + axis] = up[axis] * force_seen[axis];
                by[9 + axis] = up[axis];
            }
            for (place, (row, column)) in [(1, 0), (2, 0), (2, 1)].into_iter().enumerate() {
                by[6 + place] = up[row] * force_seen[column];
            }
            update(&mut self.accelerometer, &by, force * (1.0 - common) + 0.001 * 0.001);
            for axis in 0..3 {
                let by = SVector::<f64, 6>::from_fn(|i, _| f64::from(i % 3 == axis));
                update(&mut self.gyroscope, &by, rate * (1.0 - common) + 5e-5 * 5e-5);
            }
        }
    }

    fn stds(&self) -> [[f64; 3]; 3] {
        let of = |first: usize| [0, 1, 2].map(|axis| self.accelerometer[(first + axis, first + axis)].sqrt());
        [of(0), of(3), [0, 1, 2].map(|axis| self.gyroscope[(axis, axis)].sqrt())]
    }
}

/// Covariance after an equation with an error of this variance.
fn update<const N: usize>(covariance: &mut SMatrix<f64, N, N>, by: &SVector<f64, N>, variance: f64) {
    let along = *covariance * by;
    *covariance -= along * along.transpose() / (by.dot(&along) + variance);
}

impl Population {
    /// Steps of a day: bias and scale of the accelerometer, bias of the gyroscope.
    fn steps(&self) -> [f64; 3] {
        let days = (self.recordings as f64).sqrt();
        [self.drift, SCALE * self.drift / GRAVITY, RATE_SCATTER * self.drift / SCATTER / 2.0].map(|way| way / days)
    }

    /// What becomes of one of its sensors; those with an even seed take a shock.
    pub fn sensor(&self, seed: u64) -> Outcome {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = Truth::new(&mut rng);
        let shaken = seed.is_multiple_of(2) && self.shock[1] > 0.0;
        let shock = shaken.then(|| rng.random_range(self.recordings / 5..self.recordings * 5 / 8));
        let (mut merge, mut bound) = (Merge::default(), Bound::new(*self));
        for day in 0..self.recordings {
            if shock == Some(day) {
                let mut by = |scatter: f64| {
                    let size = rng.random_range(self.shock[0]..self.shock[1]) * scatter;
                    Vector3::from_fn(|_, _| *[-size, size].choose(&mut rng).unwrap())
                };
                truth.bias += by(SCATTER);
                truth.gyro += by(RATE_SCATTER);
                bound.shake();
            }
            let faces = rng.random_range(self.faces[0]..=self.faces[1]);
            let recording = truth.recording_of(&mut rng, day * DAY, faces, self);
            bound.learn(&recording, &truth);
            merge.join(Merge::of("/imu", &recording));
            if day + 1 < self.recordings {
                truth.drift(&mut rng, self);
                bound.drift();
            }
        }
        let mut merged = outcome(&merge, &config());
        assert_eq!(merged.len(), 1);
        Outcome { merged: merged.pop().unwrap(), truth, bound: bound.stds(), shock }
    }
}

impl Outcome {
    /// Errors of the accelerometer's bias, of its scale, and of the gyroscope's bias, each with its standard deviation
    /// and the least one; `None` without a calibration.
    pub fn errors(&self) -> Option<[[Error; 3]; 3]> {
        let calibration = self.merged.findings.calibration.as_ref()?;
        let (accelerometer, gyroscope) = (calibration.accelerometer.as_ref()?, calibration.gyroscope.as_ref()?);
        let list = |v: &Option<messages::Vector3>| v.as_ref().map(|v| [v.x, v.y, v.z]);
        let of = |value: &Option<messages::Vector3>,
                  std: &Option<messages::Vector3>,
                  truth: &Vector3<f64>,
                  bound: [f64; 3]| {
            let (value, std) = (list(value)?, list(std)?);
            Some([0, 1, 2].map(|i| Error { error: value[i] - truth[i], std: std[i], bound: bound[i] }))
        };
        Some([
            of(&accelerometer.bias, &accelerometer.bias_std, &self.truth.bias, self.bound[0])?,
            of(&accelerometer.scale, &accelerometer.scale_std, &self.truth.scale, self.bound[1])?,
            of(&gyroscope.bias, &gyroscope.bias_std, &self.truth.gyro, self.bound[2])?,
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
