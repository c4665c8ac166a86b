//! The `[fit]` table of the configuration.

use serde::{Deserialize, Serialize};

use super::gravity::Place;
use super::shape::Term;

/// How a calibration is fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Which measurement model.
    pub model: Model,
    /// Where the fit of the accelerometer stops.
    pub estimator: Estimator,
    /// Local gravity in m/s², if it is known. Otherwise it follows from the latitude, that from a position in the
    /// recording, and without any it is standard gravity with an uncertainty of 0.15 %.
    pub gravity: Option<f64>,
    /// Where the recording was made, in degrees north: for gravity and for the Earth's rotation.
    pub latitude_deg: Option<f64>,
    /// And how high above the ellipsoid, in m; unset, at sea level, give or take 500 m.
    pub height_m: Option<f64>,
    /// Topic of positions; unset, the first one of a known type.
    pub fix_topic: Option<String>,
    /// A rest further than this from every face of the fixture is rejected, in degrees.
    pub max_tilt_deg: f64,
    /// How far a specific force at rest repeats from placement to placement, one standard deviation in m/s²:
    /// what is assumed until repeated placements show it.
    pub placement_std: f64,
    /// The same for the mean rate of a gyroscope, in rad/s.
    pub rate_std: f64,
    /// How far a corrected reading may err in any direction, at 95 %, for a model that needs no faces to be believed, m/s².
    pub max_error: f64,
    /// Datasheet limits.
    pub bounds: Bounds,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            model: Model::Auto,
            estimator: Estimator::Magnitude,
            gravity: None,
            latitude_deg: None,
            height_m: None,
            fix_topic: None,
            max_tilt_deg: 15.0,
            placement_std: 0.01,
            rate_std: 1e-3,
            max_error: 0.1,
            bounds: Bounds::default(),
        }
    }
}

impl Config {
    /// The configured place.
    pub fn place(&self) -> Option<Place> {
        self.latitude_deg.map(|latitude_deg| Place { latitude_deg, height_m: self.height_m })
    }
}

/// A measurement model of an accelerometer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// The richest model that the rests determine.
    #[default]
    Auto,
    /// Bias and diagonal sensitivity, six unknowns: needs the faces of the fixture.
    BiasScale,
    /// Bias and lower-triangular sensitivity, nine unknowns: needs nine or more placements in spread directions, any.
    Triangular,
}

/// Where the fit of the accelerometer stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// After the refinement on the magnitude of gravity, which is immune to tilt.
    #[default]
    Magnitude,
    /// After the regression on the fixture's faces, as the thesis does.
    Fixture,
}

/// Limits on the parameters, as `[lower, upper]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bounds {
    /// Accelerometer bias, m/s².
    pub accel_bias: [f64; 2],
    /// Accelerometer scale, dimensionless.
    pub accel_scale: [f64; 2],
    /// Gyroscope bias, rad/s.
    pub gyro_bias: [f64; 2],
    /// Bias of a secondary accelerometer, m/s².
    pub secondary_bias: [f64; 2],
    /// Scale of a secondary accelerometer, dimensionless.
    pub secondary_scale: [f64; 2],
}

impl Bounds {
    /// Of a parameter of the primary accelerometer.
    pub fn accelerometer(&self, term: Term) -> [f64; 2] {
        match term {
            Term::Bias(_) => self.accel_bias,
            Term::Own(row, column) if row == column => self.accel_scale,
            _ => UNBOUNDED,
        }
    }

    /// Of a parameter of the gyroscope.
    pub fn gyroscope(&self, term: Term) -> [f64; 2] {
        match term {
            Term::Bias(_) => self.gyro_bias,
            _ => UNBOUNDED,
        }
    }

    /// Of a parameter of a secondary accelerometer.
    pub fn secondary(&self, term: Term) -> [f64; 2] {
        match term {
            Term::Bias(_) => self.secondary_bias,
            Term::Own(row, column) if row == column => self.secondary_scale,
            _ => UNBOUNDED,
        }
    }
}

const UNBOUNDED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl Default for Bounds {
    fn default() -> Self {
        Self {
            accel_bias: [-8.0, 8.0],
            accel_scale: [0.8, 1.25],
            gyro_bias: [-0.35, 0.35],
            secondary_bias: [-20.0, 20.0],
            secondary_scale: [0.5, 2.0],
        }
    }
}
