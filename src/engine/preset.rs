//! Values of a sensor's datasheet in an engine's configuration: they replace defaults, and nothing that was set
//! otherwise.

use super::config::Config;
use crate::fit::{self, Bound, Bounds};
use crate::imu::{Preset, TriadDatasheet};
use crate::still;

/// Factor from the noise of a datasheet to the ceiling of the floor: a bench is noisier.
const BENCH: f64 = 2.0;

impl Config {
    /// Adapts the configuration to a known type of primary accelerometer and gyroscope.
    pub fn of(mut self, preset: Preset) -> Self {
        let sheet = preset.datasheet();
        let (still, bounds) = (still::Config::default(), Bounds::default());
        let TriadDatasheet { noise, bias, scale, placement, cross_axis, .. } = sheet.accelerometer;
        set(&mut self.still.accel_ceiling, still.accel_ceiling, noise.map(|noise| BENCH * noise));
        set(&mut self.fit.bounds.accel_bias, bounds.accel_bias, bias.map(either_way));
        set(&mut self.fit.bounds.accel_scale, bounds.accel_scale, scale.map(Bound::from));
        let fit = fit::Config::default();
        set(&mut self.fit.placement_std, fit.placement_std, placement);
        set(&mut self.fit.cross_axis_std, fit.cross_axis_std, cross_axis);
        set(&mut self.fit.nonlinearity, fit.nonlinearity, sheet.accelerometer.squared_at_one_g());
        if let Some(TriadDatasheet { noise, bias, scale, .. }) = sheet.gyroscope {
            set(&mut self.still.gyro_ceiling, still.gyro_ceiling, noise.map(|noise| BENCH * noise));
            set(&mut self.fit.bounds.gyro_bias, bounds.gyro_bias, bias.map(either_way));
            set(&mut self.fit.bounds.gyro_scale, bounds.gyro_scale, scale.map(Bound::from));
        }
        self.preset = Some(preset);
        self
    }
}

/// Bounds for a secondary accelerometer of a known type.
pub(super) fn secondary_bounds(mut bounds: Bounds, preset: Preset) -> Bounds {
    let TriadDatasheet { bias, scale, .. } = preset.datasheet().accelerometer;
    let default = Bounds::default();
    set(&mut bounds.secondary_bias, default.secondary_bias, bias.map(either_way));
    set(&mut bounds.secondary_scale, default.secondary_scale, scale.map(Bound::from));
    bounds
}

fn either_way(limit: f64) -> Bound {
    [-limit, limit].into()
}

/// Replaces a default by a promised value.
fn set<T: PartialEq>(value: &mut T, default: T, promised: Option<T>) {
    if let Some(promised) = promised.filter(|_| *value == default) {
        *value = promised;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_set_wins_over_a_preset_and_a_preset_over_the_default() {
        let mut config = Config::default();
        config.fit.bounds.accel_scale = [0.9, 1.1].into();
        let config = config.of(Preset::named("mpu9250").unwrap());
        assert_eq!(config.fit.bounds.accel_scale, [0.9, 1.1].into());
        let most = config.fit.bounds.accel_bias.of(0)[1];
        assert!((most - 1.74).abs() < 0.01, "{most}");
        assert!(config.still.gyro_ceiling < still::Config::default().gyro_ceiling);
        // Datasheet value of 1.5 mg per kelvin.
        assert_eq!(config.fit.cross_axis_std, 0.02);
        assert!((config.fit.nonlinearity - 0.0087).abs() < 1e-4, "{}", config.fit.nonlinearity);
        assert!((config.fit.placement_std - 0.0147).abs() < 1e-4, "{}", config.fit.placement_std);
    }
}
