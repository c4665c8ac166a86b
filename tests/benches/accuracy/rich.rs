//! The models that know how the sensor lies, on sessions that determine them: `cross-axis` on fixtures that are exact,
//! each face seen once, and `full` on the built-in rate table.
//!
//! The bound here is that of least squares on every sample truly at rest (of the rate table: every sample), the truth being
//! known and the noise white: the inverse of Σ J Jᵀ / σ². Errors are compared with it where placements do not scatter,
//! intervals are counted where they do, by as much as is assumed.

use nalgebra::{DMatrix, DVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::engine::Config;
use stillpoint::fit::{self, Fixture, FixtureConfig, Model, Parameterisation, Solid, Term, Truth};
use stillpoint::imu::Sensor;
use stillpoint::messages::Triad;
use stillpoint::simulate::{self, Pose, Scenario, Sensitivity, samples};

use super::trial::learn;

/// Parameters that are counted together.
pub const GROUPS: [&str; 6] = ["accel bias", "accel S", "accel by rate", "gyro bias", "gyro S", "gyro by force"];

/// A line of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rich {
    Cube,
    Dodecahedron,
    RateTable,
}

/// One parameter beside its truth.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    error: f64,
    std: f64,
    bound: f64,
}

impl Seen {
    pub fn over_bound(self) -> f64 {
        self.error / self.bound
    }

    /// Whether the 95 % interval holds the truth.
    pub fn is_inside(self) -> bool {
        self.error.abs() <= 1.96 * self.std
    }
}

impl Rich {
    pub const ALL: [Self; 3] = [Self::Cube, Self::Dodecahedron, Self::RateTable];

    pub fn name(self) -> &'static str {
        match self {
            Self::Cube => "cross-axis on a cube",
            Self::Dodecahedron => "cross-axis on a dodecahedron",
            Self::RateTable => "full on a rate table",
        }
    }

    /// Of both triads in the order of [`GROUPS`], where placements scatter by so many times what is assumed; none if they
    /// were refused.
    pub fn errors(self, seed: u64, scatter: f64) -> Option<[Vec<Seen>; 6]> {
        let (scenario, config) = (self.scenario(seed, scatter), self.config());
        let calibration = learn(&scenario, config)?;
        let (accelerometer, gyroscope) = match self {
            Self::RateTable => (Parameterisation::FULL_ACCELEROMETER, Parameterisation::FULL_GYROSCOPE),
            _ => (Parameterisation::MATRIX, Parameterisation::GYROSCOPE_AT_REST),
        };
        let mut groups: [Vec<Seen>; 6] = Default::default();
        let mut add = |first: usize, shape: Parameterisation, triad: &Triad, sensor, truth: &simulate::Triad| {
            let unknowns = shape.unknowns();
            let found = parameters(shape, triad)?;
            let bound = bound(shape, sensor, &scenario, truth.noise)?;
            for (i, term) in shape.terms().iter().enumerate() {
                let group = match term {
                    Term::Bias(_) => first,
                    Term::Own(..) => first + 1,
                    Term::Other(..) | Term::Square(_) => first + 2,
                };
                let std = triad.covariance.get(i * unknowns + i)?.sqrt();
                groups[group].push(Seen { error: found[i] - value(*term, truth), std, bound: bound[i].sqrt() });
            }
            Some(())
        };
        add(0, accelerometer, calibration.accelerometer.as_ref()?, Sensor::Accelerometer, &scenario.accelerometer)?;
        add(3, gyroscope, calibration.gyroscope.as_ref()?, Sensor::Gyroscope, scenario.gyroscope.as_ref()?)?;
        Some(groups)
    }

    fn config(self) -> Config {
        let solid = if self == Self::Dodecahedron { Solid::Dodecahedron } else { Solid::Cube };
        let fixture = FixtureConfig { solid, accuracy_deg: 0.0, ..FixtureConfig::default() };
        let model = if self == Self::RateTable { Model::Full } else { Model::CrossAxis };
        let gravity = Some(simulate::Scenario::builtin("rate-table").unwrap().gravity);
        let fit = fit::Config { gravity, model, fixture, ..fit::Config::default() };
        Config { reference: self == Self::RateTable, fit, ..Config::default() }
    }

    fn scenario(self, seed: u64, scatter: f64) -> Scenario {
        let mut scenario = Scenario::builtin("rate-table").unwrap();
        scenario.recording.seed = seed;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut entries = [(); 3].map(|()| [(); 3].map(|()| 0.01 * random.sample::<f64, _>(StandardNormal)));
        (0..3).for_each(|i| entries[i][i] += 1.0);
        scenario.accelerometer.sensitivity = Sensitivity::Matrix(entries);
        if self == Self::RateTable {
            return scenario;
        }
        let assumed = self.config().fit;
        scenario.reference = None;
        scenario.motion = simulate::Motion::default();
        scenario.accelerometer.rate_sensitivity = None;
        scenario.accelerometer.placement_scatter = scatter * assumed.placement_std;
        if let Some(gyroscope) = &mut scenario.gyroscope {
            gyroscope.placement_scatter = scatter * assumed.rate_std;
        }
        // As in the thesis' sequence 1; intervals need no minute.
        let rest_s = if scatter == 0.0 { 60.0 } else { 5.0 };
        let faces = Fixture::new(&assumed.fixture);
        let pose = |up: Vector3<f64>| Pose { up: Some(up.into()), rest_s, ..Pose::default() };
        scenario.pose = faces.faces().iter().map(|face| pose(face.normal)).collect();
        scenario
    }
}

/// In the order of the shape; none if it is another.
fn parameters(shape: Parameterisation, triad: &Triad) -> Option<Vec<f64>> {
    let bias = triad.bias.as_ref()?;
    let own = if shape.has(Term::Own(0, 1)) { triad.sensitivity.clone() } else { Vec::new() };
    let cross = [triad.rate_sensitivity.clone(), triad.g_sensitivity.clone(), triad.g2_sensitivity.clone()].concat();
    let all = [vec![bias.x, bias.y, bias.z], own, cross].concat();
    (all.len() == shape.unknowns()).then_some(all)
}

fn value(term: Term, truth: &simulate::Triad) -> f64 {
    match term {
        Term::Bias(axis) => truth.bias[axis],
        Term::Own(row, column) => truth.sensitivity.matrix()[(row, column)],
        Term::Other(row, column) => {
            truth.rate_sensitivity.or(truth.g_sensitivity).map_or(0.0, |rows| rows[row][column])
        }
        Term::Square(axis) => truth.g2_sensitivity.map_or(0.0, |squares| squares[axis]),
    }
}

/// Variances that no unbiased estimator can beat.
fn bound(shape: Parameterisation, sensor: Sensor, scenario: &Scenario, noise: f64) -> Option<DVector<f64>> {
    let mut information = DMatrix::zeros(shape.unknowns(), shape.unknowns());
    for reading in samples(scenario).unwrap().filter(|reading| reading.sensor == sensor) {
        if scenario.reference.is_none() && reading.pose.is_none() {
            continue;
        }
        let truth = match sensor {
            Sensor::Gyroscope => Truth { own: reading.rate, other: reading.force },
            _ => Truth { own: reading.force, other: reading.rate },
        };
        let jacobian = shape.jacobian(&truth);
        information += jacobian.tr_mul(&jacobian) / (noise * noise);
    }
    Some(information.try_inverse()?.diagonal())
}
