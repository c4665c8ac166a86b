//! Calibration in a summary: its parameters with their intervals, notes on them, and their drift since an earlier one.

use std::collections::BTreeSet;

use console::style;
use stillpoint::messages::Triad;
use stillpoint::messages::triad::Status;
use stillpoint::printable;
use stillpoint::report::{Change, CrossTerm, Earlier, Findings, Weight, cross_terms, drift, estimate, model, weight};

use crate::commands::table::Table;
use crate::commands::text::Look;

/// Half the width of a 95 % interval, in standard deviations.
const HALF: f64 = 1.96;

/// The calibration, triad by triad; nothing if none was published.
pub fn calibration(findings: &Findings, look: Look) -> Vec<String> {
    if findings.calibration.is_none() {
        return Vec::new();
    }
    let others: BTreeSet<_> = findings.triads().flat_map(cross_terms).map(|term| term.name).collect();
    let cross = match others.iter().copied().collect::<Vec<_>>().as_slice() {
        [] => "",
        ["g-sensitivity"] => " + G · true acceleration",
        _ => " + G · the other sensor's true reading",
    };
    let text = format!("measured = bias + S · true{cross}, scale is the diagonal of S; ± is half of a 95 % interval");
    let mut lines = look
        .sentence("  ", &text)
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
        cross_rows(triad, &mut table);
        let is_primary = triad.sensor == "accelerometer";
        let mut says = |label: &str, text: &str| {
            inside.sentence(&format!("  {label:<14}"), text).into_iter().for_each(|line| table.heading(line));
        };
        triad.combinations.iter().for_each(|known| says("in part", &known.explanation));
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

/// Rows of the sensitivity to the other sensor's quantity.
fn cross_rows(triad: &Triad, table: &mut Table) {
    for CrossTerm { name, unit, rows } in cross_terms(triad) {
        for ([values, std], axis) in rows.iter().zip(["x", "y", "z"]) {
            let label = if rows.len() == 3 { format!("  G, row {axis}") } else { format!("  {name}") };
            table.row(row(&label, *values, *std));
        }
        if rows.len() == 3 {
            table.heading(format!("  G is the {name}, {unit}"));
        }
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
pub fn since(findings: &Findings, earlier: &Earlier<'_>, look: Look) -> Vec<String> {
    let drifts = match drift(findings, earlier) {
        Ok(drifts) => drifts,
        Err(why) => return look.sentence("  drift    ", &why),
    };
    let note = earlier.of(&findings.name, &findings.topic).ok().and_then(|counterpart| counterpart.note);
    let note = note.map(|note| look.sentence("  drift    ", &note)).unwrap_or_default();
    if drifts.is_empty() {
        return [note, vec!["  drift    none can be told: no triad is determined now and then".to_owned()]].concat();
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
    let mut lines = [note, vec![style(text).for_stderr().dim().to_string()]].concat();
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
