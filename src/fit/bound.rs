//! The `[fit.bounds]` table of the configuration: limits on every parameter that a model may leave free.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::parameterisation::{Parameterisation, Term};

/// Lower and upper limit of a parameter: common to all axes that have it, or one for each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected [lower, upper], or one such pair for each of three axes")]
pub enum Bound {
    /// Common limits of all axes.
    Common([f64; 2]),
    /// Limits of x, y and z.
    PerAxis([[f64; 2]; 3]),
}

impl Bound {
    /// Limits of one axis.
    pub fn of(&self, axis: usize) -> [f64; 2] {
        match self {
            Self::Common(limits) => *limits,
            Self::PerAxis(limits) => limits.get(axis).copied().unwrap_or(UNBOUNDED),
        }
    }

    /// Whether a value of an axis lies within its limits.
    pub fn contains(&self, axis: usize, value: f64) -> bool {
        let [low, high] = self.of(axis);
        (low..=high).contains(&value)
    }
}

impl From<[f64; 2]> for Bound {
    fn from(limits: [f64; 2]) -> Self {
        Self::Common(limits)
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Common(limits) => write!(f, "{limits:?}"),
            Self::PerAxis(limits) => write!(f, "{limits:?}"),
        }
    }
}

/// Limits on the parameters, each `[lower, upper]` or one such pair for each axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bounds {
    /// Accelerometer bias, m/s².
    pub accel_bias: Bound,
    /// Accelerometer scale, dimensionless.
    pub accel_scale: Bound,
    /// Entries off the diagonal of the accelerometer's sensitivity.
    pub accel_cross_axis: Bound,
    /// Sensitivity of the accelerometer to angular rate, m/s² per rad/s.
    pub accel_rate_sensitivity: Bound,
    /// Gyroscope bias, rad/s.
    pub gyro_bias: Bound,
    /// Gyroscope scale, dimensionless.
    pub gyro_scale: Bound,
    /// Entries off the diagonal of the gyroscope's sensitivity.
    pub gyro_cross_axis: Bound,
    /// Sensitivity of the gyroscope to specific force, rad/s per m/s².
    pub gyro_g_sensitivity: Bound,
    /// Sensitivity of the gyroscope to the square of specific force along its axis, rad/s per (m/s²)².
    pub gyro_g2_sensitivity: Bound,
    /// Bias of a secondary accelerometer, m/s².
    pub secondary_bias: Bound,
    /// Scale of a secondary accelerometer, dimensionless.
    pub secondary_scale: Bound,
    /// Entries of the sensitivity of a secondary accelerometer under `cross-axis`, which includes its mounting.
    pub secondary_cross_axis: Bound,
}

impl Default for Bounds {
    fn default() -> Self {
        Self {
            accel_bias: [-8.0, 8.0].into(),
            accel_scale: [0.8, 1.25].into(),
            accel_cross_axis: [-0.2, 0.2].into(),
            accel_rate_sensitivity: [-0.5, 0.5].into(),
            gyro_bias: [-0.35, 0.35].into(),
            gyro_scale: [0.8, 1.25].into(),
            gyro_cross_axis: [-0.2, 0.2].into(),
            gyro_g_sensitivity: [-0.02, 0.02].into(),
            gyro_g2_sensitivity: [-0.002, 0.002].into(),
            secondary_bias: [-20.0, 20.0].into(),
            secondary_scale: [0.5, 2.0].into(),
            secondary_cross_axis: [-2.0, 2.0].into(),
        }
    }
}

impl Bounds {
    /// Returns bounds that limit nothing.
    pub fn none() -> Self {
        let free = Bound::Common(UNBOUNDED);
        Self {
            accel_bias: free,
            accel_scale: free,
            accel_cross_axis: free,
            accel_rate_sensitivity: free,
            gyro_bias: free,
            gyro_scale: free,
            gyro_cross_axis: free,
            gyro_g_sensitivity: free,
            gyro_g2_sensitivity: free,
            secondary_bias: free,
            secondary_scale: free,
            secondary_cross_axis: free,
        }
    }

    /// All bounds with their keys.
    pub fn named(&self) -> [(&'static str, Bound); 12] {
        [
            ("accel_bias", self.accel_bias),
            ("accel_scale", self.accel_scale),
            ("accel_cross_axis", self.accel_cross_axis),
            ("accel_rate_sensitivity", self.accel_rate_sensitivity),
            ("gyro_bias", self.gyro_bias),
            ("gyro_scale", self.gyro_scale),
            ("gyro_cross_axis", self.gyro_cross_axis),
            ("gyro_g_sensitivity", self.gyro_g_sensitivity),
            ("gyro_g2_sensitivity", self.gyro_g2_sensitivity),
            ("secondary_bias", self.secondary_bias),
            ("secondary_scale", self.secondary_scale),
            ("secondary_cross_axis", self.secondary_cross_axis),
        ]
    }

    /// Limits of a parameter of the primary accelerometer.
    pub fn accelerometer(&self, term: Term) -> [f64; 2] {
        match term {
            Term::Bias(axis) => self.accel_bias.of(axis),
            Term::Own(row, column) if row == column => self.accel_scale.of(row),
            Term::Own(row, _) => self.accel_cross_axis.of(row),
            Term::Other(row, _) => self.accel_rate_sensitivity.of(row),
            Term::Square(_) => UNBOUNDED,
        }
    }

    /// Limits of a parameter of the gyroscope.
    pub fn gyroscope(&self, term: Term) -> [f64; 2] {
        match term {
            Term::Bias(axis) => self.gyro_bias.of(axis),
            Term::Own(row, column) if row == column => self.gyro_scale.of(row),
            Term::Own(row, _) => self.gyro_cross_axis.of(row),
            Term::Other(row, _) => self.gyro_g_sensitivity.of(row),
            Term::Square(axis) => self.gyro_g2_sensitivity.of(axis),
        }
    }

    /// Limits of a parameter of a secondary accelerometer.
    pub fn secondary(&self, shape: Parameterisation, term: Term) -> [f64; 2] {
        match term {
            Term::Bias(axis) => self.secondary_bias.of(axis),
            Term::Own(row, _) if shape == Parameterisation::DIAGONAL => self.secondary_scale.of(row),
            Term::Own(row, _) => self.secondary_cross_axis.of(row),
            Term::Other(..) | Term::Square(_) => UNBOUNDED,
        }
    }
}

const UNBOUNDED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_is_common_or_one_for_each_axis() {
        let bounds: Bounds =
            toml::from_str("accel_bias = [-1, 1]\naccel_scale = [[0.9, 1.1], [0.8, 1.2], [1.0, 1.0]]").unwrap();
        assert_eq!(bounds.accelerometer(Term::Bias(2)), [-1.0, 1.0]);
        assert_eq!(bounds.accelerometer(Term::Own(1, 1)), [0.8, 1.2]);
        assert!(bounds.accel_scale.contains(2, 1.0) && !bounds.accel_scale.contains(2, 1.01));
        let error = toml::from_str::<Bounds>("accel_bias = [1, 2, 3]").unwrap_err().to_string();
        assert!(error.contains("expected [lower, upper]"), "{error}");
    }
}
