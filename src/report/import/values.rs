//! Numbers of a calibration file, and triads made of them.

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use crate::messages::triad::{Model, Status};
use crate::messages::{self, Calibration, Triad};
use crate::report::{Findings, row_major};

pub(super) fn one(topic: &str, accelerometer: Option<Triad>, gyroscope: Option<Triad>) -> Findings {
    let calibration = Calibration { accelerometer, gyroscope, ..Calibration::default() };
    Findings { calibration: Some(calibration), ..Findings::new(topic, topic) }
}

pub(super) fn triad(sensor: &str, bias: Option<Vector3<f64>>, sensitivity: Matrix3<f64>) -> Triad {
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

pub(super) fn diagonal(row_major: &[f64]) -> Option<messages::Vector3> {
    match row_major {
        [x, _, _, _, y, _, _, _, z] => Some(messages::Vector3 { x: *x, y: *y, z: *z }),
        _ => None,
    }
}

/// Parses n finite numbers, in one list or in rows; `null` is 0, like a standard deviation that was not estimated.
pub(super) fn numbers(value: &Value, n: usize) -> Option<Vec<f64>> {
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
