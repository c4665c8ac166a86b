//! Import of calibrations of other programs, whatever their direction and units. The inverse of
//! [`export`](super::export()).

mod autopilot;
mod error;
mod imu_calib;
mod kalibr;
mod own;
mod values;

use serde_json::Value;

use self::autopilot::autopilot;
pub use self::error::ImportError;
use self::error::wrong;
use self::imu_calib::imu_calib;
use self::kalibr::kalibr;
use self::own::own;
use super::{Axes, Findings, Parameters};

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
