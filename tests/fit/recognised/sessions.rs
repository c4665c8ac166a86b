//! Simulated sessions of an IMU, by seed, rate and noise.

use std::fmt;

use nalgebra::Vector3;
use stillpoint::imu::{Sample, Sensor};
use stillpoint::simulate::{Scenario, samples};

pub const FACES: [&str; 6] = ["+Z", "+X", "-Z", "-X", "+Y", "-Y"];

/// What differs between the sessions of a case.
pub struct Variation {
    pub seed: u64,
    pub rate: f64,
    /// Standard deviations of a sample: m/s², rad/s.
    pub noise: [f64; 2],
}

impl fmt::Display for Variation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "seed {}, {} Hz, noise {} {}", self.seed, self.rate, self.noise[0], self.noise[1])
    }
}

/// The truth of a triad: `measured = bias + scale · true`, the bias growing by `drift` in the session.
#[derive(Clone, Debug, Default)]
pub struct Truth {
    pub bias: Vector3<f64>,
    pub drift: Vector3<f64>,
    pub scale: Vector3<f64>,
    pub gyro_bias: Vector3<f64>,
}

/// What an IMU read.
pub struct Session {
    pub samples: Vec<(Sensor, Sample)>,
    /// By sample: the true specific force, and how many seconds it has rested (none in motion).
    pub force: Vec<Vector3<f64>>,
    pub rested: Vec<Option<f64>>,
    pub truth: Truth,
    pub period: f64,
}

const BIAS: [f64; 3] = [0.255, -0.142, 0.310];
const SCALE: [f64; 3] = [1.004, 0.996, 1.011];
const GYRO_BIAS: [f64; 3] = [0.011, -0.007, 0.004];

impl Variation {
    pub fn all() -> Vec<Self> {
        let variation = |seed, rate, noise| Self { seed, rate, noise };
        vec![
            variation(1, 100.0, [0.02, 0.002]),
            variation(2, 25.0, [0.01, 0.001]),
            variation(3, 1000.0, [0.06, 0.003]),
            variation(4, 200.0, [0.03, 0.0008]),
        ]
    }

    /// Six faces, and three of them once more.
    pub fn six(&self) -> Session {
        self.faces(&["+Z", "+X", "-Z", "-X", "+Y", "-Y", "+Z", "+X", "-Y"])
    }

    pub fn faces(&self, faces: &[&str]) -> Session {
        self.session(&poses(faces, "rest_s = 5"), "")
    }

    pub fn tilted(&self, degrees: f64) -> Session {
        let pose = |(i, face): (usize, &&str)| {
            format!("[[pose]]\nface = \"{face}\"\ntilt_deg = {degrees}\nazimuth_deg = {}\nrest_s = 5\n", 77 * i)
        };
        let faces = FACES.iter().chain(&FACES[..3]).enumerate().map(pose);
        self.session(&faces.collect::<String>(), "")
    }

    /// A long first rest before the six faces.
    pub fn resting_first(&self, seconds: u32) -> Session {
        self.session(&(poses(&["+Z"], &format!("rest_s = {seconds}")) + &poses(&FACES, "rest_s = 5")), "")
    }

    pub fn rests_of(&self, seconds: f64) -> Session {
        self.session(&poses(&FACES, &format!("rest_s = {seconds}")), "")
    }

    /// Eight hours at 25 Hz, as many samples at other rates.
    pub fn parked(&self) -> Session {
        self.session(&poses(&["+Z"], &format!("rest_s = {}", 8.0 * 3600.0 * 25.0 / self.rate)), "")
    }

    pub fn moving(&self) -> Session {
        self.session(&poses(&[FACES, FACES].concat(), "rest_s = 0.02"), "")
    }

    pub fn vibrating(&self, vibration: &str) -> Session {
        self.session(&format!("{}[[vibration]]\n{vibration}\n", poses(&FACES, "rest_s = 5")), "")
    }

    pub fn creeping(&self) -> Session {
        self.session(&poses(&FACES, "rest_s = 6\nturn_deg_s = [0.5, 0.3, 0.0]"), "")
    }

