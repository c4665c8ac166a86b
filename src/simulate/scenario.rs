//! Scenario, as described by a TOML file.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Fault, Temperature};

/// A session with one IMU: its sensors, the poses it rests in, and the motion between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Magnitude of gravity, in m/s².
    #[serde(default = "standard_gravity")]
    pub gravity: f64,
    /// Latitude at which the Earth's rotation is simulated, in degrees north; not simulated if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latitude_deg: Option<f64>,
    /// Standard deviation of the tilt of each placement about each of two horizontal axes, in degrees.
    #[serde(default)]
    pub tilt_scatter_deg: f64,
    /// Settings of the recording.
    pub recording: Recording,
    /// Primary accelerometer.
    pub accelerometer: Triad,
    /// Gyroscope, in the accelerometer's messages unless it has a topic of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyroscope: Option<Triad>,
    /// Further accelerometers that move with the primary one, by name.
    #[serde(default)]
    pub secondary: BTreeMap<String, Triad>,
    /// Reference for the true specific force and angular rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<Reference>,
    /// Temperature of the sensors; that of their biases if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Temperature>,
    /// Motion between poses.
    #[serde(default)]
    pub motion: Motion,
    /// Poses, one after the other; each is a placement of its own.
    pub pose: Vec<Pose>,
    /// Vibrations of the sensors, at rest and in motion.
    #[serde(default)]
    pub vibration: Vec<Vibration>,
}

/// Settings of a simulated recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Recording {
    /// Seed of all randomness.
    pub seed: u64,
    /// Stamp of the first sample, in seconds since the Unix epoch.
    pub start_s: u32,
    /// Encoding of the messages.
    pub encoding: Encoding,
    /// Profile of the recording; that of the encoding if absent.
    pub profile: Option<String>,
    /// Compression of the chunks.
    pub compression: Compression,
    /// Uncompressed size at which a chunk is closed, in bytes.
    pub chunk_bytes: u32,
    /// Coordinate frame named in each message.
    pub frame_id: String,
    /// Number of times that each message is recorded: 2, for instance, if a relay publishes it again.
    pub copies: u8,
}

impl Default for Recording {
    fn default() -> Self {
        Self {
            seed: 0,
            start_s: 1_700_000_000,
            encoding: Encoding::Ros2,
            profile: None,
            compression: Compression::Zstd,
            chunk_bytes: 256 * 1024,
            frame_id: "imu_link".to_owned(),
            copies: 1,
        }
    }
}

/// Encoding of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// CDR, with `ros2msg` schemas.
    Ros2,
    /// ROS 1, with `ros1msg` schemas.
    Ros1,
    /// Protobuf, with the descriptor set of a vendor's own messages.
    Protobuf,
    /// JSON, with a JSON schema.
    Json,
}

/// Compression of chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// No compression.
    None,
    /// LZ4 frames.
    Lz4,
    /// Zstandard.
    Zstd,
}

/// One sensor: `measured = bias + S · true + …`, in m/s² or rad/s.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Triad {
    /// Topic of its messages; `/imu/data_raw` if absent, and for a gyroscope the accelerometer's messages.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Sampling rate, in Hz. A gyroscope in the accelerometer's messages has the accelerometer's.
    pub rate_hz: f64,
    /// Time of the first sample after the start of the recording, in seconds.
    #[serde(default)]
    pub phase_s: f64,
    /// Bias: reading without input, in m/s² or rad/s.
    #[serde(default)]
    pub bias: [f64; 3],
    /// Sensitivity, the map from true to measured, dimensionless.
    #[serde(default)]
    pub sensitivity: Sensitivity,
    /// Standard deviation of the noise of one axis of one sample, in m/s² or rad/s.
    #[serde(default)]
    pub noise: f64,
    /// Correlation time of the noise (decay to 1/e), as after a low-pass filter, in seconds; 0 for white noise.
    #[serde(default)]
    pub noise_correlation_s: f64,
    /// Frequency at which its low-pass filter of first order takes off 3 dB, in Hz; what it measures is filtered, and
    /// `noise` is what is left of the noise. No filter if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bandwidth_hz: Option<f64>,
    /// Quantisation step, in m/s² or rad/s; 0 for none.
    #[serde(default)]
    pub step: f64,
    /// Largest reading, at which it saturates, in m/s² or rad/s; no saturation if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<f64>,
    /// Standard deviation of the offset that each placement adds to each axis, in m/s² or rad/s.
    #[serde(default)]
    pub placement_scatter: f64,
    /// Increase of the bias per hour, in m/s² or rad/s.
    #[serde(default)]
    pub bias_drift_per_h: [f64; 3],
    /// Change of the bias with temperature, by degree: m/s² or rad/s per °C, per °C², per °C³ from the reference of the
    /// temperature.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bias_by_temperature: Vec<[f64; 3]>,
    /// Gyroscope: sensitivity to specific force, rows of rad/s per m/s².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub g_sensitivity: Option<[[f64; 3]; 3]>,
    /// Gyroscope: sensitivity of each axis to the square of its own specific force, in rad/s per (m/s²)².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub g2_sensitivity: Option<[f64; 3]>,
    /// Accelerometer: sensitivity to angular rate, rows of m/s² per rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_sensitivity: Option<[[f64; 3]; 3]>,
    /// Faults of its readings before they are recorded.
    #[serde(default)]
    pub fault: Fault,
}

