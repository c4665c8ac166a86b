//! Correction of readings by a published calibration: `true = S⁻¹ (measured − bias)`, or for a gyroscope with
//! g-sensitivity `S⁻¹ (measured − bias − G · true acceleration)`. The bias is that of the temperature, if it is
//! known. [`Intake::rewrite`](crate::imu::Intake::rewrite) writes corrected readings into messages.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::fit;
use crate::fit::temperature::BiasCourse;
use crate::imu::Sensor;
use crate::messages::triad::Status;
use crate::messages::{Calibration, Triad};

/// Whether a calibration knows accelerometers in part and determines no triad: there is nothing to correct by.
pub fn is_only_partial(calibration: &Calibration) -> bool {
    let Calibration { accelerometer, gyroscope, secondary, .. } = calibration;
    let triads = || accelerometer.iter().chain(gyroscope).chain(secondary);
    let is_partial = triads().any(|triad| !triad.combinations.is_empty());
    is_partial && triads().all(|triad| triad.status() == Status::Undetermined)
}

/// Corrections by a calibration, for each triad that it determines.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Corrections {
    /// Corrections of the accelerometer, of the gyroscope, of each secondary.
    triads: Vec<Option<Correction>>,
    undetermined: Vec<String>,
}

/// Correction of one triad: the map from a reading to the true value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Correction {
    bias: Vector3<f64>,
    /// S⁻¹.
    inverse: Matrix3<f64>,
    /// g-sensitivity G of a gyroscope, rad/s per m/s².
    g_sensitivity: Option<Matrix3<f64>>,
    /// Dependence of the bias on the temperature.
    course: Option<BiasCourse>,
}

impl Corrections {
    /// Corrections by a calibration.
    pub fn of(calibration: &Calibration) -> Self {
        let Calibration { accelerometer, gyroscope, secondary, .. } = calibration;
        let triads = || [accelerometer.as_ref(), gyroscope.as_ref()].into_iter().chain(secondary.iter().map(Some));
        let undetermined = triads().flatten().filter(|triad| correction(triad).is_none());
        Self {
            undetermined: undetermined.map(|triad| triad.sensor.clone()).collect(),
            triads: triads().map(|triad| correction(triad?)).collect(),
        }
    }

    /// Whether correcting a gyroscope needs the acceleration of the same instant.
    pub fn need_acceleration(&self) -> bool {
        self.triads.iter().flatten().any(|correction| correction.g_sensitivity.is_some())
    }

    /// True value of a measured one, in m/s² or rad/s, if the triad is determined, with the bias at the temperature of
    /// reference. `acceleration` is the true one of the same instant, in m/s²; without it, a gyroscope with g-sensitivity
    /// is not corrected.
    pub fn correct(
        &self,
        sensor: Sensor,
        measured: Vector3<f64>,
        acceleration: Option<Vector3<f64>>,
    ) -> Option<Vector3<f64>> {
        self.correct_at(None, sensor, measured, acceleration)
    }

    /// The same with the bias at a temperature, °C, if that is known.
    pub fn correct_at(
        &self,
        celsius: Option<f64>,
        sensor: Sensor,
        measured: Vector3<f64>,
        acceleration: Option<Vector3<f64>>,
    ) -> Option<Vector3<f64>> {
        let place = match sensor {
            Sensor::Accelerometer => 0,
            Sensor::Gyroscope => 1,
            Sensor::Secondary(i) => 2 + i,
            _ => return None,
        };
        let Correction { bias, inverse, g_sensitivity, course } = self.triads.get(place)?.as_ref()?;
        let felt = match g_sensitivity {
            Some(g) => g * acceleration?,
            None => Vector3::zeros(),
        };
        let bias = match course.as_ref().zip(celsius) {
            Some((course, celsius)) => bias + course.change(celsius),
            None => *bias,
        };
        Some(inverse * (measured - bias - felt))
    }

    /// Names of the triads whose readings are not corrected.
    pub fn undetermined(&self) -> &[String] {
        &self.undetermined
    }
}

