//! Findings for machines: the shape of `export --format json`, which `annotate --json` shares.

use serde_json::{Value, json};

use super::{Account, Change, Drift, Earlier, Findings, SHIFTED, SUSPICIOUS, account, direction, drift, model};
use crate::messages::{AxisNoise, Combination, Coverage, TemperatureModel, Triad, Vector3};

/// `{"topic": …, "accelerometer": {…}, …}` for each IMU.
pub fn imus<'a>(findings: impl IntoIterator<Item = &'a Findings>) -> Value {
    findings.into_iter().map(imu).collect()
}

/// `{"found": …, "accepted": …, "rejected": …}` over all IMUs.
pub fn rests<'a>(findings: impl IntoIterator<Item = &'a Findings>) -> Value {
    let (found, accepted) = findings
        .into_iter()
        .fold((0, 0), |(found, accepted), imu| (found + imu.rests.len(), accepted + imu.accepted()));
    json!({"found": found, "accepted": accepted, "rejected": found - accepted})
}

/// Drifts of an IMU since an earlier calibration, and what its rests say of that: lists of triads, or an error.
pub fn drifts(now: &Findings, earlier: &Earlier<'_>) -> Value {
    let changes = |changes: &Option<[Change; 3]>| {
        changes.map(|changes| json!({"by": changes.map(|change| change.by), "std": changes.map(|change| change.std)}))
    };
    let one = |drift: &Drift| {
        json!({
            "sensor": drift.sensor,
            "bias": changes(&drift.bias),
            "scale": changes(&drift.scale),
            "worst": drift.worst,
            "significant": drift.is_significant(),
        })
    };
    match (drift(now, earlier), account(now, earlier)) {
        (Ok(drifts), Ok(accounts)) => json!({
            "topic": now.topic,
            "compared_with": compared_with(now, earlier),
            "triads": drifts.iter().map(one).collect::<Value>(),
            "at_rests": accounts.iter().map(at_rests).collect::<Value>(),
            "false_alarms": {"suspicious": SUSPICIOUS, "shifted": SHIFTED},
        }),
        (Err(why), _) | (_, Err(why)) => json!({"topic": now.topic, "error": why}),
    }
}

/// Name of the IMU that one is compared with; `null` where the earlier calibration has no name.
fn compared_with(now: &Findings, earlier: &Earlier<'_>) -> Value {
    let counterpart = earlier.of(&now.name, &now.topic);
    counterpart.map_or(Value::Null, |counterpart| json!(text(&counterpart.findings.name)))
}

/// An earlier calibration of a triad at the rests of a recording.
fn at_rests(account: &Account) -> Value {
    let outcome = match &account.outcome {
        Ok(outcome) => outcome,
        Err(why) => return json!({"sensor": account.sensor, "verdict": null, "reason": why}),
    };
    json!({
        "sensor": account.sensor,
        "verdict": outcome.verdict.name(),
        "chance": outcome.chance,
        "placements": outcome.placements,
        "chi2_per_dof": outcome.chi2_per_dof,
        "worst": {
            "start": outcome.worst.start as f64 * 1e-9,
            "face": text(&outcome.worst.face),
            "axis": outcome.worst.axis.and_then(|axis| ["x", "y", "z"].get(axis).copied()),
            "off": outcome.worst.off,
            "std": outcome.worst.std,
        },
        "states_uncertainty": outcome.states_uncertainty,
    })
}

fn imu(findings: &Findings) -> Value {
    let calibration = findings.calibration.as_ref();
    // A calibration of another program has no history; its revision is 0.
    let history = calibration.filter(|c| c.revision > 0);
    json!({
        "name": findings.name,
        "topic": findings.topic,
        "direction": direction(calibration),
        "accelerometer": triad(calibration.and_then(|c| c.accelerometer.as_ref())),
        "gyroscope": triad(calibration.and_then(|c| c.gyroscope.as_ref())),
        "secondary": calibration.iter().flat_map(|c| &c.secondary).map(|t| triad(Some(t))).collect::<Value>(),
        "gravity": calibration.map(|c| c.gravity).filter(|&gravity| gravity > 0.0),
        "gravity_source": calibration.and_then(|c| text(&c.gravity_source)),
        "revision": history.map(|c| c.revision),
        "segments": history.map(|c| c.segments),
        "placements": history.map(|c| c.placements),
        "temperature_range": calibration.and_then(|c| Some([c.temperature_min?, c.temperature_max?])),
        "rests": rests([findings]),
        "coverage": findings.coverage.as_ref().map(coverage),
        "reason": findings.reason(),
    })
}

/// The faces seen, and the next step.
pub fn coverage(coverage: &Coverage) -> Value {
    let faces = coverage.faces.iter().map(|face| {
        json!({
            "name": face.name,
            "normal": face.normal.as_ref().map(vector),
            "placements": face.placements,
            "seconds": face.seconds,
        })
    });
    json!({"faces": faces.collect::<Value>(), "complete": coverage.complete, "next_step": coverage.next_step})
}

