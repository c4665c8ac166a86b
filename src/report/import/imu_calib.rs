//! The file of `imu_calib`.

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use super::error::{ImportError, wrong};
use super::values::{numbers, one, triad};
use crate::report::Findings;

/// `corrected = SM · raw − bias`.
pub(super) fn imu_calib(document: &Value) -> Result<Findings, ImportError> {
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
