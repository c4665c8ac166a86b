//! Gravity where an earlier calibration is held to account.

use crate::fit::{EarthLocation, Gravity, Source};
use crate::messages;

/// Gravity of this recording, and how much its error has in common with that of the earlier calibration.
pub(super) struct Site {
    /// Value, m/s².
    pub(super) value: f64,
    /// Standard deviation of gravity, m/s².
    pub(super) std: f64,
    /// Whether the earlier calibration took the same value from the same source, and so has the same error.
    pub(super) is_same: bool,
}

impl Site {
    pub(super) fn of(now: Option<&messages::Calibration>, then: &messages::Calibration) -> Self {
        // A recording that publishes nothing does not say what its gravity is.
        let now = now.filter(|now| now.gravity > 0.0).unwrap_or(then);
        let standard = Gravity::standard();
        if now.gravity <= 0.0 {
            return Self { value: standard.value, std: standard.std, is_same: false };
        }
        let of_place = || Gravity::at(&EarthLocation { latitude_deg: 45.0, height_m: None }, Source::Latitude).std;
        let std = match now.gravity_source.as_str() {
            source if source == Source::Configured.name() => 0.0,
            source if source == Source::Latitude.name() || source == Source::FixTopic.name() => of_place(),
            _ => standard.std,
        };
        let is_same = now.gravity == then.gravity && now.gravity_source == then.gravity_source;
        Self { value: now.gravity, std, is_same }
    }
}
