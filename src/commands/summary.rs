//! What a person reads at the end: rests found, faces seen, the calibration with its uncertainty, what was refused and
//! why, and what to do next.

use console::{measure_text_width, style};
use stillpoint::messages::triad::Status;
use stillpoint::messages::{Face, Segment, Triad, Vector3};
use stillpoint::printable;
use stillpoint::report::{Change, Findings, drift, estimate, model};
use stillpoint::still;

use super::table::Table;

/// Half the width of a 95 % interval, in standard deviations.
const HALF: f64 = 1.96;

/// Rejected rests that are listed; there may be thousands.
const LISTED: usize = 12;

/// The findings of one IMU, on several lines; with the drift since an earlier calibration, if there is one.
pub fn imu(findings: &Findings, earlier: Option<&[Findings]>) -> String {
    let mut lines = vec![heading(findings), rests(findings)];
    if let Some(coverage) = &findings.coverage {
        lines.extend(wrap("  faces    ", "   ", coverage.faces.iter().map(face)));
    }
    lines.extend(calibration(findings));
    lines.extend(earlier.iter().flat_map(|earlier| since(findings, earlier)));
    lines.extend(rejected(findings));
    if let Some(coverage) = &findings.coverage {
        lines.extend(sentence(&format!("  {}     ", style("next").for_stderr().bold()), &coverage.next_step));
    }
    lines.join("\n")
}

/// One IMU while it is followed: as [`imu`], with its state instead of what was rejected.
pub fn live(findings: &Findings, status: &still::Status) -> Vec<String> {
    let mut lines = vec![format!("{}  {}", heading(findings), state(status)), rests(findings)];
    if let Some(coverage) = &findings.coverage {
        lines.extend(wrap("  faces    ", "   ", coverage.faces.iter().map(face)));
        lines.extend(sentence(&format!("  {}     ", style("next").for_stderr().bold()), &coverage.next_step));
    }
    lines.extend(calibration(findings));
    lines
}

/// Length of a rest, in seconds.
pub fn seconds(rest: &Segment) -> f64 {
    nanos(&rest.end).saturating_sub(nanos(&rest.start)) as f64 * 1e-9
}

fn state(status: &still::Status) -> String {
    let state = match status.state {
        still::State::Unknown => style("UNKNOWN").for_stderr().yellow(),
        still::State::Moving => style("MOVING").for_stderr().cyan(),
        still::State::Still => style("STILL").for_stderr().green(),
    };
    let floor = |floor: Option<f64>, digits: usize, unit: &str| {
        floor.map_or_else(|| format!("none {unit}"), |floor| format!("{floor:.digits$} {unit}"))
    };
    format!(
        "{state}  {:.1} × the noise floor of {}, {}",
        status.statistic,
        floor(status.accel_floor, 4, "m/s²"),
        floor(status.gyro_floor, 5, "rad/s")
    )
}

fn nanos(time: &Option<prost_types::Timestamp>) -> i64 {
    time.as_ref().map_or(0, |t| t.seconds.saturating_mul(1_000_000_000).saturating_add(t.nanos.into()))
}

fn heading(findings: &Findings) -> String {
    let topic = match findings.topic == findings.name {
        true => String::new(),
        false => format!(" ({})", printable(&findings.topic)),
    };
    format!("{}{topic}", style(printable(&findings.name)).for_stderr().bold())
}

fn rests(findings: &Findings) -> String {
    let (found, accepted) = (findings.rests.len(), findings.accepted());
    match found {
        0 => "  rests    none found".to_owned(),
        _ => format!("  rests    {found} found, {accepted} accepted, {} rejected", found - accepted),
    }
}

fn face(face: &Face) -> String {
    match face.placements {
        0 => style(format!("{} missing", printable(&face.name))).for_stderr().yellow().to_string(),
        times => format!("{} {times}× {:.1} s", printable(&face.name), face.seconds),
    }
}

fn calibration(findings: &Findings) -> Vec<String> {
    let Some(calibration) = &findings.calibration else { return Vec::new() };
    let triads = calibration.accelerometer.iter().chain(&calibration.gyroscope).chain(&calibration.secondary);
    let mut table = Table::default();
    for triad in triads {
        let unit = unit(&triad.sensor);
        table.heading(format!("{}  {}", printable(&triad.sensor), verdict(triad)));
        if let (Some(bias), Some(std)) = (&triad.bias, &triad.bias_std) {
            table.row(row(&format!("  bias {unit}"), bias, std));
        }
        if let (Some(scale), Some(std)) = (&triad.scale, &triad.scale_std) {
            table.row(row("  scale", scale, std));
        }
        if let Some(worst) = triad.worst_case_error {
            table.heading(format!("  corrected readings err by at most {worst:.3} m/s² (95 %)"));
        }
        triad.notes.iter().flat_map(|note| sentence("  ", note)).for_each(|line| table.heading(line));
    }
    let mut lines = vec![style("  measured = bias + scale · true, with 95 % intervals").for_stderr().dim().to_string()];
    lines.extend(table.lines("  "));
    lines
}

