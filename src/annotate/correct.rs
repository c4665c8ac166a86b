//! Readings corrected by a published calibration: `true = S⁻¹ (measured − bias)`. Putting them into messages is left to
//! [`Intake::rewrite`](crate::imu::Intake::rewrite).

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::fit;
use crate::imu::Sensor;
use crate::messages::triad::Status;
use crate::messages::{Calibration, Triad};

/// What a calibration says of each triad that it determines.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Corrections {
    /// Bias and S⁻¹ of the accelerometer, of the gyroscope, of each secondary.
    triads: Vec<Option<(Vector3<f64>, Matrix3<f64>)>>,
    undetermined: Vec<String>,
}

impl Corrections {
    /// Those of a calibration.
    pub fn of(calibration: &Calibration) -> Self {
        let Calibration { accelerometer, gyroscope, secondary, .. } = calibration;
        let triads = || [accelerometer.as_ref(), gyroscope.as_ref()].into_iter().chain(secondary.iter().map(Some));
        let undetermined = triads().flatten().filter(|triad| correction(triad).is_none());
        Self {
            undetermined: undetermined.map(|triad| triad.sensor.clone()).collect(),
            triads: triads().map(|triad| correction(triad?)).collect(),
        }
    }

    /// The true value behind a measured one, if the triad is determined. In m/s² or rad/s.
    pub fn correct(&self, sensor: Sensor, measured: Vector3<f64>) -> Option<Vector3<f64>> {
        let place = match sensor {
            Sensor::Accelerometer => 0,
            Sensor::Gyroscope => 1,
            Sensor::Secondary(i) => 2 + i,
            _ => return None,
        };
        let (bias, inverse) = self.triads.get(place)?.as_ref()?;
        Some(inverse * (measured - bias))
    }

    /// Names of the triads whose readings stay as they are.
    pub fn undetermined(&self) -> &[String] {
        &self.undetermined
    }
}

/// Bias and S⁻¹; S is the identity where it is not estimated. Nothing where a reading depends on the other triad, too,
/// whose value at that moment its message need not have.
fn correction(triad: &Triad) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let alone =
        [&triad.g_sensitivity, &triad.g2_sensitivity, &triad.rate_sensitivity].iter().all(|more| more.is_empty());
    let bias = triad.bias.as_ref().filter(|_| triad.status() != Status::Undetermined && alone)?;
    let sensitivity = match triad.sensitivity.as_slice() {
        [] => Matrix3::identity(),
        entries if entries.len() == 9 => Matrix3::from_row_slice(entries),
        _ => return None,
    };
    let calibration = fit::Calibration { bias: Vector3::new(bias.x, bias.y, bias.z), sensitivity };
    let inverse = calibration.inverse();
    let usable = inverse.iter().chain(calibration.bias.iter()).all(|entry| entry.is_finite());
    usable.then_some((calibration.bias, inverse))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{self, triad::Model};

    fn triad(sensor: &str, status: Status, sensitivity: Vec<f64>) -> Triad {
        Triad {
            sensor: sensor.to_owned(),
            model: Model::BiasScale.into(),
            status: status.into(),
            bias: Some(messages::Vector3 { x: 0.1, y: -0.2, z: 0.3 }),
            sensitivity,
            ..Triad::default()
        }
    }

    #[test]
    fn a_reading_is_taken_back_to_the_truth_it_was_measured_from() {
        let lower = vec![1.1, 0.0, 0.0, 0.2, 0.9, 0.0, -0.1, 0.3, 1.2];
        let corrections = Corrections::of(&Calibration {
            accelerometer: Some(triad("accelerometer", Status::Confirmed, lower)),
            gyroscope: Some(triad("gyroscope", Status::Provisional, Vec::new())),
            secondary: vec![triad("highg", Status::Undetermined, Vec::new())],
            ..Calibration::default()
        });
        // measured = bias + S · true, by hand, for true = (1, 2, 3).
        let measured = Vector3::new(0.1 + 1.1, -0.2 + 0.2 + 1.8, 0.3 - 0.1 + 0.6 + 3.6);
        let truth = corrections.correct(Sensor::Accelerometer, measured).unwrap();
        assert!((truth - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-14, "{truth}");
        let rate = corrections.correct(Sensor::Gyroscope, Vector3::new(0.1, -0.2, 1.3)).unwrap();
        assert!((rate - Vector3::new(0.0, 0.0, 1.0)).norm() < 1e-14, "{rate}");
        assert_eq!(corrections.correct(Sensor::Secondary(0), measured), None);
        assert_eq!(corrections.correct(Sensor::Secondary(1), measured), None);
        assert_eq!(corrections.undetermined(), ["highg"]);
    }

    #[test]
    fn a_sensitivity_that_cannot_be_inverted_corrects_nothing() {
        let singular = Some(triad("accelerometer", Status::Confirmed, vec![0.0; 9]));
        let corrections = Corrections::of(&Calibration { accelerometer: singular, ..Calibration::default() });
        assert_eq!(corrections.correct(Sensor::Accelerometer, Vector3::zeros()), None);
    }
}
