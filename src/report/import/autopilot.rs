//! Parameters of PX4 and ArduPilot.

use nalgebra::{Matrix3, Vector3};

use super::error::{ImportError, wrong};
use super::values::{one, triad};
use crate::messages::{TemperatureModel, Triad};
use crate::report::export::autopilot::{ardupilot, px4};
use crate::report::export::thermal;
use crate::report::{Axes, Findings, Parameters};

/// `corrected = (raw − offset) · scale`, forward, right, down.
pub(super) fn autopilot(parameters: &Parameters, axes: Option<Axes>) -> Result<Vec<Findings>, ImportError> {
    let (format, names): (_, fn(u8) -> _) =
        match px4(0).is_some_and(|names| parameters.vector(&names.accel_offset).is_some()) {
            true => ("PX4", px4),
            false => ("ArduPilot", ardupilot),
        };
    let mut imus = Vec::new();
    for (slot, names) in (0..5).filter_map(|slot| Some((slot, names(slot)?))) {
        let (offset, scale) = (parameters.vector(&names.accel_offset), parameters.vector(&names.accel_scale));
        let gyro = parameters.vector(&names.gyro_offset);
        let warm = [true, false].map(|is_accelerometer| thermal::read(parameters, slot, is_accelerometer));
        let more = |own: [f64; 3], warm: &Option<([f64; 3], TemperatureModel)>| {
            warm.as_ref().map_or(own, |(offset, _)| [0, 1, 2].map(|axis| own[axis] + offset[axis]))
        };
        let (offset, gyro) = (offset.map(|own| more(own, &warm[0])), gyro.map(|own| more(own, &warm[1])));
        // An uncalibrated slot holds zeros.
        let untouched = |values: Option<[f64; 3]>| values.is_none_or(|values| values == [0.0; 3]);
        if untouched(offset) && untouched(gyro) {
            continue;
        }
        if let Some(rotation) = names.rotations.iter().find(|name| parameters.get(name).is_some_and(|turn| turn > 0.0))
        {
            return Err(wrong(
                format,
                format!(
                    "{rotation} turns the readings after their correction: the numbers are along the sensor's axes, not the \
                     recording's; set it to 0 in a copy if the recording holds the sensor's own"
                ),
            ));
        }
        let signs = Vector3::from(axes.ok_or(ImportError::Axes(format))?.signs_to(Axes::Frd));
        let accel = match (offset, scale) {
            (Some(offset), Some(scale)) if scale.iter().all(|scale| *scale > 0.0) => {
                let bias = Vector3::from(offset).component_mul(&signs);
                let sensitivity = Matrix3::from_diagonal(&Vector3::from(scale).map(|scale| 1.0 / scale));
                Some(Triad { temperature: along(&warm[0], signs), ..triad("accelerometer", Some(bias), sensitivity) })
            }
            (Some(_), _) => return Err(wrong(format, "an accelerometer without positive scales")),
            _ => None,
        };
        let gyro = gyro.map(|gyro| {
            let bias = Vector3::from(gyro).component_mul(&signs);
            Triad { temperature: along(&warm[1], signs), ..triad("gyroscope", Some(bias), Matrix3::identity()) }
        });
        imus.push(one("", accel, gyro));
    }
    match imus.is_empty() {
        true => Err(ImportError::Unknown),
        false => Ok(imus),
    }
}

/// Change of a bias with temperature along the axes of the recording.
fn along(warm: &Option<([f64; 3], TemperatureModel)>, signs: Vector3<f64>) -> Option<TemperatureModel> {
    let mut model = warm.as_ref().map(|(_, model)| model.clone()).filter(|model| model.order > 0)?;
    let signed = model.coefficients.iter().enumerate().map(|(at, value)| value * signs[at % 3]);
    model.coefficients = signed.collect();
    Some(model)
}