/// A triad; a parameter that is not estimated is `null`.
pub fn triad(triad: Option<&Triad>) -> Value {
    let none = Triad::default();
    let triad = triad.unwrap_or(&none);
    json!({
        "sensor": text(&triad.sensor),
        "topic": text(&triad.topic),
        "model": model(triad.model()),
        "status": triad.status().as_str_name(),
        "bias": triad.bias.as_ref().map(vector),
        "sensitivity": matrix(&triad.sensitivity),
        "bias_std": triad.bias_std.as_ref().map(vector),
        "sensitivity_std": matrix_of_estimates(&triad.sensitivity_std),
        "g_sensitivity": matrix(&triad.g_sensitivity),
        "g2_sensitivity": list(&triad.g2_sensitivity),
        "rate_sensitivity": matrix(&triad.rate_sensitivity),
        "residual_rms": triad.residual_rms,
        "chi2_per_dof": triad.chi2_per_dof,
        "worst_case_error": triad.worst_case_error,
        "condition": triad.condition,
        "placement_std": list(&triad.placement_std),
        "covariance": list(&triad.covariance),
        "row_norms": triad.row_norms.as_ref().map(vector),
        "row_norms_std": triad.row_norms_std.as_ref().map(vector),
        "misalignment": list(&triad.misalignment),
        "misalignment_std": list(&triad.misalignment_std),
        "turns": triad.turns,
        "noise": noise(&triad.noise),
        "temperature": triad.temperature.as_ref().map(temperature),
        "combinations": triad.combinations.iter().map(combination).collect::<Value>(),
        "notes": triad.notes,
    })
}

/// Sum of parameters that is known.
fn combination(known: &Combination) -> Value {
    json!({
        "coefficients": known.coefficients,
        "value": known.value,
        "std": known.std,
        "explanation": known.explanation,
    })
}

/// Noise densities by axis; a random walk that is not claimed is `null`.
fn noise(axes: &[AxisNoise]) -> Option<Value> {
    let by_axis = |value: &dyn Fn(&AxisNoise) -> Value| axes.iter().map(value).collect::<Value>();
    (!axes.is_empty()).then(|| {
        json!({
            "density": by_axis(&|axis| json!(axis.density)),
            "density_interval": by_axis(&|axis| json!([axis.density_low, axis.density_high])),
            "random_walk": by_axis(&|axis| json!(axis.random_walk)),
            "random_walk_low": by_axis(&|axis| json!(axis.random_walk_low)),
            "random_walk_high": by_axis(&|axis| json!(axis.random_walk_high)),
        })
    })
}

fn temperature(model: &TemperatureModel) -> Value {
    let by_degree = |values: &[f64]| values.chunks(3).map(|degree| json!(degree)).collect::<Value>();
    json!({
        "order": model.order,
        "reference": model.reference,
        "minimum": model.minimum,
        "maximum": model.maximum,
        "coefficients": by_degree(&model.coefficients),
        "coefficients_std": by_degree(&model.coefficients_std),
    })
}

fn vector(v: &Vector3) -> Value {
    // Protobuf does not distinguish zeros by their sign, so a value that was read back must not either.
    json!([v.x + 0.0, v.y + 0.0, v.z + 0.0])
}

fn text(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
}

fn list(values: &[f64]) -> Option<&[f64]> {
    (!values.is_empty()).then_some(values)
}

fn matrix(row_major: &[f64]) -> Option<Vec<&[f64]>> {
    list(row_major).map(|values| values.chunks(3).collect())
}

/// Standard deviations; zero belongs to an entry that the model holds fixed, and becomes `null`.
fn matrix_of_estimates(row_major: &[f64]) -> Option<Vec<Vec<Option<f64>>>> {
    let row = |row: &&[f64]| row.iter().map(|&std| Some(std).filter(|&std| std > 0.0)).collect();
    matrix(row_major).map(|rows| rows.iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::triad::{Model, Status};

    #[test]
    fn what_was_not_estimated_is_null() {
        let findings = Findings::new("/imu", "/imu");
        let value = imus([&findings]);
        assert_eq!(value[0]["topic"], "/imu");
        assert_eq!(value[0]["accelerometer"]["status"], "UNDETERMINED");
        for key in ["model", "bias", "sensitivity", "bias_std", "sensitivity_std", "chi2_per_dof"] {
            assert_eq!(value[0]["accelerometer"][key], Value::Null, "{key}");
        }
        assert_eq!(value[0]["coverage"], Value::Null);
    }

    #[test]
    fn entries_that_the_model_holds_fixed_have_no_deviation() {
        let triad = Triad {
            model: Model::BiasScale.into(),
            status: Status::Provisional.into(),
            sensitivity: vec![0.1 + 0.2, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            sensitivity_std: vec![0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.01],
            ..Triad::default()
        };
        let value = super::triad(Some(&triad));
        assert_eq!(value["model"], "bias-scale");
        assert_eq!(value["sensitivity"][0], json!([0.1 + 0.2, 0.0, 0.0]));
        assert_eq!(value["sensitivity_std"][1], json!([null, 0.01, null]));
        let read_back: Value = serde_json::from_str(&value.to_string()).unwrap();
        assert_eq!(read_back, value, "doubles read back exactly");
    }
}
