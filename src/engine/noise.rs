//! Noise of an IMU's triads at rest, as messages: Allan sums and the noise densities from them.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::Config;
use crate::fit::noise_densities;
use crate::imu::Sensor;
use crate::messages::{self, AxisNoise};
use crate::still::{AllanSums, Octave, Octaves, Stretch};

/// Allan sums of all triads.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Noise {
    triads: BTreeMap<Sensor, AllanSums>,
}

impl Noise {
    /// Starts from existing sums.
    pub(super) fn of(triads: BTreeMap<Sensor, AllanSums>) -> Self {
        Self { triads }
    }

    pub(super) fn add(&mut self, stretch: &Stretch) {
        for (sensor, sums) in &stretch.noise {
            self.triads.entry(*sensor).or_default().add(sums);
        }
    }

    /// Message of the sums; `None` if there are none.
    pub(super) fn message(&self, header: messages::Header, config: &Config) -> Option<messages::Noise> {
        let name = |sensor: &Sensor| match sensor {
            Sensor::Accelerometer => Some("accelerometer".to_owned()),
            Sensor::Gyroscope => Some("gyroscope".to_owned()),
            Sensor::Secondary(index) => config.secondary.get(*index).map(|secondary| secondary.name.clone()),
            Sensor::Reference(_) => None,
        };
        let triads = self.triads.iter().filter_map(|(sensor, sums)| Some(to_message(name(sensor)?, sums)));
        let triads: Vec<_> = triads.collect();
        (!triads.is_empty()).then_some(messages::Noise { header: Some(header), triads })
    }

    /// Adds the noise densities to the triads of a calibration.
    pub(super) fn describe(&self, calibration: &mut messages::Calibration) {
        let messages::Calibration { accelerometer, gyroscope, secondary, .. } = calibration;
        let primary = [(Sensor::Accelerometer, accelerometer.as_mut()), (Sensor::Gyroscope, gyroscope.as_mut())];
        let secondary = secondary.iter_mut().enumerate().map(|(index, triad)| (Sensor::Secondary(index), Some(triad)));
        for (sensor, triad) in primary.into_iter().chain(secondary) {
            if let (Some(triad), Some(sums)) = (triad, self.triads.get(&sensor)) {
                triad.noise = axis_noise(sums);
            }
        }
    }
}

/// Noise of the axes from their Allan sums; empty if the rests were too short to show any.
pub fn axis_noise(sums: &AllanSums) -> Vec<AxisNoise> {
    let densities = noise_densities(sums);
    let axes = densities.iter().flatten().map(|axis| AxisNoise {
        density: axis.density,
        density_low: axis.interval[0],
        density_high: axis.interval[1],
        random_walk: axis.random_walk.map(|(walk, _)| walk),
        random_walk_low: axis.random_walk.map(|(_, low)| low),
        random_walk_high: axis.random_walk_high,
    });
    axes.collect()
}

fn to_message(sensor: String, sums: &AllanSums) -> messages::AllanSums {
    let octaves = |octaves: &Octaves| messages::Octaves {
        samples: octaves.samples,
        rests: octaves.rests,
        shortest: octaves.shortest,
        squares: octaves.octaves.iter().flat_map(|octave| <[f64; 3]>::from(octave.squares)).collect(),
        counts: octaves.octaves.iter().map(|octave| octave.count).collect(),
        white: octaves.octaves.iter().map(|octave| octave.freedom[0]).collect(),
        wandering: octaves.octaves.iter().map(|octave| octave.freedom[1]).collect(),
    };
    messages::AllanSums {
        sensor,
        period: sums.period().unwrap_or_default(),
        all: Some(octaves(&sums.all)),
        lasting: Some(octaves(&sums.lasting)).filter(|octaves| octaves.rests > 0),
    }
}

/// Allan sums of a message, as far as its lists are consistent.
pub fn allan_sums(message: &messages::AllanSums) -> AllanSums {
    let octaves = |octaves: &messages::Octaves| {
        let lists = octaves.squares.chunks_exact(3).zip(&octaves.counts).zip(&octaves.white).zip(&octaves.wandering);
        Octaves {
            samples: octaves.samples,
            rests: octaves.rests,
            shortest: octaves.shortest,
            octaves: lists
                .map(|(((squares, count), white), wandering)| Octave {
                    squares: Vector3::from_row_slice(squares),
                    count: *count,
                    freedom: [*white, *wandering],
                })
                .collect(),
        }
    };
    let all = message.all.as_ref().map(octaves).unwrap_or_default();
    let intervals = all.samples.saturating_sub(all.rests.into());
    AllanSums {
        seconds: message.period * intervals as f64,
        all,
        lasting: message.lasting.as_ref().map(octaves).unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_read_back_from_a_message_are_what_they_were() {
        let values: Vec<_> =
            (0..500).map(|i| Vector3::new(f64::from(i % 7), f64::from(i % 5), f64::from(i % 3))).collect();
        for lasting in [1.0, 100.0] {
            let sums = AllanSums::of_rest(&values, 0.01, 40, lasting).unwrap();
            let back = allan_sums(&to_message("gyroscope".to_owned(), &sums));
            assert!((back.seconds - sums.seconds).abs() < 1e-12);
            assert_eq!((back.all, back.lasting), (sums.all, sums.lasting));
        }
    }
}
