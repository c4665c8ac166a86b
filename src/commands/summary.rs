//! Summary for people: the rests found, the faces seen, the calibration with its uncertainty, refusals with their
//! reasons, and the next step.

use console::style;
use stillpoint::messages::triad::Status;
use stillpoint::messages::{Face, Segment, Triad};
use stillpoint::printable;
use stillpoint::report::{Change, Findings, NearMiss, Weight, drift, estimate, model, weight};
use stillpoint::still;

use super::table::Table;
use super::text::Look;

/// Half the width of a 95 % interval, in standard deviations.
const HALF: f64 = 1.96;

/// Most rejected rests that are listed; there may be thousands.
const LISTED: usize = 12;

/// Most rests of one reason that are listed one by one; more share a line.
const ALIKE: usize = 3;

/// Findings of one IMU, on several lines; with the drift since an earlier calibration, if there is one.
pub fn imu(findings: &Findings, earlier: Option<&[Findings]>, look: Look) -> String {
    let mut lines = vec![heading(findings), rests(findings)];
    if let Some(coverage) = &findings.coverage {
        lines.extend(look.wrap("  faces    ", "   ", coverage.faces.iter().map(face)));
    }
    lines.extend(calibration(findings, look));
    lines.extend(earlier.iter().flat_map(|earlier| since(findings, earlier, look)));
    lines.extend(rejected(findings, look));
    lines.extend(near_misses(findings, look));
    if findings.coverage.is_some() {
        lines.extend(next(findings, look));
    }
    lines.join("\n")
}

/// Findings of one IMU while it is followed: as [`imu`], with its state instead of the rejected rests.
pub fn live(findings: &Findings, status: &still::Status, look: Look) -> Vec<String> {
    let state = look.wrap(&format!("{}  ", heading(findings)), "  ", state(status).into_iter());
    let mut lines: Vec<_> = state.into_iter().chain([rests(findings)]).collect();
    if let Some(coverage) = &findings.coverage {
        lines.extend(look.wrap("  faces    ", "   ", coverage.faces.iter().map(face)));
        lines.extend(next(findings, look));
    }
    lines.extend(calibration(findings, look));
    lines
}

fn next(findings: &Findings, look: Look) -> Vec<String> {
    look.sentence(&format!("  {}     ", style("next").for_stderr().bold()), &findings.next_step())
}

/// Length of a rest, in seconds.
pub fn seconds(rest: &Segment) -> f64 {
    nanos(&rest.end).saturating_sub(nanos(&rest.start)) as f64 * 1e-9
}