/// How far the sensors moved since an earlier calibration.
fn since(findings: &Findings, earlier: &[Findings]) -> Vec<String> {
    let drifts = match drift(findings, earlier) {
        Ok(drifts) => drifts,
        Err(why) => return sentence("  drift    ", &why),
    };
    if drifts.is_empty() {
        return vec!["  drift    none can be told: no triad is determined now and then".to_owned()];
    }
    let mut table = Table::default();
    for drift in &drifts {
        let verdict = match drift.is_significant() {
            true => style("has moved").for_stderr().yellow(),
            false => style("within the uncertainty").for_stderr().green(),
        };
        table.heading(format!("{}  {verdict}", printable(&drift.sensor)));
        let mut row = |name: String, changes: &Option<[Change; 3]>| {
            if let Some(changes) = changes {
                let cells = changes.map(|change| format!("{:+.5} ± {:.5}", change.by, HALF * change.std));
                table.row([name].into_iter().chain(cells));
            }
        };
        row(format!("  bias {}", unit(&drift.sensor)), &drift.bias);
        row("  scale".to_owned(), &drift.scale);
        if let Some(worst) = drift.worst {
            table.heading(format!("  a reading corrected with the earlier one is off by up to {worst:.3} m/s²"));
        }
    }
    let mut lines =
        vec![style("  drift: now less the earlier calibration, with 95 % intervals").for_stderr().dim().to_string()];
    lines.extend(table.lines("  "));
    lines
}

fn unit(sensor: &str) -> &'static str {
    if sensor == "gyroscope" { "rad/s" } else { "m/s²" }
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
    let values = [(value.x, std.x), (value.y, std.y), (value.z, std.z)].map(|(value, std)| estimate(value, HALF * std));
    let [x, y, z] = values;
    [name.to_owned(), x, y, z]
}

fn rejected(findings: &Findings) -> Vec<String> {
    let origin = findings.rests.keys().next().copied().unwrap_or_default();
    let line = |rest: &Segment| {
        let (start, end) = (nanos(&rest.start), nanos(&rest.end));
        let (at, long) = (start.saturating_sub(origin) as f64 * 1e-9, end.saturating_sub(start) as f64 * 1e-9);
        sentence(&format!("  {at:>+7.1} s {long:>5.1} s {} ", rest.reason().as_str_name()), &rest.explanation)
    };
    let mut lines: Vec<_> = findings.rejected().take(LISTED).flat_map(line).collect();
    let further = findings.rejected().count().saturating_sub(LISTED);
    if further > 0 {
        lines.push(format!("  … and {further} more"));
    }
    if !lines.is_empty() {
        lines.insert(0, "  rejected, by time since the first rest and length".to_owned());
    }
    lines
}

fn sentence(label: &str, text: &str) -> Vec<String> {
    wrap(label, " ", text.split_whitespace().map(|word| printable(word).into_owned()))
}

/// Words behind a label, on lines that a terminal of 100 columns holds.
fn wrap(label: &str, space: &str, words: impl Iterator<Item = String>) -> Vec<String> {
    /// Less the indent of a table.
    const COLUMNS: usize = 98;
    let indent = " ".repeat(measure_text_width(label));
    let mut lines = vec![label.to_owned()];
    for word in words {
        let Some(line) = lines.last_mut() else { break };
        let width = measure_text_width(line);
        match width <= indent.len() {
            true => line.push_str(&word),
            false if width + space.len() + measure_text_width(&word) <= COLUMNS => line.extend([space, &word]),
            false => lines.push(format!("{indent}{word}")),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use stillpoint::messages::Coverage;

    #[test]
    fn long_sentences_hang_behind_their_label() {
        let lines = sentence("  next  ", &"word ".repeat(40));
        assert!(lines.len() > 1 && lines.iter().all(|line| line.len() <= 100));
        assert!(lines[0].starts_with("  next  word word") && lines[1].starts_with("        word word"));
    }

    #[test]
    fn a_missing_face_and_the_next_step_are_said() {
        let faces = [("+X", 2), ("-X", 0)];
        let faces = faces.map(|(name, placements)| Face { name: name.into(), placements, seconds: 3.0, normal: None });
        let coverage = Coverage { faces: faces.to_vec(), next_step: "turn it".into(), ..Coverage::default() };
        let findings = Findings { coverage: Some(coverage), ..Findings::new("/imu", "/imu") };
        let text = console::strip_ansi_codes(&imu(&findings, None)).into_owned();
        assert_eq!(text, "/imu\n  rests    none found\n  faces    +X 2× 3.0 s   -X missing\n  next     turn it");
    }
}
