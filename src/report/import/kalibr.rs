//! The blocks of Kalibr's file of IMUs.

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use super::error::{ImportError, wrong};
use super::values::{numbers, one, triad};
use crate::messages::Triad;
use crate::report::{Findings, row_major};

/// `measured = M · true + b`; `b` is an addition to Kalibr's own file.
pub(super) fn kalibr(block: &Value) -> Result<Findings, ImportError> {
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
