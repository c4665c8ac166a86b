//! Merged sensors for machines: the fields of `export --format json` for each IMU, with its history.

use serde_json::{Value, json};

use super::history::{Change, Epoch, History, Point};
use super::outcome::Merged;
use crate::report::{coverage, imus, triad};

/// `{"imus": [{…, "key": …, "history": {…}}]}`.
pub fn document(merged: &[Merged]) -> Value {
    let imu = |merged: &Merged| {
        let mut imu = imus([&merged.findings]).get_mut(0).map(Value::take).unwrap_or_default();
        if let Some(imu) = imu.as_object_mut() {
            imu.insert("key".to_owned(), json!(merged.key));
            imu.insert("history".to_owned(), history(&merged.history));
        }
        imu
    };
    json!({"imus": merged.iter().map(imu).collect::<Value>()})
}

fn history(history: &History) -> Value {
    json!({
        "recordings": history.recordings,
        "rests": history.rests,
        "overlapping": history.overlapping,
        "strays": history.strays.iter().map(|wrong| wrong.iter().map(|start| start.nanos()).collect::<Value>()).collect::<Value>(),
        "turns": history.turns,
        "thinned": history.is_thinned,
        "drifts": {"accelerometer": history.drifts[0], "gyroscope": history.drifts[1]},
        "epochs": history.epochs.iter().map(epoch).collect::<Value>(),
        "changes": history.changes.iter().map(change).collect::<Value>(),
        "curve": curve(&history.curve),
    })
}

fn epoch(epoch: &Epoch) -> Value {
    let calibration = epoch.calibration.as_ref();
    json!({
        "begin": epoch.begin.nanos(),
        "end": epoch.end.nanos(),
        "recordings": epoch.recordings,
        "accelerometer": triad(calibration.and_then(|calibration| calibration.accelerometer.as_ref())),
        "gyroscope": triad(calibration.and_then(|calibration| calibration.gyroscope.as_ref())),
        "coverage": coverage(&epoch.coverage),
    })
}

fn change(change: &Change) -> Value {
    let by = |[by, std]: &[[f64; 3]; 2]| json!({"by": by, "std": std});
    json!({
        "kind": change.kind.name(),
        "after": change.after.nanos(),
        "before": change.before.nanos(),
        "score": change.score,
        "bias": by(&change.bias),
        "scale": by(&change.scale),
        "gyro_bias": change.gyro_bias.as_ref().map(by),
        "turned": change.turned,
    })
}

/// One list per parameter: a curve is drawn, not looked up.
fn curve(points: &[Point]) -> Value {
    let list = |of: &dyn Fn(&Point) -> Value| points.iter().map(of).collect::<Value>();
    json!({
        "time": list(&|point| json!(point.time.nanos())),
        "bias": list(&|point| json!(point.bias[0])),
        "bias_std": list(&|point| json!(point.bias[1])),
        "scale": list(&|point| json!(point.scale[0])),
        "scale_std": list(&|point| json!(point.scale[1])),
        "gyro_bias": list(&|point| json!(point.gyro_bias.map(|[value, _]| value))),
        "gyro_bias_std": list(&|point| json!(point.gyro_bias.map(|[_, std]| std))),
        "temperature": list(&|point| json!(point.temperature)),
    })
}
