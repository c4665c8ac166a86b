//! Magnitude of gravity and its uncertainty.

use serde::{Deserialize, Serialize};

use super::student_t::NORMAL_95;

/// Magnitude of gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gravity {
    /// Value, m/s².
    pub value: f64,
    /// Standard deviation, m/s²: 1.96 of them are half of the 95 % interval.
    pub std: f64,
    /// Source of the value.
    pub source: Source,
    /// Place of the recording, if known.
    pub place: Option<EarthLocation>,
}

/// Source of a value of gravity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Source {
    /// Value of `fit.gravity`.
    Configured,
    /// Latitude in `fit.latitude_deg`.
    Latitude,
    /// Position in the recording.
    FixTopic,
    /// Standard gravity: nothing is known of the place.
    Standard,
}

impl Source {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Configured => "configured",
            Self::Latitude => "latitude",
            Self::FixTopic => "fix topic",
            Self::Standard => "standard",
        }
    }
}

/// Place on the Earth, as far as gravity and the Earth's rotation depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EarthLocation {
    /// Geodetic latitude, degrees north.
    pub latitude_deg: f64,
    /// Height above the ellipsoid of WGS 84, m, if known.
    pub height_m: Option<f64>,
}

/// Angular rate of the Earth, rad/s (IERS Conventions 2010, nominal mean).
pub const EARTH_RATE: f64 = 7.292_115e-5;
/// Standard gravity, m/s² (CGPM 1901).
const STANDARD: f64 = 9.80665;
/// Range of gravity about the standard where people live, m/s²: from the highest town near the equator (La Rinconada,
/// Peru, 5,100 m: 9.768 m/s²) to the settlement nearest to a pole (Alert, Canada: 9.831 m/s²).
const STANDARD_RANGE: f64 = 0.04;
/// Gravity anomalies, such as mountains and ore, which normal gravity does not model: about 50 mGal, m/s².
const ANOMALY: f64 = 5e-4;
/// Standard deviation of an unknown height, which is taken as zero, m.
const UNKNOWN_HEIGHT: f64 = 500.0;
/// Standard deviation of a given height, m: fixes count from the ellipsoid, people from the sea, up to 100 m off.
const KNOWN_HEIGHT: f64 = 30.0;
/// Free-air gradient, (m/s²)/m.
const GRADIENT: f64 = 3.086e-6;

impl Gravity {
    /// Half of the 95 % interval, m/s².
    pub fn half_interval(&self) -> f64 {
        NORMAL_95 * self.std
    }

    /// Gravity of a configured, measured value.
    pub fn configured(value: f64) -> Self {
        Self { value, std: 0.0, source: Source::Configured, place: None }
    }

    /// Standard gravity, for an unknown place.
    pub fn standard() -> Self {
        Self { value: STANDARD, std: STANDARD_RANGE / NORMAL_95, source: Source::Standard, place: None }
    }

    /// Normal gravity of a place.
    pub fn at(place: &EarthLocation, source: Source) -> Self {
        let height_std = if place.height_m.is_some() { KNOWN_HEIGHT } else { UNKNOWN_HEIGHT };
        let std = libm::hypot(ANOMALY, GRADIENT * height_std);
        Self { value: place.normal_gravity(), std, source, place: Some(*place) }
    }
}

impl EarthLocation {
    /// Whether the place exists, within reach of vehicles.
    pub fn is_valid(&self) -> bool {
        self.latitude_deg.abs() <= 90.0 && self.height_m.is_none_or(|height| (-12_000.0..=100_000.0).contains(&height))
    }

    /// Normal gravity of the ellipsoid of WGS 84 (Somigliana's formula, and its expansion in height: NIMA TR8350.2, 3rd
    /// edition, equations 4-1 and 4-3), m/s².
    fn normal_gravity(&self) -> f64 {
        /// Normal gravity at the equator, m/s².
        const EQUATOR: f64 = 9.780_325_335_9;
        const K: f64 = 0.001_931_852_652_41;
        /// Square of the first eccentricity.
        const E2: f64 = 0.006_694_379_990_13;
        /// Semi-major axis, m.
        const A: f64 = 6_378_137.0;
        const FLATTENING: f64 = 1.0 / 298.257_223_563;
        /// ω² a² b / GM.
        const M: f64 = 0.003_449_786_506_84;
        let sin2 = self.vertical_share().powi(2);
        let height = self.height_m.unwrap_or(0.0) / A;
        let on_ellipsoid = EQUATOR * (1.0 + K * sin2) / (1.0 - E2 * sin2).sqrt();
        on_ellipsoid * (1.0 - 2.0 * (1.0 + FLATTENING + M - 2.0 * FLATTENING * sin2) * height + 3.0 * height * height)
    }

    /// Earth's rotation about the local vertical, rad/s, positive about up.
    pub fn vertical_rate(&self) -> f64 {
        EARTH_RATE * self.vertical_share()
    }

    fn vertical_share(&self) -> f64 {
        libm::sin(self.latitude_deg.to_radians())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(latitude_deg: f64, height: f64) -> f64 {
        Gravity::at(&EarthLocation { latitude_deg, height_m: Some(height) }, Source::Latitude).value
    }

    #[test]
    fn normal_gravity_is_that_of_the_tables() {
        // NIMA TR8350.2, table 3.4: at the equator and at the poles.
        assert!((at(0.0, 0.0) - 9.780_325_335_9).abs() < 1e-10);
        assert!((at(90.0, 0.0) - 9.832_184_937_8).abs() < 1e-9);
        assert_eq!(at(-90.0, 0.0), at(90.0, 0.0));
    }

    #[test]
    fn measured_gravity_lies_within_the_uncertainty() {
        // The absolute stations of the network IGSN 71 at Potsdam and at Sèvres.
        for (latitude_deg, height, measured) in [(52.38, 87.0, 9.812_60), (48.83, 66.0, 9.809_26)] {
            let place = EarthLocation { latitude_deg, height_m: Some(height) };
            let gravity = Gravity::at(&place, Source::Latitude);
            assert!((gravity.value - measured).abs() < 2.5 * gravity.std, "{gravity:?} {measured}");
        }
    }

    #[test]
    fn gravity_of_nowhere_in_particular_is_that_of_every_inhabited_place() {
        let standard = Gravity::standard();
        for (latitude_deg, height) in [(-14.63, 5100.0), (-16.5, 3640.0), (1.35, 15.0), (27.99, 4900.0), (82.5, 30.0)] {
            let off = (at(latitude_deg, height) - standard.value).abs();
            assert!(off < standard.half_interval(), "{latitude_deg}: {off}");
        }
    }

    #[test]
    fn the_earth_turns_about_the_pole() {
        let north = EarthLocation { latitude_deg: 90.0, height_m: None };
        assert_eq!(north.vertical_rate(), EARTH_RATE);
        let south = EarthLocation { latitude_deg: -30.0, height_m: None };
        assert!((south.vertical_rate() + EARTH_RATE / 2.0).abs() < 1e-15);
    }
}
