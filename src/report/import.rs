//! Import of calibrations of other programs, whatever their direction and units. The inverse of
//! [`export`](super::export()).

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use super::export::autopilot::{ardupilot, px4};
use super::export::thermal;
use super::words::model_named;
use super::{Axes, Findings, Parameters, row_major};
use crate::messages::triad::{Model, Status};
use crate::messages::{self, AxisNoise, Calibration, TemperatureModel, Triad};

/// Reason why a text is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// It has none of the formats.
    #[error(
        "is no calibration that Stillpoint knows: JSON or YAML of stillpoint export, Kalibr, imu_calib, PX4 or ArduPilot"
    )]
    Unknown,
    /// It has one of the formats, but is invalid.
    #[error("{format}: {what}")]
    Wrong {
        /// The format.
        format: &'static str,
        /// The fault.
        what: String,
    },
    /// The axes of the recording are unspecified.
    #[error(
        "{0} counts along forward, right, down: say which way the axes of the recording point, --axes frd or flu (ROS)"
    )]
    Axes(&'static str),
}

/// Parses the IMUs of a calibration file. A name that the file lacks is empty.
///
/// # Errors
///
/// If it is in none of the formats, or violates its own.
pub fn import(text: &str, axes: Option<Axes>) -> Result<Vec<Findings>, ImportError> {
    let imus = read(text, axes)?;
    for triad in imus.iter().flat_map(Findings::triads) {
        let bias = triad.bias.iter().flat_map(|bias| [bias.x, bias.y, bias.z]);
        let numbers = bias.chain(triad.sensitivity.iter().chain(&triad.g_sensitivity).copied());
        if !numbers.into_iter().all(f64::is_finite) {
            return Err(wrong(
                "calibration",
                format!("the numbers of its {} are too large to compute with", triad.sensor),
            ));
        }
    }
    Ok(imus)
}

fn read(text: &str, axes: Option<Axes>) -> Result<Vec<Findings>, ImportError> {
    if let Some(parameters) = Parameters::parse(text) {
        return autopilot(&parameters, axes);
    }
    // JSON is YAML, but only its own parser reads its numbers back exactly.
    let document: Value =
        serde_json::from_str(text).or_else(|_| serde_saphyr::from_str(text)).map_err(|_| ImportError::Unknown)?;
    if let Some(imus) = document.get("imus").and_then(Value::as_array) {
        return imus.iter().map(own).collect();
    }
    if document.get("SM").is_some() {
        return imu_calib(&document).map(|imu| vec![imu]);
    }
    let is_kalibr = |block: &Value| block.get("accelerometers").is_some() || block.get("gyroscopes").is_some();
    let blocks: Vec<_> = match &document {
        single if is_kalibr(single) => vec![single],
        Value::Object(blocks) => blocks.values().filter(|block| is_kalibr(block)).collect(),
        _ => Vec::new(),
    };
    if blocks.is_empty() {
        return Err(ImportError::Unknown);
    }
    blocks.into_iter().map(kalibr).collect()
}

const OWN: &str = "stillpoint export";

fn own(imu: &Value) -> Result<Findings, ImportError> {
    let topic = imu.get("topic").and_then(Value::as_str).unwrap_or_default();
    let name = imu.get("name").and_then(Value::as_str).unwrap_or(topic);
    let part = |key: &str| imu.get(key).map(|value| own_triad(value, key)).transpose();
    let secondary = imu.get("secondary").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let secondary = secondary.iter().map(|value| own_triad(value, "secondary")).collect::<Result<_, _>>()?;
    let calibration = Calibration {
        accelerometer: part("accelerometer")?,
        gyroscope: part("gyroscope")?,
        secondary,
        gravity: imu.get("gravity").and_then(Value::as_f64).unwrap_or_default(),
        gravity_source: imu.get("gravity_source").and_then(Value::as_str).unwrap_or_default().to_owned(),
        revision: imu.get("revision").and_then(Value::as_u64).unwrap_or_default() as u32,
        segments: imu.get("segments").and_then(Value::as_u64).unwrap_or_default() as u32,
        placements: imu.get("placements").and_then(Value::as_u64).unwrap_or_default() as u32,
        ..Calibration::default()
    };
    Ok(Findings { calibration: Some(calibration), ..Findings::new(name, topic) })
}