fn state(status: &still::Status) -> [String; 2] {
    let state = match status.state {
        still::State::Unknown => style("UNKNOWN").for_stderr().yellow(),
        still::State::Moving => style("MOVING").for_stderr().cyan(),
        still::State::Still => style("STILL").for_stderr().green(),
    };
    let floor = |floor: Option<f64>, digits: usize, unit: &str| {
        floor.map_or_else(|| format!("none {unit}"), |floor| format!("{floor:.digits$} {unit}"))
    };
    let level = format!(
        "{:.1} × the noise floor of {}, {}",
        status.statistic,
        floor(status.accel_floor, 4, "m/s²"),
        floor(status.gyro_floor, 5, "rad/s")
    );
    [state.to_string(), level]
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

fn calibration(findings: &Findings, look: Look) -> Vec<String> {
    if findings.calibration.is_none() {
        return Vec::new();
    }
    let text = "measured = bias + S · true, scale is the diagonal of S; ± is half of a 95 % interval";
    let mut lines = look
        .sentence("  ", text)
        .into_iter()
        .map(|line| style(line).for_stderr().dim().to_string())
        .collect::<Vec<_>>();
    let inside = Look { columns: look.columns - 2, ..look };
    let mut table = Table::default();
    for triad in findings.triads() {
        let unit = unit(&triad.sensor);
        table.heading(format!("{}  {}", printable(&triad.sensor), verdict(triad)));
        if let (Some(bias), Some(std)) = (&triad.bias, &triad.bias_std) {
            table.row(row(&format!("  bias {unit}"), [bias.x, bias.y, bias.z], [std.x, std.y, std.z]));
        }
        sensitivity(triad, &mut table);
        let is_primary = triad.sensor == "accelerometer";
        let mut says = |label: &str, text: &str| {
            inside.sentence(&format!("  {label:<14}"), text).into_iter().for_each(|line| table.heading(line));
        };
        if let Some([before, after]) = findings.residuals().filter(|_| is_primary) {
            says(
                "observed",
                &format!("‖a‖ at rest misses g by {after:.4} m/s² corrected, by {before:.3} as read (rms)"),
            );
        }
        if let Some(worst) = triad.worst_case_error {
            says("not excluded", &format!("that a corrected reading errs by {worst:.3} m/s² in some direction (95 %)"));
        }
        notes(triad, inside).into_iter().for_each(|line| table.heading(line));
    }
    lines.extend(table.lines("  ", look.columns));
    lines
}

/// Rows of the sensitivity S as far as the model has it: its diagonal, or the whole matrix.
fn sensitivity(triad: &Triad, table: &mut Table) {
    let (s, std) = (&triad.sensitivity, &triad.sensitivity_std);
    let is_diagonal = s.iter().enumerate().all(|(i, entry)| i % 4 == 0 || *entry == 0.0);
    match (&triad.scale, &triad.scale_std) {
        (Some(scale), Some(std)) if is_diagonal => {
            table.row(row("  scale", [scale.x, scale.y, scale.z], [std.x, std.y, std.z]));
        }
        _ if s.len() == 9 && !is_diagonal => {
            for (i, name) in ["x", "y", "z"].iter().enumerate() {
                let of = |all: &[f64]| [0, 1, 2].map(|j| all.get(3 * i + j).copied().unwrap_or_default());
                table.row(row(&format!("  S, row {name}"), of(s), of(std)));
            }
        }
        _ => {}
    }
}

/// Notes on a triad: warnings first; background only if asked for, or if there is nothing else.
fn notes(triad: &Triad, look: Look) -> Vec<String> {
    let least = match triad.notes.iter().any(|note| weight(note) > Weight::Detail) {
        true if !look.verbose => Weight::Hint,
        _ if look.verbose || triad.status() == Status::Undetermined => Weight::Detail,
        _ => Weight::Hint,
    };
    let mut notes: Vec<_> = triad.notes.iter().filter(|note| weight(note) >= least).collect();
    notes.sort_by_key(|note| std::cmp::Reverse(weight(note)));
    let line = |note: &String| match weight(note) {
        Weight::Serious => look.sentence(&format!("  {} ", style("!").for_stderr().yellow()), note),
        _ => look.sentence("  ", note),
    };
    notes.into_iter().flat_map(line).collect()
}

/// Drift of the sensors since an earlier calibration.
fn since(findings: &Findings, earlier: &[Findings], look: Look) -> Vec<String> {
    let drifts = match drift(findings, earlier) {
        Ok(drifts) => drifts,
        Err(why) => return look.sentence("  drift    ", &why),
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
            let inside = Look { columns: look.columns - 2, ..look };
            let text = format!("a reading corrected with the earlier one is off by up to {worst:.3} m/s²");
            inside.sentence("  ", &text).into_iter().for_each(|line| table.heading(line));
        }
    }
    let text = "  drift: now less the earlier calibration, ± 95 %";
    let mut lines = vec![style(text).for_stderr().dim().to_string()];
    lines.extend(table.lines("  ", look.columns));
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

/// Row of three estimates; one without a standard deviation is fixed by the model.
fn row(name: &str, values: [f64; 3], std: [f64; 3]) -> [String; 4] {
    let cell = |(value, std): (f64, f64)| match std > 0.0 {
        true => estimate(value, HALF * std),
        false => format!("{value:.0} (fixed)"),
    };
    let [(x, dx), (y, dy), (z, dz)] = [0, 1, 2].map(|i| (values[i], std[i]));
    [name.to_owned(), cell((x, dx)), cell((y, dy)), cell((z, dz))]
}

/// Rejected rests, grouped by reason.
fn rejected(findings: &Findings, look: Look) -> Vec<String> {
    let origin = findings.rests.keys().next().copied().unwrap_or_default();
    let at = |rest: &Segment| nanos(&rest.start).saturating_sub(origin) as f64 * 1e-9;
    let mut groups = Vec::<(String, Vec<&Segment>)>::new();
    for rest in findings.rejected() {
        let alike = format!("{} {}", rest.reason().as_str_name(), without_numbers(&rest.explanation));
        match groups.iter_mut().find(|(known, _)| *known == alike) {
            Some((_, rests)) => rests.push(rest),
            None => groups.push((alike, vec![rest])),
        }
    }
    let line = |rest: &Segment| {
        let label = format!("  {:>+7.1} s {:>5.1} s  ", at(rest), seconds(rest));
        look.sentence(&label, &format!("{} {}", rest.reason().as_str_name(), rest.explanation))
    };
    // One line per group, or one per rest, in time order.
    let mut lines = Vec::new();
    for (_, rests) in &groups {
        match rests.as_slice() {
            [first, .., last] if rests.len() > ALIKE => {
                let label = format!("  {:>+7.1} s to {:+.1} s  ", at(first), at(last));
                let (count, reason) = (rests.len(), first.reason().as_str_name());
                let text = format!("{count} rests {reason}, the first: {}", first.explanation);
                lines.push((at(first), look.sentence(&label, &text)));
            }
            few => lines.extend(few.iter().map(|rest| (at(rest), line(rest)))),
        }
    }
    lines.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let further = lines.len().saturating_sub(LISTED);
    let mut said: Vec<_> = lines.into_iter().take(LISTED).flat_map(|(_, lines)| lines).collect();
    if further > 0 {
        said.push(format!("  … and {further} more"));
    }
    if !said.is_empty() {
        said.insert(0, "  rejected, by time since the first rest and length".to_owned());
    }
    said
}

/// A text without its numbers, so that texts of one kind are equal.
fn without_numbers(text: &str) -> String {
    text.split(|c: char| c.is_ascii_digit() || c == '.').collect()
}

/// Spans that were nearly rests, where more rests would help.
fn near_misses(findings: &Findings, look: Look) -> Vec<String> {
    const NAMED: usize = 6;
    let (misses, Some(advice)) = (&findings.near_misses, findings.near_misses.advice()) else { return Vec::new() };
    if findings.is_done() && !look.verbose {
        return Vec::new();
    }
    let origin = findings.rests.keys().next().copied().or(misses.iter().next().map(|miss| miss.start));
    let origin = origin.unwrap_or_default();
    let one = |miss: &NearMiss| {
        let at = |stamp: i64| stamp.saturating_sub(origin) as f64 * 1e-9;
        format!("{:+.1} s ({:.1} for {:.0} s)", at(miss.start), miss.lowest, (at(miss.end) - at(miss.start)).max(1.0))
    };
    let named: Vec<_> = misses.iter().take(NAMED).map(one).collect();
    let further = misses.count() - named.len();
    let more = if further > 0 { format!(" and {further} more") } else { String::new() };
    let below = misses.iter().next().map_or(0.0, |miss| miss.enter);
    let text = format!(
        "nearly still, in noise floors where {below} are asked: {}{more}. To take them: {advice}",
        named.join(", ")
    );
    look.sentence("  missed   ", &text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stillpoint::messages::Coverage;

    const LOOK: Look = Look { columns: 100, verbose: false };

    #[test]
    fn a_missing_face_and_the_next_step_are_said() {
        let faces = [("+X", 2), ("-X", 0)];
        let faces = faces.map(|(name, placements)| Face { name: name.into(), placements, seconds: 3.0, normal: None });
        let coverage = Coverage { faces: faces.to_vec(), next_step: "turn it".into(), ..Coverage::default() };
        let findings = Findings { coverage: Some(coverage), ..Findings::new("/imu", "/imu") };
        let text = console::strip_ansi_codes(&imu(&findings, None, LOOK)).into_owned();
        assert_eq!(text, "/imu\n  rests    none found\n  faces    +X 2× 3.0 s   -X missing\n  next     turn it");
    }

    #[test]
    fn rests_that_were_rejected_for_one_reason_are_one_line() {
        let mut findings = Findings::new("/imu", "/imu");
        for i in 0..9 {
            let stamp = |seconds| Some(prost_types::Timestamp { seconds, nanos: 0 });
            let explanation = format!("reads 1.0{i} m/s² at rest, where gravity is 9.81: it is in g");
            let (start, end) = (stamp(4 * i), stamp(4 * i + 2));
            findings.rests.insert(i, Segment { start, end, explanation, ..Segment::default() });
        }
        let lines = rejected(&findings, LOOK);
        assert_eq!(lines.len(), 3, "{lines:?}");
        assert!(lines[1].contains("+0.0 s to +32.0 s  9 rests") && lines[1].contains("the first: reads 1.00 m/s²"));
        findings.rests.retain(|key, _| *key < 2);
        assert_eq!(rejected(&findings, Look { columns: 120, verbose: false }).len(), 3, "two stand on their own");
    }

    #[test]
    fn every_entry_of_a_triangular_s_is_shown_and_the_background_is_asked_for() {
        let refused = "full is not determined: no reference";
        let triad = Triad {
            sensor: "accelerometer".into(),
            status: Status::Confirmed.into(),
            sensitivity: vec![1.0, 0.0, 0.0, 0.012, 1.0, 0.0, 0.0, -0.034, 1.0],
            sensitivity_std: vec![0.01, 0.0, 0.0, 0.01, 0.01, 0.0, 0.01, 0.01, 0.01],
            notes: vec![refused.into(), "misses gravity by 104°".into()],
            ..Triad::default()
        };
        let found = stillpoint::messages::Calibration { accelerometer: Some(triad), ..Default::default() };
        let findings = Findings { calibration: Some(found), ..Findings::new("/imu", "/imu") };
        let text = |verbose| imu(&findings, None, Look { columns: 100, verbose });
        for entry in ["0.012 ± 0.020", "-0.034 ± 0.020", "0 (fixed)", "! misses gravity by 104°"] {
            assert!(console::strip_ansi_codes(&text(false)).contains(entry), "{entry} is not in {}", text(false));
        }
        assert!(!text(false).contains(refused) && text(true).contains(refused));
        assert!(!findings.is_done());
    }
}
