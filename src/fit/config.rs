//! The `[fit]` table of the configuration.

use serde::{Deserialize, Serialize};

use super::bound::Bounds;
use super::gravity::EarthLocation;
use super::temperature::TemperatureFit;
use crate::imu::HeadingConfig;

/// Settings of the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Measurement model of the accelerometer.
    pub model: Model,
    /// Stage after which the fit of the accelerometer stops.
    pub estimator: Estimator,
    /// Local gravity, m/s², if known. Otherwise it follows from the latitude; that, from a position in the recording.
    /// Without either it is standard gravity, ± 0.04 m/s² (95 %).
    pub gravity: Option<f64>,
    /// Latitude of the recording, degrees north: for gravity and for the Earth's rotation.
    pub latitude_deg: Option<f64>,
    /// Height above the ellipsoid, m; unset, sea level ± 500 m.
    pub height_m: Option<f64>,
    /// Topic of positions; unset, the first one of a known type.
    pub fix_topic: Option<String>,
    /// Largest angle between a rest and its nearest face, degrees; a rest further off is rejected.
    pub max_tilt_deg: f64,
    /// Repeatability of specific force at rest between placements, standard deviation, m/s²: assumed until repeated
    /// placements show it.
    pub placement_std: f64,
    /// Repeatability of the mean rate of a gyroscope at rest, likewise, rad/s.
    pub rate_std: f64,
    /// Standard deviation of the off-diagonal entries of an accelerometer's sensitivity where the model does not
    /// estimate them.
    pub cross_axis_std: f64,
    /// Quadratic nonlinearity of an accelerometer: what the square of a reading adds to it at 1 g, standard deviation,
    /// m/s². Six faces cannot tell it from a bias.
    pub nonlinearity: f64,
    /// Largest error of a corrected reading in the one direction where it is largest, at 95 %, with which a model that needs
    /// no faces is believed, m/s². It lies below the published worst case, which holds in all directions at once and for
    /// an error that one wrong placement could hide.
    pub max_error: f64,
    /// Whether each turn between two rests that looks like whole turns of a table was exactly that, ± 0.5°: it shows the
    /// gyroscope's scale about the vertical, as no other turn does.
    pub whole_turns: bool,
    /// Rotations about the vertical that are known, ± 0.5°.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rotations: Vec<RotationConfig>,
    /// Reference of heading, whose changes are rotations about the vertical.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<HeadingConfig>,
    /// Dependence of the biases on the temperature.
    #[serde(skip_serializing_if = "TemperatureFit::is_auto")]
    pub temperature: TemperatureFit,
    /// Loss function of the residuals.
    pub loss: Loss,
    /// Trigger of a refit.
    pub refit: Refit,
    /// Age at which a placement counts half, s: lets a calibration follow drift. Unset, none ages.
    pub half_life_s: Option<f64>,
    /// Fixture that the IMU is placed on.
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
            whole_turns: false,
            rotations: Vec::new(),
            heading: None,
            temperature: TemperatureFit::Auto,
            loss: Loss::Square,
            refit: Refit::Segment,
            half_life_s: None,
            fixture: FixtureConfig::default(),
            bounds: Bounds::default(),
        }
    }
}

impl Config {
    /// Configured place, if there is a latitude.
    pub fn place(&self) -> Option<EarthLocation> {
        self.latitude_deg.map(|latitude_deg| EarthLocation { latitude_deg, height_m: self.height_m })
    }
}

/// Measurement model of an accelerometer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// The richest model that the rests determine.
    #[default]
    Auto,
    /// Bias and diagonal sensitivity, six unknowns: needs the faces of the fixture.
    BiasScale,
    /// Bias and lower-triangular sensitivity, nine unknowns: needs nine or more placements in spread directions, on
    /// faces or not.
    Triangular,
    /// Bias and full sensitivity, twelve unknowns: needs an accurate fixture. Of the gyroscope: bias, sensitivity to
    /// specific force and to its square, fifteen unknowns.
    CrossAxis,
    /// `CrossAxis`, and the sensitivity of each triad to the other's quantity, and the gyroscope's own: 21 and 24
    /// unknowns. Needs a reference of true specific force and angular rate, in motion.
    Full,
}

/// Loss function of the residuals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// Least squares.
    #[default]
    Square,
    /// Huber's loss: quadratic up to 1.345 standard deviations, linear beyond.
    Huber,
}

/// Trigger of a refit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Refit {
    /// Every rest.
    #[default]
    Segment,
    /// A new rest on every face of the fixture.
    Round,
}

/// Fixture that the IMU is placed on: nominal directions of gravity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FixtureConfig {
    /// Solid that holds the IMU, its axes those of the IMU.
    pub solid: Solid,
    /// Mounting of the IMU in the solid, as a rotation vector in degrees: from the axes of the IMU to those of the
    /// solid.
    pub mounting_deg: [f64; 3],
    /// Accuracy of the directions, for `cross-axis`: standard deviation, degrees.
    pub accuracy_deg: f64,
    /// Faces, if they are those of no solid.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faces: Vec<FaceConfig>,
}

impl Default for FixtureConfig {
    fn default() -> Self {
        Self { solid: Solid::Cube, mounting_deg: [0.0; 3], accuracy_deg: 0.05, faces: Vec::new() }
    }
}

/// Solid with an IMU in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solid {
    /// Six faces, one along each axis.
    #[default]
    Cube,
    /// Twelve faces.
    Dodecahedron,
}

/// Face of a fixture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaceConfig {
    /// Name of the face.
    pub name: String,
    /// Direction that points up while the IMU rests on it, in the axes of the fixture, of any length.
    pub up: [f64; 3],
}

/// Known rotation about the vertical between two rests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotationConfig {
    /// Name of the IMU that turned; unset, each one of the recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imu: Option<String>,
    /// Time in the rest before it, s since the IMU's first reading, by the stamps of its messages.
    pub begin_s: f64,
    /// Time in the rest after it, likewise.
    pub end_s: f64,
    /// Rotation, degrees, counterclockwise seen from above, whole turns counted.
    pub angle_deg: f64,
}

/// Stage after which the fit of the accelerometer stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// Refinement on the magnitude of gravity, which is immune to tilt.
    #[default]
    Magnitude,
    /// Regression on the fixture's faces, as in the thesis.
    Fixture,
}
