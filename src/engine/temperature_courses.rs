//! Dependence of an IMU's biases on the temperature, as far as that is told.

use nalgebra::Vector3;

use crate::fit::temperature::{BiasCourse, Unclear};

/// Dependence of the biases on the temperature, or the reason why that is not told.
#[derive(Clone, Debug)]
pub(super) struct TemperatureCourses {
    pub(super) accelerometer: Result<BiasCourse, Unclear>,
    pub(super) gyroscope: Result<BiasCourse, Unclear>,
}

impl TemperatureCourses {
    /// Excess of an accelerometer's reading at a temperature, °C, over that at the temperature of reference, m/s².
    pub(super) fn force(&self, celsius: Option<f64>) -> Vector3<f64> {
        change(&self.accelerometer, celsius)
    }

    /// The same of a gyroscope, rad/s.
    pub(super) fn rate(&self, celsius: Option<f64>) -> Vector3<f64> {
        change(&self.gyroscope, celsius)
    }

    /// Gives up the courses of triads whose biases move with time, as that of each says.
    pub(super) fn give_up(&mut self, moved: [bool; 2]) {
        for (moved, course) in moved.into_iter().zip([&mut self.accelerometer, &mut self.gyroscope]) {
            if let (true, Ok(BiasCourse { range, .. })) = (moved, &*course) {
                *course = Err(Unclear::Time { range: *range });
            }
        }
    }
}

fn change(course: &Result<BiasCourse, Unclear>, celsius: Option<f64>) -> Vector3<f64> {
    course.as_ref().ok().zip(celsius).map_or(Vector3::zeros(), |(course, celsius)| course.change(celsius))
}