    /// A rest, then faces that turn about the vertical.
    pub fn turning(&self) -> Session {
        self.session(&(poses(&["+Z"], "rest_s = 6") + &poses(&FACES, "rest_s = 6\nturn_deg_s = [0.0, 0.0, 5.0]")), "")
    }

    pub fn merged(&self) -> Session {
        self.session(&poses(&[FACES, FACES].concat(), "rest_s = 4\nmotion_s = 0.01"), "")
    }

    /// A quarter of a m/s² in the session.
    pub fn drifting(&self) -> Session {
        let mut session = self.session(
            &poses(&[&FACES[..], &FACES[..3]].concat(), "rest_s = 5"),
            "bias_drift_per_h = [18.0, -14.0, 10.0]",
        );
        session.truth.drift = Vector3::new(18.0, -14.0, 10.0) * (9.0 * 6.2 / 3600.0);
        session
    }

    pub fn filtered(&self) -> Session {
        self.session(&poses(&FACES, "rest_s = 8"), &format!("noise_correlation_s = {}", 4.0 / self.rate))
    }

    pub fn noisy(&self, factor: f64) -> Session {
        Self { noise: self.noise.map(|noise| noise.min(0.02) * factor), ..*self }.six()
    }

    pub fn starting_in_motion(&self) -> Session {
        self.with_motion("start_s = 20\nend_s = 5")
    }

    /// Motion stays, gravity does not.
    pub fn gravity_removed(&self) -> Session {
        let mut session = self.six();
        for (i, (sensor, sample)) in session.samples.iter_mut().enumerate() {
            if *sensor == Sensor::Accelerometer {
                let moving = if session.rested[i].is_some() { 0.0 } else { 3.0 * (i as f64 * 0.37).sin() };
                sample.value -= session.force[i].component_mul(&Vector3::from(SCALE));
                sample.value = (sample.value - Vector3::from(BIAS)).add_scalar(moving);
            }
        }
        session
    }

    fn with_motion(&self, motion: &str) -> Session {
        self.simulated(&poses(&[&FACES[..], &FACES[..3]].concat(), "rest_s = 5"), "", motion)
    }

    fn session(&self, poses: &str, accelerometer: &str) -> Session {
        self.simulated(poses, accelerometer, "")
    }

    fn simulated(&self, poses: &str, accelerometer: &str, motion: &str) -> Session {
        let Self { seed, rate, noise: [accel, gyro] } = self;
        let text = format!(
            "tilt_scatter_deg = 1.0\n[recording]\nseed = {seed}\n\
             [accelerometer]\nrate_hz = {rate}\nbias = {BIAS:?}\nsensitivity = {SCALE:?}\nnoise = {accel}\nstep = 0.0006\n\
             placement_scatter = 0.005\n{accelerometer}\n\
             [gyroscope]\nrate_hz = {rate}\nbias = {GYRO_BIAS:?}\nnoise = {gyro}\nstep = 0.000133\n\
             [motion]\nduration_s = 1.2\n{motion}\n{poses}"
        );
        let scenario = Scenario::parse(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let mut session = Session {
            samples: Vec::new(),
            force: Vec::new(),
            rested: Vec::new(),
            truth: Truth {
                bias: BIAS.into(),
                drift: Vector3::zeros(),
                scale: SCALE.into(),
                gyro_bias: GYRO_BIAS.into(),
            },
            period: 1.0 / rate,
        };
        let mut pose = None;
        let mut since = 0.0;
        for reading in samples(&scenario).unwrap() {
            let now = reading.stamp.nanos() as f64 * 1e-9;
            if reading.pose != pose {
                (pose, since) = (reading.pose, now);
            }
            let sample =
                Sample { stamp: reading.stamp, log_time: reading.stamp.nanos() as u64, value: reading.measured };
            session.samples.push((reading.sensor, sample));
            session.force.push(reading.force);
            session.rested.push(pose.map(|_| now - since));
        }
        // The accelerometer comes last, as the intake hands them out.
        for pair in session.samples.chunks_mut(2) {
            pair.reverse();
        }
        session
    }
}

fn poses(faces: &[&str], how: &str) -> String {
    faces.iter().map(|face| format!("[[pose]]\nface = \"{face}\"\n{how}\n")).collect()
}