/// Reference that measures the truth: a rate table, or motion capture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Topic of its messages.
    pub topic: String,
    /// Sampling rate, in Hz.
    pub rate_hz: f64,
    /// Time of the first sample after the start of the recording, in seconds.
    #[serde(default)]
    pub phase_s: f64,
    /// Standard deviation of the noise of one axis of its specific force, in m/s².
    #[serde(default)]
    pub accel_noise: f64,
    /// Standard deviation of the noise of one axis of its angular rate, in rad/s.
    #[serde(default)]
    pub gyro_noise: f64,
}

impl Reference {
    /// The reference as two perfect sensors, apart from the noise.
    pub(super) fn triads(&self) -> [Triad; 2] {
        [self.accel_noise, self.gyro_noise].map(|noise| Triad {
            topic: Some(self.topic.clone()),
            rate_hz: self.rate_hz,
            phase_s: self.phase_s,
            noise,
            ..Triad::default()
        })
    }
}

/// Sensitivity matrix **S**, the map from true to measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected three numbers (the diagonal) or three rows of three numbers")]
pub enum Sensitivity {
    /// Scale factors without cross-axis sensitivity.
    Diagonal([f64; 3]),
    /// All nine elements, row by row.
    Matrix([[f64; 3]; 3]),
}

impl Default for Sensitivity {
    fn default() -> Self {
        Self::Diagonal([1.0; 3])
    }
}

impl Sensitivity {
    /// Sensitivity as a matrix.
    pub fn matrix(self) -> Matrix3<f64> {
        match self {
            Self::Diagonal(scale) => Matrix3::from_diagonal(&Vector3::from(scale)),
            Self::Matrix(rows) => matrix(rows),
        }
    }
}

/// A pose to rest in. Exactly one of `face`, `up` and `attitude` defines its attitude.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pose {
    /// Face of a cube that points up: `+X`, `-X`, …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub face: Option<String>,
    /// Direction in the sensor's frame that points up, of any length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up: Option<[f64; 3]>,
    /// Rotation from the sensor's frame to a world whose z axis points up, as a quaternion w, x, y, z.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude: Option<[f64; 4]>,
    /// Tilt of the sensor from this attitude, in degrees.
    pub tilt_deg: f64,
    /// Direction of the tilt, in degrees: 0 tips the up direction towards the axis after the one that it is nearest to
    /// (X to Y to Z to X); it increases right-handed about the up direction.
    pub azimuth_deg: f64,
    /// Rotation about the vertical, in degrees.
    pub heading_deg: f64,
    /// Duration of the rest, in seconds.
    pub rest_s: f64,
    /// Duration of the motion from the previous pose, in seconds; `motion.duration_s` if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion_s: Option<f64>,
    /// Constant rotation instead of a rest, about the world's axes, in degrees per second: about z a turn on a table,
    /// about x or y a slow creep.
    pub turn_deg_s: [f64; 3],
}

/// Motion between poses: the sensor is lifted, turned, carried and put down, smoothly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Motion {
    /// Duration from one pose to the next, in seconds.
    pub duration_s: f64,
    /// Motion before the first rest, in seconds; the recording starts in the middle of it.
    pub start_s: f64,
    /// Motion after the last rest, in seconds; the recording ends in the middle of it.
    pub end_s: f64,
    /// Distance that it is carried sideways, in metres.
    pub carry_m: f64,
    /// Height that it is lifted, in metres.
    pub lift_m: f64,
    /// Detour of the attitude on the way, in degrees.
    pub wobble_deg: f64,
    /// Root mean square of the hand's shake in each direction, in m/s².
    pub shake: f64,
    /// Frequency of the shake, in Hz.
    pub shake_hz: f64,
    /// Knock with which it is put down, in m/s²: it shakes vertically and rocks, both dying away before the rest.
    pub knock: f64,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            duration_s: 1.5,
            start_s: 0.0,
            end_s: 0.0,
            carry_m: 0.15,
            lift_m: 0.1,
            wobble_deg: 10.0,
            shake: 0.5,
            shake_hz: 5.0,
            knock: 0.0,
        }
    }
}

/// A sinusoidal acceleration, which only accelerometers measure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vibration {
    /// Amplitude along the sensor's axes, in m/s².
    pub amplitude: [f64; 3],
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Fraction of the amplitude that is modulated, 0 to 1; 0 is steady.
    #[serde(default)]
    pub modulation: f64,
    /// Frequency of the modulation, in Hz.
    #[serde(default)]
    pub modulation_hz: f64,
    /// Duration of a burst, in seconds; without it the vibration does not pause.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub burst_s: Option<f64>,
    /// Pause after each burst, in seconds.
    #[serde(default)]
    pub pause_s: f64,
}

impl Scenario {
    /// Topic of the primary accelerometer's messages.
    pub fn imu_topic(&self) -> &str {
        self.accelerometer.topic.as_deref().unwrap_or("/imu/data_raw")
    }

    /// All topics of the recording: of the primary accelerometer, of the gyroscope if it has its own, of the
    /// secondaries, of the reference, of the temperature.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        let others = self.gyroscope.iter().chain(self.secondary.values());
        let reference = self.reference.iter().map(|reference| reference.topic.as_str());
        let temperature = self.temperature.iter().filter_map(|temperature| temperature.topic.as_deref());
        let others = others.filter_map(|triad| triad.topic.as_deref());
        std::iter::once(self.imu_topic()).chain(others).chain(reference).chain(temperature)
    }
}

pub(super) fn matrix(rows: [[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

fn standard_gravity() -> f64 {
    9.80665
}