fn own_triad(value: &Value, sensor: &str) -> Result<Triad, ImportError> {
    let text = |key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default();
    let list = |key: &str, n: usize| match value.get(key) {
        None | Some(Value::Null) => Ok(Vec::new()),
        Some(list) => numbers(list, n).ok_or_else(|| wrong(OWN, format!("{sensor}.{key} is not {n} numbers"))),
    };
    let xyz = |key: &str| Ok(list(key, 3)?.try_into().ok().map(|[x, y, z]: [f64; 3]| messages::Vector3 { x, y, z }));
    let sensitivity = list("sensitivity", 9)?;
    let sensitivity_std = list("sensitivity_std", 9)?;
    Ok(Triad {
        sensor: value.get("sensor").map_or(sensor, |name| name.as_str().unwrap_or_default()).to_owned(),
        topic: text("topic").to_owned(),
        model: model_named(text("model")).unwrap_or(Model::None).into(),
        status: Status::from_str_name(text("status")).unwrap_or(Status::Undetermined).into(),
        bias: xyz("bias")?,
        bias_std: xyz("bias_std")?,
        scale: diagonal(&sensitivity),
        scale_std: diagonal(&sensitivity_std),
        sensitivity,
        sensitivity_std,
        g_sensitivity: list("g_sensitivity", 9)?,
        g2_sensitivity: list("g2_sensitivity", 3)?,
        rate_sensitivity: list("rate_sensitivity", 9)?,
        row_norms: xyz("row_norms")?,
        row_norms_std: xyz("row_norms_std")?,
        misalignment: list("misalignment", 6)?,
        misalignment_std: list("misalignment_std", 6)?,
        turns: value.get("turns").and_then(Value::as_u64).unwrap_or_default() as u32,
        noise: value.get("noise").map(own_noise).unwrap_or_default(),
        temperature: value.get("temperature").and_then(own_temperature),
        covariance: own_square(value.get("covariance")),
        placement_std: value
            .get("placement_std")
            .and_then(|list| numbers(list, 1).or_else(|| numbers(list, 3)))
            .unwrap_or_default(),
        ..Triad::default()
    })
}

/// A square matrix, row by row; empty if it is none.
fn own_square(value: Option<&Value>) -> Vec<f64> {
    let size = value.and_then(Value::as_array).map_or(0, Vec::len);
    value.filter(|_| size.isqrt().pow(2) == size).and_then(|list| numbers(list, size)).unwrap_or_default()
}

fn own_noise(value: &Value) -> Vec<AxisNoise> {
    let number = |key: &str, axis: usize| value.get(key)?.get(axis)?.as_f64();
    let end = |axis: usize, end: usize| value.get("density_interval")?.get(axis)?.get(end)?.as_f64();
    let axis = |axis: usize| {
        Some(AxisNoise {
            density: number("density", axis)?,
            density_low: end(axis, 0)?,
            density_high: end(axis, 1)?,
            random_walk: number("random_walk", axis),
            random_walk_low: number("random_walk_low", axis),
            random_walk_high: number("random_walk_high", axis),
        })
    };
    (0..3).map(axis).collect::<Option<_>>().unwrap_or_default()
}

fn own_temperature(value: &Value) -> Option<TemperatureModel> {
    let number = |key: &str| value.get(key)?.as_f64();
    let order = value.get("order")?.as_u64().filter(|order| (1..=3).contains(order))?;
    Some(TemperatureModel {
        order: order as u32,
        reference: number("reference")?,
        minimum: number("minimum")?,
        maximum: number("maximum")?,
        coefficients: numbers(value.get("coefficients")?, 3 * order as usize)?,
        coefficients_std: numbers(value.get("coefficients_std")?, 3 * order as usize)?,
    })
}

/// `corrected = SM · raw − bias`.
fn imu_calib(document: &Value) -> Result<Findings, ImportError> {
    const FORMAT: &str = "imu_calib";
    let list = |key: &str, n| {
        let list = document.get(key).and_then(|list| numbers(list, n));
        list.ok_or_else(|| wrong(FORMAT, format!("{key} is not {n} numbers")))
    };
    let inverse = Matrix3::from_row_slice(&list("SM", 9)?);
    let sensitivity = inverse.try_inverse().ok_or_else(|| wrong(FORMAT, "SM has no inverse"))?;
    let bias = sensitivity * Vector3::from_column_slice(&list("bias", 3)?);
    Ok(one("", Some(triad("accelerometer", Some(bias), sensitivity)), None))
}

/// `measured = M · true + b`; `b` is an addition to Kalibr's own file.
fn kalibr(block: &Value) -> Result<Findings, ImportError> {
    const FORMAT: &str = "Kalibr";
    let get = |part: &str, key: &str, n: usize| match block.get(part).and_then(|part| part.get(key)) {
        None => Ok(None),
        Some(list) => {
            let list = numbers(list, n).ok_or_else(|| wrong(FORMAT, format!("{part}.{key} is not {n} numbers")))?;
            Ok(Some(list))
        }
    };
    let matrix = |part: &str, key: &str| Ok(get(part, key, 9)?.map(|list| Matrix3::from_row_slice(&list)));
    let bias = |part: &str| Ok(get(part, "b", 3)?.map(|list| Vector3::from_column_slice(&list)));
    let accel = matrix("accelerometers", "M")?;
    let accel = accel.map(|m| Ok(triad("accelerometer", bias("accelerometers")?, m))).transpose()?;
    let gyro = match matrix("gyroscopes", "M")? {
        None => None,
        Some(m) => {
            let c = matrix("gyroscopes", "C_gyro_i")?.unwrap_or_else(Matrix3::identity);
            let a = matrix("gyroscopes", "A")?.unwrap_or_else(Matrix3::zeros) * c;
            let g_sensitivity = if a == Matrix3::zeros() { Vec::new() } else { row_major(&a) };
            Some(Triad { g_sensitivity, ..triad("gyroscope", bias("gyroscopes")?, m * c) })
        }
    };
    let topic = block.get("rostopic").and_then(Value::as_str).unwrap_or_default();
    Ok(one(topic, accel, gyro))
}