/// Correction of a triad. S is the identity if it is not estimated. `None` if the triad is undetermined, or if a
/// reading depends on rotation or on the square of an acceleration: each of the two would have to be known before the
/// other.
fn correction(triad: &Triad) -> Option<Correction> {
    let linear = triad.g2_sensitivity.is_empty() && triad.rate_sensitivity.is_empty();
    let bias = triad.bias.as_ref().filter(|_| triad.status() != Status::Undetermined && linear)?;
    let g_sensitivity = match triad.g_sensitivity.as_slice() {
        [] => None,
        entries if entries.len() == 9 => Some(Matrix3::from_row_slice(entries)),
        _ => return None,
    };
    let sensitivity = match triad.sensitivity.as_slice() {
        [] => Matrix3::identity(),
        entries if entries.len() == 9 => Matrix3::from_row_slice(entries),
        _ => return None,
    };
    let calibration = fit::Calibration { bias: Vector3::new(bias.x, bias.y, bias.z), sensitivity };
    let inverse = calibration.inverse();
    let felt = g_sensitivity.iter().flat_map(|matrix| matrix.iter());
    let usable = inverse.iter().chain(calibration.bias.iter()).chain(felt).all(|entry| entry.is_finite());
    let course = triad.temperature.as_ref().and_then(BiasCourse::of);
    usable.then_some(Correction { bias: calibration.bias, inverse, g_sensitivity, course })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{self, TemperatureModel, triad::Model};

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
        let truth = corrections.correct(Sensor::Accelerometer, measured, None).unwrap();
        assert!((truth - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-14, "{truth}");
        let rate = corrections.correct(Sensor::Gyroscope, Vector3::new(0.1, -0.2, 1.3), None).unwrap();
        assert!((rate - Vector3::new(0.0, 0.0, 1.0)).norm() < 1e-14, "{rate}");
        assert_eq!(corrections.correct(Sensor::Secondary(0), measured, None), None);
        assert_eq!(corrections.correct(Sensor::Secondary(1), measured, None), None);
        assert_eq!(corrections.undetermined(), ["highg"]);
    }

    #[test]
    fn a_gyroscope_that_feels_acceleration_is_corrected_beside_it_alone() {
        let matrix = vec![1.1, 0.1, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0];
        let g_sensitivity = vec![0.01, 0.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0];
        let gyroscope = Triad { g_sensitivity, ..triad("gyroscope", Status::Confirmed, matrix) };
        let corrections = Corrections::of(&Calibration { gyroscope: Some(gyroscope), ..Calibration::default() });
        assert!(corrections.need_acceleration() && corrections.undetermined().is_empty());
        // measured = bias + S · true + G · acceleration, by hand, for true = (1, 2, 3) and acceleration = (5, 0, 10).
        let measured = Vector3::new(0.1 + 1.1 + 0.2 + 0.05, -0.2 + 1.8 + 0.2, 0.3 + 3.0);
        let truth = corrections.correct(Sensor::Gyroscope, measured, Some(Vector3::new(5.0, 0.0, 10.0))).unwrap();
        assert!((truth - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-14, "{truth}");
        assert_eq!(corrections.correct(Sensor::Gyroscope, measured, None), None);
    }

    #[test]
    fn the_bias_is_that_of_the_temperature_as_far_as_it_was_seen() {
        let coefficients = vec![0.01, 0.0, -0.02, 0.001, 0.0, 0.0];
        let (reference, minimum, maximum) = (30.0, 20.0, 50.0);
        let coefficients_std = vec![1e-3; 6];
        let model = TemperatureModel { order: 2, reference, minimum, maximum, coefficients, coefficients_std };
        let warm = Triad { temperature: Some(model), ..triad("accelerometer", Status::Confirmed, Vec::new()) };
        let corrections = Corrections::of(&Calibration { accelerometer: Some(warm), ..Calibration::default() });
        let corrected =
            |celsius| corrections.correct_at(celsius, Sensor::Accelerometer, Vector3::zeros(), None).unwrap();
        // −bias − c1 d − c2 d², by hand.
        for (celsius, d) in
            [(None, 0.0), (Some(30.0), 0.0), (Some(40.0), 10.0), (Some(99.0), 20.0), (Some(-9.0), -10.0)]
        {
            let expected = Vector3::new(-0.1 - 0.01 * d - 0.001 * d * d, 0.2, -0.3 + 0.02 * d);
            assert!((corrected(celsius) - expected).amax() < 1e-14, "{celsius:?}");
        }
    }

    #[test]
    fn a_sensitivity_that_cannot_be_inverted_corrects_nothing() {
        let singular = Some(triad("accelerometer", Status::Confirmed, vec![0.0; 9]));
        let corrections = Corrections::of(&Calibration { accelerometer: singular, ..Calibration::default() });
        assert_eq!(corrections.correct(Sensor::Accelerometer, Vector3::zeros(), None), None);
    }
}
