//! Unit and axis order that the readings of a gyroscope may have, relative to those of an accelerometer.

use nalgebra::{Matrix3, Vector3};

/// Unit of recorded rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RateScale {
    /// Radians per second.
    Radians,
    /// Degrees per second.
    Degrees,
    /// Milliradians per second.
    Milliradians,
    /// Millidegrees per second.
    Millidegrees,
    /// Revolutions per minute.
    RevolutionsPerMinute,
    /// Revolutions per second.
    Revolutions,
    /// Counts of a converter, so many per °/s.
    Counts(f64),
    /// No known unit: so many readings per rad/s.
    Unknown(f64),
}

/// Counts per °/s of common converters: InvenSense and Bosch at ±2000, 1000, 500, 250 °/s, and ST at ±2000, 1000, 500,
/// 250 (MPU-6000/MPU-6050 product specification, rev. 3.4, table 6.1; LSM6DSO datasheet, rev. 2, table 2: 70, 35, 17.5,
/// 8.75 mdps a count).
const COUNTS: [f64; 8] = [16.4, 32.8, 65.5, 131.0, 1000.0 / 70.0, 1000.0 / 35.0, 1000.0 / 17.5, 1000.0 / 8.75];

impl RateScale {
    /// Returns all known units.
    pub fn all() -> impl Iterator<Item = Self> {
        let named = [
            Self::Radians,
            Self::Degrees,
            Self::Milliradians,
            Self::Millidegrees,
            Self::RevolutionsPerMinute,
            Self::Revolutions,
        ];
        named.into_iter().chain(COUNTS.map(Self::Counts))
    }

    /// Readings per rad/s.
    pub fn per_radian(self) -> f64 {
        match self {
            Self::Radians => 1.0,
            Self::Degrees => 1_f64.to_degrees(),
            Self::Milliradians => 1000.0,
            Self::Millidegrees => 1000.0 * 1_f64.to_degrees(),
            Self::RevolutionsPerMinute => 30.0 / std::f64::consts::PI,
            Self::Revolutions => 0.5 / std::f64::consts::PI,
            Self::Counts(per_degree) => per_degree * 1_f64.to_degrees(),
            Self::Unknown(per_radian) => per_radian,
        }
    }

    /// Known unit near a number of readings per rad/s, if there is one.
    pub fn near(per_radian: f64) -> Self {
        /// Largest error as a logarithm.
        const OFF: f64 = 0.11;
        let off = |scale: &Self| libm::log(scale.per_radian() / per_radian).abs();
        let nearest = Self::all().min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.filter(|scale| off(scale) < OFF).unwrap_or(Self::Unknown(per_radian))
    }
}

/// Axis order of a gyroscope: axis i of the accelerometer is, up to its sign, axis `from[i]` of the gyroscope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisOrder {
    /// Axis of the gyroscope for each axis of the accelerometer.
    pub from: [usize; 3],
    /// Whether that axis has the opposite sign.
    pub flipped: [bool; 3],
}

impl AxisOrder {
    /// Correct order.
    pub const RIGHT: Self = Self { from: [0, 1, 2], flipped: [false; 3] };

    /// Returns all 48 orders.
    pub fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];
        let flipped = |signs: u8| [signs & 1 != 0, signs & 2 != 0, signs & 4 != 0];
        ORDERS.into_iter().flat_map(move |from| (0..8).map(move |signs| Self { from, flipped: flipped(signs) }))
    }

    /// Whether each axis is its own, with either sign.
    pub fn is_in_order(self) -> bool {
        self.from == Self::RIGHT.from
    }

    /// Matrix that maps the gyroscope's readings into the accelerometer's axes.
    pub fn matrix(self) -> Matrix3<f64> {
        let row = |axis: usize| Vector3::ith(self.from[axis], if self.flipped[axis] { -1.0 } else { 1.0 }).transpose();
        Matrix3::from_rows(&[row(0), row(1), row(2)])
    }

    /// Whether it changes the handedness of the axes.
    pub fn is_mirrored(self) -> bool {
        self.matrix().determinant() < 0.0
    }

    /// Same order with opposite signs.
    pub fn reversed(self) -> Self {
        Self { flipped: self.flipped.map(|flipped| !flipped), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_48_orders_and_half_are_mirrored() {
        let all: Vec<_> = AxisOrder::all().collect();
        assert_eq!((all.len(), all.iter().filter(|order| order.is_mirrored()).count()), (48, 24));
        assert!(all.iter().enumerate().all(|(i, order)| !all[..i].contains(order)));
        assert_eq!(all[0], AxisOrder::RIGHT);
        assert!(all.iter().all(|order| order.is_mirrored() != order.reversed().is_mirrored()));
    }

    #[test]
    fn the_nearest_unit_is_found_through_scale_errors() {
        for scale in RateScale::all() {
            for error in [0.98, 1.0, 1.02] {
                assert_eq!(RateScale::near(scale.per_radian() * error), scale);
            }
        }
        assert_eq!(RateScale::near(4.0), RateScale::Unknown(4.0));
    }
}
