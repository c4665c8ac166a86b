//! The `[still]` table of the configuration.

use serde::{Deserialize, Serialize};

/// Settings of the detection of rests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Detector that decides.
    pub detector: Detector,
    /// Length of the sliding window, s; at least 20 samples.
    pub window_s: f64,
    /// Multiple of the noise floor below which the statistic must stay for the state to become STILL …
    pub enter: f64,
    /// … for this long, s.
    pub settle_s: f64,
    /// Multiple of the noise floor above which the state becomes MOVING.
    pub leave: f64,
    /// Shortest rest that is reported, s.
    pub min_rest_s: f64,
    /// Least time at rest of a placement that enters the fit, in one rest or several, s.
    pub min_fit_s: f64,
    /// Longest rest, s; longer ones are split.
    pub max_duration_s: f64,
    /// Least forward jump of the stamps that counts as a gap, s; at least five sample periods.
    pub gap_s: f64,
    /// Largest delay of a reading behind others, in seconds of their stamps, at which it is still sorted in; 0 sorts
    /// none.
    pub late_s: f64,
    /// Noise of an accelerometer axis above which nothing is accepted as a rest, m/s².
    pub accel_ceiling: f64,
    /// Noise of a gyroscope axis above which nothing is accepted as a rest, rad/s.
    pub gyro_ceiling: f64,
    /// Largest wander of the accelerometer's window mean during a rest, m/s².
    pub max_creep: f64,
    /// Largest difference between the mean rates of two rests; beyond it one of them is a turn, rad/s.
    pub max_turn: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            detector: Detector::Adaptive,
            window_s: 0.25,
            enter: 3.0,
            settle_s: 0.2,
            leave: 5.0,
            min_rest_s: 0.2,
            min_fit_s: 1.0,
            max_duration_s: 60.0,
            gap_s: 0.1,
            late_s: 0.1,
            accel_ceiling: 0.15,
            gyro_ceiling: 0.02,
            max_creep: 0.05,
            max_turn: 0.02,
        }
    }
}

/// Detector of rest and motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detector {
    /// Windowed deviation over the sensor's own noise floor, learned from the recording.
    #[default]
    Adaptive,
    /// The thesis' detector: per-axis moving standard deviation over 100 samples, below 0.15 m/s² and 0.15 °/s.
    MovingStd,
}
