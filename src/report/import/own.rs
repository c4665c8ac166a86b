//! The layout of `export --format json` and `yaml`, which holds everything; the rests and the coverage stay behind.

use serde_json::Value;

use super::error::{ImportError, wrong};
use super::values::{diagonal, numbers};
use crate::messages::triad::{Model, Status};
use crate::messages::{self, AxisNoise, Calibration, Combination, TemperatureModel, Triad};
use crate::report::Findings;
use crate::report::words::model_named;

const OWN: &str = "stillpoint export";

pub(super) fn own(imu: &Value) -> Result<Findings, ImportError> {
    let topic = imu.get("topic").and_then(Value::as_str).unwrap_or_default();
    let name = imu.get("name").and_then(Value::as_str).unwrap_or(topic);
    let part = |key: &str| imu.get(key).map(|value| own_triad(value, key)).transpose();
    let secondary = imu.get("secondary").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let secondary = secondary.iter().map(|value| own_triad(value, "secondary")).collect::<Result<_, _>>()?;
    let range = imu.get("temperature_range").and_then(|range| numbers(range, 2));
    let calibration = Calibration {
        accelerometer: part("accelerometer")?,
        gyroscope: part("gyroscope")?,
        secondary,
        gravity: imu.get("gravity").and_then(Value::as_f64).unwrap_or_default(),
        gravity_source: imu.get("gravity_source").and_then(Value::as_str).unwrap_or_default().to_owned(),
        revision: imu.get("revision").and_then(Value::as_u64).unwrap_or_default() as u32,
        segments: imu.get("segments").and_then(Value::as_u64).unwrap_or_default() as u32,
        placements: imu.get("placements").and_then(Value::as_u64).unwrap_or_default() as u32,
        temperature_min: range.as_ref().map(|range| range[0]),
        temperature_max: range.as_ref().map(|range| range[1]),
        ..Calibration::default()
    };
    let key = imu.get("key").and_then(Value::as_str).map(str::to_owned);
    Ok(Findings { calibration: Some(calibration), key, ..Findings::new(name, topic) })
}

fn own_triad(value: &Value, sensor: &str) -> Result<Triad, ImportError> {
    let text = |key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default();
    let list = |key: &str, n: usize| match value.get(key) {
        None | Some(Value::Null) => Ok(Vec::new()),
        Some(list) => numbers(list, n).ok_or_else(|| wrong(OWN, format!("{sensor}.{key} is not {n} numbers"))),
    };
    let xyz = |key: &str| Ok(list(key, 3)?.try_into().ok().map(|[x, y, z]: [f64; 3]| messages::Vector3 { x, y, z }));
    let measure = |key: &str| value.get(key).and_then(Value::as_f64);
    let items = |key: &str| value.get(key).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
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
        residual_rms: measure("residual_rms"),
        chi2_per_dof: measure("chi2_per_dof"),
        worst_case_error: measure("worst_case_error"),
        condition: measure("condition"),
        combinations: items("combinations").iter().filter_map(own_combination).collect(),
        notes: items("notes").iter().filter_map(Value::as_str).map(str::to_owned).collect(),
    })
}

/// A sum of parameters that is known.
fn own_combination(value: &Value) -> Option<Combination> {
    let number = |key: &str| value.get(key)?.as_f64();
    let coefficients = value.get("coefficients")?;
    Some(Combination {
        coefficients: numbers(coefficients, coefficients.as_array()?.len())?,
        value: number("value")?,
        std: number("std")?,
        explanation: value.get("explanation")?.as_str()?.to_owned(),
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
