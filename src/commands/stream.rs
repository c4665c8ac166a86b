//! Notice of a followed recording, for machines: one JSON object per event.

use serde_json::{Value, json};
use stillpoint::engine::Message;
use stillpoint::messages::{AllanSums, Calibration, Noise, Octaves, Segment, Stillness, Turn, foxglove::Log};
use stillpoint::report::{coverage, direction, triad};
use stillpoint::run::Notice;

/// The JSON of an event; `None` for news that is no event. Times are in nanoseconds.
pub fn event(notice: &Notice<'_>) -> Option<Value> {
    Some(match notice {
        Notice::Awaited => json!({"event": "awaited"}),
        Notice::Opened(offset) => json!({"event": "opened", "offset": offset}),
        Notice::Split(file) => json!({"event": "split", "file": file}),
        Notice::Annotation { imu, event, .. } => {
            let (kind, said) = message(&event.message);
            json!({"event": kind, "imu": Some(imu).filter(|imu| !imu.is_empty()), "log_time": event.log_time, kind: said})
        }
        Notice::Trouble(what) => json!({"event": "trouble", "what": what}),
        Notice::Damage(damage) => {
            json!({"event": "damage", "offset": damage.offset, "bytes": damage.length, "what": damage.what})
        }
        Notice::Ended(ending) => json!({"event": "ended", "ending": format!("{ending:?}").to_lowercase()}),
        Notice::Channel { .. }
        | Notice::Message { .. }
        | Notice::Corrected { .. }
        | Notice::Imu { .. }
        | Notice::Read(_)
        | Notice::Saved { .. } => {
            return None;
        }
    })
}

fn message(message: &Message) -> (&'static str, Value) {
    match message {
        Message::Stillness(said) => ("stillness", stillness(said)),
        Message::Segment(said) => ("segment", segment(said)),
        Message::Turn(said) => ("turn", turn(said)),
        Message::Noise(said) => ("noise", noise(said)),
        Message::Coverage(said) => ("coverage", coverage(said)),
        Message::Calibration(said) => ("calibration", calibration(said)),
        Message::Log(said) => ("log", log(said)),
    }
}

fn stillness(said: &Stillness) -> Value {
    let statistic = Some(said.statistic).filter(|statistic| statistic.is_finite());
    json!({"state": said.state().as_str_name(), "statistic": statistic, "enter": said.enter, "leave": said.leave})
}

fn segment(said: &Segment) -> Value {
    json!({
        "start": nanos(&said.start),
        "end": nanos(&said.end),
        "accepted": said.accepted,
        "face": Some(&said.face).filter(|face| !face.is_empty()),
        "tilt_deg": said.tilt_deg,
        "reason": said.reason().as_str_name(),
        "explanation": said.explanation,
        "placement": said.placement,
        "temperature": said.temperature,
    })
}

fn turn(said: &Turn) -> Value {
    json!({
        "start": nanos(&said.start),
        "end": nanos(&said.end),
        "angle": said.angle,
        "residual": said.residual,
        "used": said.used,
        "reason": said.reason().as_str_name(),
        "explanation": said.explanation,
        "path": said.path,
        "vertical": said.vertical,
        "declared": said.declared,
        "declared_residual": said.declared_residual,
        "declared_std": said.declared_std,
    })
}

fn noise(said: &Noise) -> Value {
    let triad = |sums: &AllanSums| {
        let seconds = |octaves: &Octaves| octaves.samples as f64 * sums.period;
        json!({
            "sensor": sums.sensor,
            "period": sums.period,
            "seconds": sums.all.as_ref().map(seconds),
            "lasting_seconds": sums.lasting.as_ref().map(seconds),
        })
    };
    said.triads.iter().map(triad).collect()
}

fn calibration(said: &Calibration) -> Value {
    json!({
        "direction": direction(Some(said)),
        "revision": said.revision,
        "accelerometer": triad(said.accelerometer.as_ref()),
        "gyroscope": triad(said.gyroscope.as_ref()),
        "secondary": said.secondary.iter().map(|secondary| triad(Some(secondary))).collect::<Value>(),
        "gravity": said.gravity,
        "gravity_source": said.gravity_source,
        "segments": said.segments,
        "placements": said.placements,
    })
}

fn log(said: &Log) -> Value {
    json!({"level": said.level().as_str_name(), "name": said.name, "message": said.message})
}

fn nanos(time: &Option<prost_types::Timestamp>) -> Option<i64> {
    time.as_ref().map(|time| time.seconds.saturating_mul(1_000_000_000).saturating_add(time.nanos.into()))
}
