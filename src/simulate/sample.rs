//! Readings of a session in the order of their stamps.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::sensor::Sensor;
use super::trajectory::Trajectory;
use super::validate::validate;
use super::{Error, Reference, Scenario};
use crate::imu::Quantity;
use crate::{Stamp, imu};

/// One reading of one sensor, with the true values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Sensor; secondary ones count in the order of their names.
    pub sensor: imu::Sensor,
    /// Time of measurement.
    pub stamp: Stamp,
    /// Measured value, in m/s² or rad/s.
    pub measured: Vector3<f64>,
    /// True specific force in the sensor's frame, in m/s².
    pub force: Vector3<f64>,
    /// True angular rate in the sensor's frame, in rad/s.
    pub rate: Vector3<f64>,
    /// Index of the pose; `None` in motion.
    pub pose: Option<usize>,
}

/// Readings of a session, see [`samples`].
#[derive(Clone, Debug)]
pub struct Samples {
    start: Stamp,
    pub(super) trajectory: Trajectory,
    sensors: Vec<Sensor>,
}

/// Readings of a session by stamp; those of one instant in the order accelerometer, gyroscope, reference, secondary.
///
/// # Errors
/// If a value of the scenario cannot be simulated, with its key.
pub fn samples(scenario: &Scenario) -> Result<Samples, Error> {
    validate(scenario)?;
    let gyroscope = scenario.gyroscope.iter().map(|triad| (imu::Sensor::Gyroscope, triad));
    let secondary =
        scenario.secondary.values().enumerate().map(|(index, triad)| (imu::Sensor::Secondary(index), triad));
    let reference = scenario.reference.as_ref().map(Reference::triads);
    let quantities = [Quantity::Force, Quantity::Rate].map(imu::Sensor::Reference);
    let reference = quantities.into_iter().zip(reference.iter().flatten());
    let sensors = [(imu::Sensor::Accelerometer, &scenario.accelerometer)].into_iter().chain(gyroscope);
    let sensors = sensors.chain(reference).chain(secondary);
    let sensors = sensors.map(|(which, triad)| {
        let own = match which {
            imu::Sensor::Accelerometer => 2,
            imu::Sensor::Gyroscope => 3,
            imu::Sensor::Secondary(index) => 4 + index as u64,
            imu::Sensor::Reference(Quantity::Force) => u64::MAX,
            imu::Sensor::Reference(Quantity::Rate) => u64::MAX - 1,
        };
        Sensor::new(which, triad, scenario, stream(scenario, own))
    });
    Ok(Samples {
        start: Stamp::from_nanos(i64::from(scenario.recording.start_s) * 1_000_000_000),
        trajectory: Trajectory::new(scenario, &mut stream(scenario, 0), &mut stream(scenario, 1)),
        sensors: sensors.collect(),
    })
}

/// Source of randomness. Each has a stream of its own, so that one more sensor does not change the noise of the others.
pub(super) fn stream(scenario: &Scenario, stream: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(scenario.recording.seed);
    random.set_stream(stream);
    random
}

impl Iterator for Samples {
    type Item = Reading;

    fn next(&mut self) -> Option<Reading> {
        let sensor = self.sensors.iter_mut().min_by_key(|sensor| sensor.next())?;
        let nanos = sensor.next();
        let state = self.trajectory.at(nanos)?;
        Some(Reading {
            sensor: sensor.which,
            stamp: self.start.plus_nanos(nanos),
            measured: sensor.measure(&state),
            force: state.force,
            rate: state.rate,
            pose: state.holds_pose.then_some(state.poses.0),
        })
    }
}
