//! What a person reads at the end: rests found, faces seen, the calibration with its uncertainty, what was refused and
//! why, and what to do next.

use console::{measure_text_width, style};
use stillpoint::messages::triad::{Model, Status};
use stillpoint::messages::{Coverage, Segment, Triad, Vector3};
use stillpoint::run::Findings;

use super::table::{Table, estimate};

/// Rejected rests that are listed; there may be thousands.
const LISTED: usize = 12;

/// The findings of one IMU, on several lines.
pub fn imu(findings: &Findings) -> String {
    let mut lines = vec![heading(findings)];
    lines.push(rests(findings));
    if let Some(coverage) = &findings.coverage {
        lines.push(format!("  faces    {}", faces(coverage)));
    }
    lines.extend(calibration(findings));
    lines.extend(rejected(findings));
    if let Some(coverage) = &findings.coverage {
        lines.push(style("  next").for_stderr().bold().to_string());
        lines.extend(wrap(&coverage.next_step));
    }
    lines.join("\n")
}

/// The name of a measurement model, as in the configuration; `None` where there is none.
pub fn model(model: Model) -> Option<&'static str> {
    Some(match model {
        Model::None => return None,
        Model::Bias => "bias",
        Model::BiasScale => "bias-scale",
        Model::Triangular => "triangular",
        Model::CrossAxis => "cross-axis",
        Model::Full => "full",
    })
}

fn heading(findings: &Findings) -> String {
    let topic = match findings.topic == findings.name {
        true => String::new(),
        false => format!(" ({})", findings.topic),
    };
    format!("{}{topic}", style(&findings.name).for_stderr().bold())
}

fn rests(findings: &Findings) -> String {
    let (found, accepted) = (findings.rests.len(), findings.accepted());
    match found {
        0 => "  rests    none found".to_owned(),
        _ => format!("  rests    {found} found, {accepted} accepted, {} rejected", found - accepted),
    }
}

fn faces(coverage: &Coverage) -> String {
    let face = |face: &stillpoint::messages::Face| match face.placements {
        0 => style(format!("{} missing", face.name)).for_stderr().yellow().to_string(),
        n => format!("{} {n}× {:.1} s", face.name, face.seconds),
    };
    coverage.faces.iter().map(face).collect::<Vec<_>>().join("   ")
}

fn calibration(findings: &Findings) -> Vec<String> {
    let Some(calibration) = &findings.calibration else { return Vec::new() };
    let triads = || calibration.accelerometer.iter().chain(&calibration.gyroscope).chain(&calibration.secondary);
    let mut table = Table::default();
    for triad in triads() {
        let unit = if triad.sensor == "gyroscope" { "rad/s" } else { "m/s²" };
        table.heading(format!("{}  {}", triad.sensor, verdict(triad)));
        if let (Some(bias), Some(std)) = (&triad.bias, &triad.bias_std) {
            table.row(row(&format!("  bias {unit}"), bias, std));
        }
        if let (Some(scale), Some(std)) = (&triad.scale, &triad.scale_std) {
            table.row(row("  scale", scale, std));
        }
        if let Some(worst) = triad.worst_case_error {
            table.heading(format!("  corrected readings err by at most {worst:.3} m/s² (95 %)"));
        }
    }
    let mut lines = vec![style("  measured = bias + scale · true").for_stderr().dim().to_string()];
    lines.extend(table.lines("  "));
    for triad in triads() {
        lines.extend(triad.notes.iter().flat_map(|note| wrap(&format!("{}: {note}", triad.sensor))));
    }
    lines
}

fn verdict(triad: &Triad) -> String {
    let status = triad.status();
    let coloured = match status {
        Status::Undetermined => style(status.as_str_name()).for_stderr().yellow(),
        Status::Provisional => style(status.as_str_name()).for_stderr().cyan(),
        Status::Confirmed => style(status.as_str_name()).for_stderr().green(),
    };
    match model(triad.model()) {
        Some(model) => format!("{coloured} ({model})"),
        None => coloured.to_string(),
    }
}

fn row(name: &str, value: &Vector3, std: &Vector3) -> [String; 4] {
    [name.to_owned(), estimate(value.x, std.x), estimate(value.y, std.y), estimate(value.z, std.z)]
}

fn rejected(findings: &Findings) -> Vec<String> {
    let origin = findings.rests.keys().next().copied().unwrap_or_default();
    let line = |rest: &Segment| {
        let nanos = |t: &Option<prost_types::Timestamp>| {
            t.as_ref().map_or(0, |t| t.seconds.saturating_mul(1_000_000_000).saturating_add(t.nanos.into()))
        };
        let (start, end) = (nanos(&rest.start), nanos(&rest.end));
        let seconds = |nanos: i64| nanos as f64 * 1e-9;
        wrap(&format!(
            "{} at {:+.1} s, {:.1} s long: {}",
            rest.reason().as_str_name(),
            seconds(start.saturating_sub(origin)),
            seconds(end.saturating_sub(start)),
            rest.explanation
        ))
    };
    let mut lines: Vec<_> = findings.rejected().take(LISTED).flat_map(line).collect();
    let further = findings.rejected().count().saturating_sub(LISTED);
    if further > 0 {
        lines.push(format!("  … and {further} more"));
    }
    if !lines.is_empty() {
        lines.insert(0, "  rejected (times since the first rest)".to_owned());
    }
    lines
}

/// A sentence, indented, on lines that a terminal of 90 columns holds.
fn wrap(sentence: &str) -> Vec<String> {
    const COLUMNS: usize = 90;
    let mut lines = vec!["   ".to_owned()];
    for word in sentence.split_whitespace() {
        match lines.last_mut() {
            Some(line) if measure_text_width(line) + 1 + measure_text_width(word) <= COLUMNS => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(format!("      {word}")),
        }
    }
    lines
}
