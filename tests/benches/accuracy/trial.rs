//! One simulated session through an engine, and what came of it beside the truth.

use nalgebra::{Matrix3, Vector3};
use stillpoint::engine::{Config, Engine, Event, Message, Secondary};
use stillpoint::fit;
use stillpoint::imu::{Preset, Sample};
use stillpoint::messages::triad::{Model, Status};
use stillpoint::messages::{Calibration, Triad, Vector3 as Numbers};
use stillpoint::simulate::{Reading, Scenario, TriadTruth, Truth, samples};

/// Three numbers that are estimated together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    AccelBias,
    AccelScale,
    SecondaryBias,
    SecondaryScale,
    GyroBias,
}

impl Quantity {
    pub const ALL: [Self; 5] =
        [Self::AccelBias, Self::AccelScale, Self::SecondaryBias, Self::SecondaryScale, Self::GyroBias];

    pub fn name(self) -> &'static str {
        match self {
            Self::AccelBias => "accel bias",
            Self::AccelScale => "accel scale",
            Self::SecondaryBias => "high-g bias",
            Self::SecondaryScale => "high-g scale",
            Self::GyroBias => "gyro bias",
        }
    }
}

/// One number beside its truth.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub error: f64,
    pub std: f64,
}

impl Seen {
    /// Whether the 95 % interval holds the truth.
    pub fn is_inside(self) -> bool {
        self.error.abs() <= 1.96 * self.std
    }
}

/// A session with its last calibration.
pub struct Trial {
    truth: Truth,
    /// What the accelerometer's bias moved by from the beginning to the end.
    moved: Vector3<f64>,
    calibration: Option<Calibration>,
    /// What the operator is told to do next.
    pub next_step: String,
}

impl Trial {
    /// Gravity is known to the engine, its other settings are the defaults.
    pub fn run(scenario: &Scenario) -> Self {
        let truth = Truth::of(scenario).unwrap();
        let secondary = truth.secondary.iter().map(|triad| Secondary {
            name: triad.sensor.clone(),
            topic: triad.topic.clone(),
            ..Secondary::default()
        });
        let fit = fit::Config { gravity: Some(truth.gravity), ..fit::Config::default() };
        let config = Config { secondary: secondary.collect(), fit, ..Config::default() };
        let (calibration, next_step) = learn_altered(scenario, config, |_, _| {});
        Self { calibration, next_step, truth, moved: Vector3::zeros() }
    }

    /// The same with the readings altered on their way, given the seconds since the first, which moves the bias by so much;
    /// a preset may be known.
    pub fn altered(
        scenario: &Scenario,
        preset: Option<Preset>,
        moved: Vector3<f64>,
        alter: impl FnMut(&mut Reading, f64),
    ) -> Self {
        let truth = Truth::of(scenario).unwrap();
        let fit = fit::Config { gravity: Some(truth.gravity), ..fit::Config::default() };
        let gyroscope = scenario.gyroscope.as_ref().map_or(String::new(), |_| "/imu".to_owned());
        let config = Config { gyroscope, fit, ..Config::default() };
        let config = match preset {
            Some(preset) => config.of(preset),
            None => config,
        };
        let (calibration, next_step) = learn_altered(scenario, config, alter);
        Self { calibration, next_step, truth, moved }
    }

    pub fn is_gyroscope_confirmed(&self) -> bool {
        self.triad(Quantity::GyroBias).is_some_and(|(triad, _)| triad.status() == Status::Confirmed)
    }

    /// Whether both accelerometers have a calibration.
    pub fn is_calibrated(&self) -> bool {
        let triads = [Quantity::AccelBias, Quantity::SecondaryBias].map(|quantity| self.triad(quantity));
        triads.iter().all(|triad| triad.is_some_and(|(triad, _)| triad.status() != Status::Undetermined))
    }

    pub fn is_confirmed(&self) -> bool {
        self.triad(Quantity::AccelBias).is_some_and(|(triad, _)| triad.status() == Status::Confirmed)
    }

    /// Worst-case error of the accelerometer, m/s².
    pub fn worst_case_error(&self) -> Option<f64> {
        self.triad(Quantity::AccelBias).and_then(|(triad, _)| triad.worst_case_error)
    }

