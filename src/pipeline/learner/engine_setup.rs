//! Configuration of an engine for its IMU.

use crate::config::Config;
use crate::engine::{self, Secondary};
use crate::imu::{Imu, Sensor};

/// Topic of a sensor; empty if there is none.
pub(super) fn topic_of(imu: &Imu, sensor: Sensor) -> &str {
    imu.triads.iter().find(|triad| triad.sensor == sensor).map_or("", |triad| &triad.topic)
}

/// Whether an IMU's output name is this one, with a leading slash or without.
pub(super) fn is_called(imu: &Imu, name: &str) -> bool {
    imu.name.trim_start_matches('/') == name.trim_start_matches('/')
}

pub(super) fn engine_config(imu: &Imu, config: &Config) -> engine::Config {
    let topic = |sensor| topic_of(imu, sensor).to_owned();
    let mut secondary = Vec::new();
    for triad in &imu.triads {
        if let Sensor::Secondary(i) = triad.sensor {
            secondary.resize_with(secondary.len().max(i + 1), Default::default);
            if let Some(place) = secondary.get_mut(i) {
                *place = Secondary {
                    name: triad.name.clone(),
                    topic: triad.topic.clone(),
                    preset: triad.preset,
                    model: triad.model,
                };
            }
        }
    }
    let mut fit = config.fit.clone();
    fit.rotations.retain(|rotation| rotation.imu.as_ref().is_none_or(|name| is_called(imu, name)));
    let preset = imu.triads.iter().find(|t| t.sensor == Sensor::Accelerometer).and_then(|triad| triad.preset);
    let config = engine::Config {
        name: imu.name.clone(),
        frame_id: imu.frame_id.clone(),
        accelerometer: topic(Sensor::Accelerometer),
        gyroscope: topic(Sensor::Gyroscope),
        secondary,
        preset: None,
        accel_unit: imu.accel_unit,
        gyro_unit: imu.gyro_unit,
        reference: imu.reference,
        still: config.still.clone(),
        fit,
    };
    match preset {
        Some(preset) => config.of(preset),
        None => config,
    }
}
