//! The `[fit]` table of the configuration.

use serde::{Deserialize, Serialize};

use super::bound::Bounds;
use super::gravity::Place;

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
    /// How large the entries of an accelerometer's sensitivity off the diagonal are where a model has no word for them, one
    /// standard deviation.
    pub cross_axis_std: f64,
    /// What the square of an accelerometer's reading adds to it at 1 g, one standard deviation in m/s²: six faces cannot tell
    /// it from a bias.
    pub nonlinearity: f64,
    /// How far a corrected reading may err in any direction, at 95 %, for a model that needs no faces to be believed, m/s².
    pub max_error: f64,
    /// How equations that are left over count.
    pub loss: Loss,
    /// When a calibration is fitted anew.
    pub refit: Refit,
    /// Age at which a placement counts half, in seconds: lets a calibration follow drift. Unset, none ages.
    pub half_life_s: Option<f64>,
    /// What the IMU is placed on.
    pub fixture: FixtureConfig,
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
            cross_axis_std: 0.01,
            nonlinearity: 0.0,
            max_error: 0.1,
            loss: Loss::Square,
            refit: Refit::Segment,
            half_life_s: None,
            fixture: FixtureConfig::default(),
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
    /// Bias and all of the sensitivity, twelve unknowns: needs a fixture that is accurate. Of the gyroscope, bias,
    /// sensitivity to specific force and to its square, fifteen unknowns.
    CrossAxis,
    /// That, the sensitivity of each triad to what the other measures, and the gyroscope's own: 21 and 24 unknowns. Needs a
    /// reference that knows the true specific force and angular rate, in motion.
    Full,
}

/// How equations that are left over count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// By their squares.
    #[default]
    Square,
    /// By their squares up to 1.345 standard deviations, by their distance beyond (Huber).
    Huber,
}

/// When a calibration is fitted anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Refit {
    /// With every rest.
    #[default]
    Segment,
    /// Once every face of the fixture was seen again.
    Round,
}

/// What the IMU is placed on: the directions that gravity is meant to take.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FixtureConfig {
    /// A solid that the IMU sits in, its axes those of the IMU.
    pub solid: Solid,
    /// How the IMU is turned in it, as a rotation vector in degrees: from its own axes to those of the solid.
    pub mounting_deg: [f64; 3],
    /// How accurate the directions are, for `cross-axis`: one standard deviation, in degrees.
    pub accuracy_deg: f64,
    /// The faces, if they are those of no solid.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faces: Vec<FaceConfig>,
}

impl Default for FixtureConfig {
    fn default() -> Self {
        Self { solid: Solid::Cube, mounting_deg: [0.0; 3], accuracy_deg: 0.05, faces: Vec::new() }
    }
}

/// A solid with an IMU in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solid {
    /// Six faces, one along each axis.
    #[default]
    Cube,
    /// Twelve.
    Dodecahedron,
}

/// One face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaceConfig {
    /// What it is called.
    pub name: String,
    /// What points up while the IMU rests on it, of any length.
    pub up: [f64; 3],
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