    /// Of the three axes; none if they were not determined.
    pub fn errors(&self, quantity: Quantity) -> impl Iterator<Item = Seen> {
        self.triad(quantity).into_iter().flat_map(move |(triad, truth)| {
            let (value, std, truth) = match quantity {
                Quantity::AccelScale | Quantity::SecondaryScale => {
                    (&triad.scale, &triad.scale_std, in_frame_of(triad, truth).diagonal())
                }
                _ => (&triad.bias, &triad.bias_std, Vector3::from(truth.bias)),
            };
            let seen = |value: &Numbers, std: &Numbers| {
                // What is true now.
                let moved = if quantity == Quantity::AccelBias { self.moved } else { Vector3::zeros() };
                let error = vector(value) - truth - moved;
                (0..3).map(|i| Seen { error: error[i], std: vector(std)[i] }).collect::<Vec<_>>()
            };
            value.as_ref().zip(std.as_ref()).map(|(value, std)| seen(value, std)).unwrap_or_default()
        })
    }

    /// Whether the error of a corrected reading keeps to the published bound, for each of some directions of gravity;
    /// none without a calibration.
    pub fn are_bounded(&self) -> Vec<bool> {
        let Some((triad, truth)) = self.triad(Quantity::AccelBias) else { return Vec::new() };
        if triad.sensitivity.len() != 9 {
            return Vec::new();
        }
        let inverse = Matrix3::from_row_slice(&triad.sensitivity).try_inverse();
        let (Some(bound), Some(inverse)) = (triad.worst_case_error, inverse) else { return Vec::new() };
        let bias = triad.bias.as_ref().map(vector).unwrap_or_default();
        let sensitivity = in_frame_of(triad, truth);
        let error = |up: Vector3<f64>| {
            let force = up * self.truth.gravity;
            (inverse * (Vector3::from(truth.bias) + self.moved + sensitivity * force - bias) - force).norm()
        };
        // A spiral over the sphere.
        const DIRECTIONS: u32 = 50;
        let direction = |i: u32| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(DIRECTIONS);
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vector3::new(r * cos, r * sin, z)
        };
        (0..DIRECTIONS).map(|i| error(direction(i)) <= bound).collect()
    }

    fn triad(&self, quantity: Quantity) -> Option<(&Triad, &TriadTruth)> {
        let calibration = self.calibration.as_ref()?;
        match quantity {
            Quantity::AccelBias | Quantity::AccelScale => {
                Some((calibration.accelerometer.as_ref()?, &self.truth.accelerometer))
            }
            Quantity::SecondaryBias | Quantity::SecondaryScale => {
                Some((calibration.secondary.first()?, self.truth.secondary.first()?))
            }
            Quantity::GyroBias => Some((calibration.gyroscope.as_ref()?, self.truth.gyroscope.as_ref()?)),
        }
    }
}

/// The last calibration that an engine learns from a session.
pub fn learn(scenario: &Scenario, config: Config) -> Option<Calibration> {
    learn_altered(scenario, config, |_, _| {}).0
}

fn learn_altered(
    scenario: &Scenario,
    config: Config,
    mut alter: impl FnMut(&mut Reading, f64),
) -> (Option<Calibration>, String) {
    let mut engine = Engine::new(config);
    let mut events: Vec<Event> = Vec::new();
    let mut calibration = None;
    let mut next_step = String::new();
    let mut note = |events: &mut Vec<Event>| {
        for event in events.drain(..) {
            match event.message {
                Message::Calibration(news) => calibration = Some(*news),
                Message::Coverage(coverage) => next_step = coverage.next_step,
                _ => {}
            }
        }
    };
    let start = i64::from(scenario.recording.start_s) * 1_000_000_000;
    for mut reading in samples(scenario).unwrap() {
        let seconds = (reading.stamp.nanos() - start) as f64 * 1e-9;
        alter(&mut reading, seconds);
        let log_time = reading.stamp.nanos() as u64;
        let sample = Sample { stamp: reading.stamp, log_time, value: reading.measured };
        engine.push(reading.sensor, &sample, &mut events);
        note(&mut events);
    }
    engine.finish(&mut events);
    note(&mut events);
    (calibration, next_step)
}

/// The true S in the frame of an estimate: a lower-triangular one is that of the sensor's own axes.
fn in_frame_of(triad: &Triad, truth: &TriadTruth) -> Matrix3<f64> {
    let matrix = matrix(truth);
    match triad.model() {
        Model::Triangular => (matrix * matrix.transpose()).cholesky().unwrap().l(),
        _ => matrix,
    }
}

fn matrix(truth: &TriadTruth) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| truth.sensitivity[row][column])
}

fn vector(numbers: &Numbers) -> Vector3<f64> {
    Vector3::new(numbers.x, numbers.y, numbers.z)
}
