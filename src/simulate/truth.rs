//! True values of a simulated recording: parameters and rests. They are never part of the recording.

use serde::{Deserialize, Serialize};

use super::pose::{nearest_face, up};
use super::trajectory::Trajectory;
use super::{Error, Scenario, Triad, samples};
use crate::Stamp;

/// True values of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Magnitude of gravity, in m/s².
    pub gravity: f64,
    /// Seed of the randomness.
    pub seed: u64,
    /// Primary accelerometer.
    pub accelerometer: TriadTruth,
    /// Gyroscope, if there is one.
    pub gyroscope: Option<TriadTruth>,
    /// Secondary accelerometers by name.
    pub secondary: Vec<TriadTruth>,
    /// All rests, in order of time.
    pub rests: Vec<Rest>,
    /// Temperature at which the biases are as stated, °C, if it changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_reference: Option<f64>,
}

/// Parameters of one sensor: `measured = bias + S · true`, in m/s² or rad/s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriadTruth {
    /// `accelerometer`, `gyroscope`, or the name of the secondary.
    pub sensor: String,
    /// Topic of its messages.
    pub topic: String,
    /// Bias: reading without input, at the start of the recording, or at the reference of the temperature.
    pub bias: [f64; 3],
    /// Sensitivity, the map from true to measured, row by row.
    pub sensitivity: [[f64; 3]; 3],
    /// Gyroscope: sensitivity to specific force, rows of rad/s per m/s².
    pub g_sensitivity: Option<[[f64; 3]; 3]>,
    /// Gyroscope: sensitivity to the square of specific force on its own axis, in rad/s per (m/s²)².
    pub g2_sensitivity: Option<[f64; 3]>,
    /// Accelerometer: sensitivity to angular rate, rows of m/s² per rad/s.
    pub rate_sensitivity: Option<[[f64; 3]; 3]>,
    /// Standard deviation of the noise of one axis of one sample.
    pub noise: f64,
    /// Change of the bias with temperature, by degree: per °C, per °C², per °C³ from the reference of the temperature.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bias_by_temperature: Vec<[f64; 3]>,
}

/// A span without motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rest {
    /// Index of its pose in the scenario, from 0.
    pub pose: usize,
    /// First instant.
    pub start: Stamp,
    /// First instant of the motion that ends it.
    pub end: Stamp,
    /// Nearest face of a cube.
    pub face: String,
    /// Angle to that face, in degrees.
    pub tilt_deg: f64,
    /// Direction of the true specific force in the sensor's frame, of unit length.
    pub up: [f64; 3],
}

impl Truth {
    /// Truth of a scenario without its recording; [`record`](super::record) returns the same.
    ///
    /// # Errors
    /// If a value of the scenario cannot be simulated, with its key.
    pub fn of(scenario: &Scenario) -> Result<Self, Error> {
        Ok(Self::new(scenario, &samples(scenario)?.trajectory))
    }

    pub(super) fn new(scenario: &Scenario, trajectory: &Trajectory) -> Self {
        let start = Stamp::from_nanos(i64::from(scenario.recording.start_s) * 1_000_000_000);
        let rests = trajectory.rests().map(|(pose, from, until, attitude)| {
            let up = up(&attitude);
            let (face, tilt_deg) = nearest_face(&up);
            let (start, end) = (start.plus_nanos(from), start.plus_nanos(until));
            Rest { pose, start, end, face: face.to_owned(), tilt_deg, up: up.into_inner().into() }
        });
        let gyroscope = scenario.gyroscope.as_ref();
        Self {
            gravity: scenario.gravity,
            seed: scenario.recording.seed,
            accelerometer: TriadTruth::new("accelerometer", scenario.imu_topic(), &scenario.accelerometer),
            gyroscope: gyroscope.map(|triad| TriadTruth::new("gyroscope", scenario.imu_topic(), triad)),
            secondary: scenario.secondary.iter().map(|(name, triad)| TriadTruth::new(name, "", triad)).collect(),
            rests: rests.collect(),
            temperature_reference: scenario.temperature.as_ref().map(|temperature| temperature.reference),
        }
    }
}

impl TriadTruth {
    /// Truth of one sensor. `topic` is used if the sensor has none of its own.
    fn new(sensor: &str, topic: &str, triad: &Triad) -> Self {
        let sensitivity = triad.sensitivity.matrix();
        Self {
            sensor: sensor.to_owned(),
            topic: triad.topic.as_deref().unwrap_or(topic).to_owned(),
            bias: triad.bias,
            sensitivity: sensitivity.transpose().into(),
            g_sensitivity: triad.g_sensitivity,
            g2_sensitivity: triad.g2_sensitivity,
            rate_sensitivity: triad.rate_sensitivity,
            noise: triad.noise,
            bias_by_temperature: triad.bias_by_temperature.clone(),
        }
    }
}
