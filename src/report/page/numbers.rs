//! The calibration in numbers, with its uncertainty, and its drift since an earlier one.

use std::fmt::Write as _;

use super::{Imu, escape, list, section as framed};
use crate::messages::triad::Status;
use crate::messages::{Triad, Vector3};
use crate::report::{Change, Findings, drift, estimate, matrix, model};

pub(super) fn section(imu: &Imu<'_>, earlier: Option<&[Findings]>) -> String {
    let Some(found) = &imu.findings.calibration else {
        let why = imu.findings.reason().unwrap_or_default();
        return framed("Calibration", &format!("<p>None was published: {}.</p>", escape(why.trim_end_matches('.'))));
    };
    let triads: String = imu.triads().map(triad).collect();
    let facts = format!(
        "<p class=\"dim\">Revision {} from {} in {}; gravity {:.5} m/s² ({}).</p>",
        found.revision,
        count(found.segments, "rest"),
        count(found.placements, "placement"),
        found.gravity,
        escape(&found.gravity_source)
    );
    let since = earlier.map(|earlier| since(imu.findings, earlier)).unwrap_or_default();
    framed("Calibration", &format!("{facts}{triads}{since}"))
}

fn count(n: u32, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn triad(triad: &Triad) -> String {
    let unit = if triad.sensor == "gyroscope" { "rad/s" } else { "m/s²" };
    let mut rows = String::new();
    if let Some(bias) = &triad.bias {
        row(&mut rows, "bias", &numbers(bias), &triad.bias_std.as_ref().map(numbers), unit);
    }
    let s = matrix(&triad.sensitivity);
    let std = matrix(&triad.sensitivity_std);
    match s {
        Some(s) if s != nalgebra::Matrix3::from_diagonal(&s.diagonal()) => {
            for (i, name) in ["S, row x", "S, row y", "S, row z"].into_iter().enumerate() {
                row(&mut rows, name, &s.row(i).transpose().into(), &std.map(|std| std.row(i).transpose().into()), "");
            }
        }
        Some(s) => row(&mut rows, "scale", &s.diagonal().into(), &std.map(|std| std.diagonal().into()), ""),
        None => {}
    }
    for (name, values, unit) in [
        ("g-sensitivity", &triad.g_sensitivity, "rad/s per m/s²"),
        ("to rotation", &triad.rate_sensitivity, "m/s² per rad/s"),
        ("g²-sensitivity", &triad.g2_sensitivity, "rad/s per (m/s²)²"),
    ] {
        for (i, values) in values.chunks_exact(3).enumerate() {
            let axis = if triad.g2_sensitivity.as_slice() == values {
                ""
            } else {
                [", row x", ", row y", ", row z"].get(i).unwrap_or(&"")
            };
            let cells: String = values.iter().map(|value| format!("<td class=\"n\">{value:.3e}</td>")).collect();
            let _ = write!(rows, "<tr><th>{name}{axis} <small>{unit}</small></th>{cells}</tr>");
        }
    }
    let status = triad.status();
    let verdict = match model(triad.model()) {
        Some(model) => format!("{} · {model}", status.as_str_name()),
        None => status.as_str_name().to_owned(),
    };
    let mut facts = Vec::new();
    facts.extend(triad.residual_rms.map(|rms| format!("residual {rms:.4} {unit}")));
    facts.extend(triad.chi2_per_dof.map(|chi2| format!("χ² per degree of freedom {chi2:.2}")));
    facts.extend(triad.worst_case_error.map(|worst| format!("worst error {worst:.4} {unit} (95 %)")));
    facts.extend(triad.condition.map(|condition| format!("condition {condition:.1}")));
    let table = match rows.is_empty() {
        true => String::new(),
        false => format!(
            "<div class=\"scroll\"><table><thead><tr><th></th><th class=\"n\">x</th><th class=\"n\">y</th><th class=\"n\">z</th></tr></thead>{rows}</table></div>"
        ),
    };
    let facts = if facts.is_empty() { String::new() } else { format!("<p class=\"dim\">{}</p>", facts.join(" · ")) };
    let notes = list("notes", &triad.notes);
    let class = if status == Status::Undetermined { "triad undetermined" } else { "triad" };
    format!(
        "<div class=\"{class}\"><h4>{} <small>{verdict}</small></h4>{table}{facts}{notes}</div>",
        escape(&triad.sensor)
    )
}

/// Row of three estimates, each with half the width of its 95 % interval; one without a standard deviation is fixed by
/// the model.
fn row(rows: &mut String, name: &str, values: &[f64; 3], std: &Option<[f64; 3]>, unit: &str) {
    let mut cells = String::new();
    for (i, value) in values.iter().enumerate() {
        let half = std.map(|std| 1.96 * std[i]).filter(|half| *half > 0.0);
        let _ = match half {
            Some(half) => {
                let text = estimate(*value, half);
                let (value, half) = text.split_once(" ± ").unwrap_or((&text, ""));
                write!(cells, "<td class=\"n\">{} <small>± {half}</small></td>", value.replace('-', "−"))
            }
            None => {
                write!(cells, "<td class=\"n\">{}</td>", format!("{}", (value * 1e5).round() / 1e5).replace('-', "−"))
            }
        };
    }
    let _ = write!(rows, "<tr><th>{name} <small>{unit}</small></th>{cells}</tr>");
}

fn numbers(v: &Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

fn since(now: &Findings, earlier: &[Findings]) -> String {
    let drifts = match drift(now, earlier) {
        Ok(drifts) => drifts,
        Err(why) => return format!("<h4>Since the earlier calibration</h4><p>{}</p>", escape(&why)),
    };
    let mut rows = String::new();
    for drift in &drifts {
        let unit = if drift.sensor == "gyroscope" { "rad/s" } else { "m/s²" };
        for (name, changes, unit) in [("bias", &drift.bias, unit), ("scale", &drift.scale, "")] {
            let Some(changes) = changes else { continue };
            let cell = |change: &Change| {
                let class = if change.is_significant() { "n moved" } else { "n" };
                let text = estimate(change.by, 1.96 * change.std);
                let (value, half) = text.split_once(" ± ").unwrap_or((&text, ""));
                // A value that rounds to zero has no sign.
                let is_zero = value.parse() == Ok(0.0);
                let value = if is_zero { value.trim_start_matches('-').to_owned() } else { value.replace('-', "−") };
                format!("<td class=\"{class}\">{value} <small>± {half}</small></td>")
            };
            let cells: String = changes.iter().map(cell).collect();
            let _ = write!(rows, "<tr><th>{} {name} <small>{unit}</small></th>{cells}</tr>", escape(&drift.sensor));
        }
    }
    let worst = drifts.iter().find_map(|drift| drift.worst);
    let worst = worst.map(|worst| {
        format!("<p>A reading corrected with the earlier calibration is off by up to <b>{worst:.3} m/s²</b>.</p>")
    });
    format!(
        "<h4>Change since the earlier calibration</h4>{}<div class=\"scroll\"><table><thead><tr><th></th><th class=\"n\">x</th><th class=\"n\">y</th>\
         <th class=\"n\">z</th></tr></thead>{rows}</table></div><p class=\"dim\">± is half of a 95 % interval; bold: more than three standard deviations.</p>",
        worst.unwrap_or_default()
    )
}