/// `corrected = (raw − offset) · scale`, forward, right, down.
fn autopilot(parameters: &Parameters, axes: Option<Axes>) -> Result<Vec<Findings>, ImportError> {
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

fn one(topic: &str, accelerometer: Option<Triad>, gyroscope: Option<Triad>) -> Findings {
    let calibration = Calibration { accelerometer, gyroscope, ..Calibration::default() };
    Findings { calibration: Some(calibration), ..Findings::new(topic, topic) }
}

fn triad(sensor: &str, bias: Option<Vector3<f64>>, sensitivity: Matrix3<f64>) -> Triad {
    let is_diagonal = sensitivity == Matrix3::from_diagonal(&sensitivity.diagonal());
    let is_triangular = sensitivity == sensitivity.lower_triangle();
    let mut notes = vec!["imported: its uncertainty is not known".to_owned()];
    if bias.is_none() {
        notes.push("its bias is not known: Kalibr writes none".to_owned());
    }
    let values = row_major(&sensitivity);
    let model = match (sensitivity == Matrix3::identity(), is_diagonal, is_triangular) {
        (true, ..) if sensor == "gyroscope" => Model::Bias,
        (_, true, _) => Model::BiasScale,
        (_, _, true) => Model::Triangular,
        _ => Model::CrossAxis,
    };
    Triad {
        sensor: sensor.to_owned(),
        model: model.into(),
        status: Status::Provisional.into(),
        bias: bias.map(|b| messages::Vector3 { x: b.x, y: b.y, z: b.z }),
        scale: diagonal(&values).filter(|_| model != Model::Bias),
        sensitivity: if model == Model::Bias { Vec::new() } else { values },
        notes,
        ..Triad::default()
    }
}

fn diagonal(row_major: &[f64]) -> Option<messages::Vector3> {
    match row_major {
        [x, _, _, _, y, _, _, _, z] => Some(messages::Vector3 { x: *x, y: *y, z: *z }),
        _ => None,
    }
}

/// Parses n finite numbers, in one list or in rows; `null` is 0, like a standard deviation that was not estimated.
fn numbers(value: &Value, n: usize) -> Option<Vec<f64>> {
    let mut found = Vec::new();
    for item in value.as_array()? {
        match item {
            Value::Array(row) => {
                for item in row {
                    found.push(number(item)?);
                }
            }
            item => found.push(number(item)?),
        }
    }
    (found.len() == n).then_some(found)
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Null => Some(0.0),
        value => value.as_f64().filter(|value| value.is_finite()),
    }
}

fn wrong(format: &'static str, what: impl Into<String>) -> ImportError {
    ImportError::Wrong { format, what: what.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_calibration_is_refused_and_never_guessed() {
        for text in ["", "hello", "{}", "a: 1", "[1, 2]", "imus: 3", "\u{0}\u{1}", "INS_ACCEL_FILTER,20\n"] {
            assert!(matches!(import(text, Some(Axes::Frd)), Err(ImportError::Unknown)), "{text:?}");
        }
        for (text, expected) in [
            ("SM: [1, 0, 0, 0, 1, 0, 0, 0]\nbias: [0, 0, 0]", "imu_calib: SM is not 9 numbers"),
            ("SM: [1, 0, 0, 0, 1, 0, 0, 0, 0]\nbias: [0, 0, 0]", "imu_calib: SM has no inverse"),
            ("SM: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nbias: [0, .nan, 0]", "is no calibration"),
            ("imu0:\n  accelerometers:\n    M: [[1, 0], [0, 1]]\n", "Kalibr: accelerometers.M is not 9 numbers"),
            (
                r#"{"imus": [{"accelerometer": {"bias": [1, 2]}}]}"#,
                "stillpoint export: accelerometer.bias is not 3 numbers",
            ),
            ("CAL_ACC0_XOFF,1\nCAL_ACC0_YOFF,1\nCAL_ACC0_ZOFF,1\n", "PX4: an accelerometer without positive scales"),
        ] {
            let error = import(text, Some(Axes::Frd)).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn the_axes_of_an_autopilot_are_asked_for() {
        let text = "INS_GYROFFS_X,0.1\nINS_GYROFFS_Y,0.2\nINS_GYROFFS_Z,0.3\n";
        assert!(matches!(import(text, None), Err(ImportError::Axes("ArduPilot"))));
        let bias = |axes| {
            let imus = import(text, Some(axes)).unwrap();
            let gyro = imus[0].calibration.as_ref().unwrap().gyroscope.clone().unwrap();
            gyro.bias.map(|b| [b.x, b.y, b.z]).unwrap()
        };
        assert_eq!(bias(Axes::Frd), [0.1, 0.2, 0.3]);
        assert_eq!(bias(Axes::Flu), [0.1, -0.2, -0.3]);
    }
}
