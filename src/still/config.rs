//! The `[still]` table of the configuration.

use serde::{Deserialize, Serialize};

/// How rests are found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Which detector decides.
    pub detector: Detector,
    /// Length of the sliding window, in seconds; never fewer than 20 samples.
    pub window_s: f64,
    /// The state becomes STILL once the statistic has stayed under this multiple of the noise floor …
    pub enter: f64,
    /// … for this long, in seconds,
    pub settle_s: f64,
    /// and MOVING when it exceeds this multiple.
    pub leave: f64,
    /// Shorter rests are not reported, in seconds.
    pub min_rest_s: f64,
    /// Shorter rests are reported but do not enter the fit, in seconds.
    pub min_fit_s: f64,
    /// Longer rests are split, in seconds.
    pub max_duration_s: f64,
    /// Least forward jump of the stamps that counts as a gap, in seconds; never fewer than five sample periods.
    pub gap_s: f64,
    /// Readings that come later than others by no more, in seconds of their stamps, are sorted in; 0 sorts none.
    pub late_s: f64,
    /// Noise of an accelerometer axis above which nothing is believed to be a rest, in m/s².
    pub accel_ceiling: f64,
    /// Noise of a gyroscope axis above which nothing is believed to be a rest, in rad/s.
    pub gyro_ceiling: f64,
    /// How far the window mean of the accelerometer may wander during a rest, in m/s².
    pub max_creep: f64,
    /// How far the mean rates of two rests may differ before one of them is a turn, in rad/s.
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

/// A way to tell rest from motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detector {
    /// Windowed deviation over the sensor's own noise floor, learned from the recording.
    #[default]
    Adaptive,
    /// The thesis' detector: per-axis moving standard deviation over 100 samples, below 0.15 m/s² and 0.15 °/s.
    MovingStd,
}
