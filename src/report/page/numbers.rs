//! The calibration in numbers, with its uncertainty, and its drift since an earlier one.

use maud::{Markup, html};

use super::elements::{self, axes, notes, sentence, table};
use super::imu::Imu;
use crate::fit::Gravity;
use crate::messages::triad::Status;
use crate::messages::{Triad, Vector3};
use crate::report::{Change, CrossTerm, Drift, Earlier, Findings, cross_terms, drift, estimate, matrix, model};

pub(super) fn section(imu: &Imu<'_>, earlier: Option<&Earlier<'_>>) -> Markup {
    let Some(found) = &imu.findings.calibration else {
        let why = imu.findings.reason().unwrap_or_default().trim_end_matches('.');
        return elements::section("Calibration", html! { p { "None was published: " (why) "." } });
    };
    let standard = Gravity::standard();
    let half = standard.half_interval();
    let gravity = match found.gravity_source == standard.source.name() {
        true => format!("{:.5} ± {half:.4}", found.gravity),
        false => format!("{:.5}", found.gravity),
    };
    let content = html! {
        p.dim {
            "Revision " (found.revision) " from " (count(found.segments, "rest")) " in "
            (count(found.placements, "placement")) "; gravity " (gravity) " m/s² ("
            (found.gravity_source) ")."
        }
        @for found in imu.findings.triads() { (triad(found)) }
        @if let Some(earlier) = earlier { (since(imu.findings, earlier)) }
    };
    elements::section("Calibration", content)
}

fn count(n: u32, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn triad(triad: &Triad) -> Markup {
    let rows = rows(triad);
    let facts = facts(triad);
    let status = triad.status();
    let class = if status == Status::Undetermined { "triad undetermined" } else { "triad" };
    html! {
        div class=(class) {
            h4 {
                (triad.sensor) " "
                small { (status.as_str_name()) @if let Some(model) = model(triad.model()) { " · " (model) } }
            }
            @if !rows.is_empty() { (table(None, Some(axes()), &rows)) }
            @if !triad.combinations.is_empty() {
                p { "Known in part, ± half of a 95 % interval:" }
                ul.known { @for known in &triad.combinations { li { (known.explanation) } } }
            }
            @if !facts.is_empty() { p.dim { (facts.join(" · ")) } }
            @if let Some(notes) = notes(&triad.notes) { (notes) }
        }
    }
}

fn unit(sensor: &str) -> &'static str {
    if sensor == "gyroscope" { "rad/s" } else { "m/s²" }
}

/// Coefficients of the bias over the temperature by degree, with their standard deviations.
fn coefficients(triad: &Triad) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
    let three = |values: &[f64]| <[f64; 3]>::try_from(values).unwrap_or_default();
    let model = triad.temperature.iter();
    model.flat_map(move |model| {
        let pairs = model.coefficients.chunks_exact(3).zip(model.coefficients_std.chunks_exact(3));
        pairs.map(move |(value, std)| (three(value), three(std)))
    })
}

/// Rows of the parameters that a triad has.
fn rows(triad: &Triad) -> Vec<Markup> {
    let mut rows = Vec::new();
    if let Some(bias) = &triad.bias {
        rows.push(row("bias", &numbers(bias), &triad.bias_std.as_ref().map(numbers), unit(&triad.sensor)));
    }
    let std = matrix(&triad.sensitivity_std);
    match matrix(&triad.sensitivity) {
        Some(s) if s != nalgebra::Matrix3::from_diagonal(&s.diagonal()) => {
            for (i, name) in ["S, row x", "S, row y", "S, row z"].into_iter().enumerate() {
                rows.push(row(name, &s.row(i).transpose().into(), &std.map(|std| std.row(i).transpose().into()), ""));
            }
        }
        Some(s) => rows.push(row("scale", &s.diagonal().into(), &std.map(|std| std.diagonal().into()), "")),
        None => {}
    }
    for (degree, (value, std)) in coefficients(triad).enumerate() {
        let unit = format!("{} per °C{}", unit(&triad.sensor), ["", "²", "³"].get(degree).unwrap_or(&""));
        rows.push(row(["by °C", "by °C²", "by °C³"].get(degree).unwrap_or(&""), &value, &Some(std), &unit));
    }
    for CrossTerm { name, unit, rows: of_term } in cross_terms(triad) {
        let is_matrix = of_term.len() == 3;
        for ([values, std], axis) in of_term.iter().zip([", row x", ", row y", ", row z"]) {
            rows.push(row(&format!("{name}{}", if is_matrix { axis } else { "" }), values, &Some(*std), unit));
        }
    }
    rows
}

fn facts(triad: &Triad) -> Vec<String> {
    let unit = unit(&triad.sensor);
    let facts = [
        triad.residual_rms.map(|rms| format!("residual {rms:.4} {unit}")),
        triad.chi2_per_dof.map(|chi2| format!("χ² per degree of freedom {chi2:.2}")),
        triad.worst_case_error.map(|worst| format!("worst error {worst:.4} {unit} (95 %)")),
        triad.condition.map(|condition| format!("condition {condition:.1}")),
    ];
    facts.into_iter().flatten().collect()
}

/// Row of three estimates, each with half the width of its 95 % interval; one without a standard deviation is fixed by
/// the model.
fn row(name: &str, values: &[f64; 3], std: &Option<[f64; 3]>, unit: &str) -> Markup {
    let cell = |(i, value): (usize, &f64)| match std.map(|std| 1.96 * std[i]).filter(|half| *half > 0.0) {
        Some(half) => {
            let text = estimate(*value, half);
            let (value, half) = text.split_once(" ± ").unwrap_or((&text, ""));
            html! { td.n { (value) " " small { "± " (half) } } }
        }
        None if *value != 0.0 && value.abs() < 1e-3 => html! { td.n { (format!("{value:.3e}")) } },
        None => html! { td.n { (format!("{}", (value * 1e5).round() / 1e5 + 0.0)) } },
    };
    html! { tr { th { (name) " " small { (unit) } } @for value in values.iter().enumerate() { (cell(value)) } } }
}

fn numbers(v: &Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}

fn since(now: &Findings, earlier: &Earlier<'_>) -> Markup {
    let drifts = match drift(now, earlier) {
        Ok(drifts) => drifts,
        Err(why) => return html! { h4 { "Since the earlier calibration" } p { (why) } },
    };
    let rows: Vec<_> = drifts.iter().flat_map(changes).collect();
    let note = earlier.of(&now.name, &now.topic).ok().and_then(|counterpart| counterpart.note);
    html! {
        h4 { "Change since the earlier calibration" }
        @if let Some(note) = note { p.dim { (sentence(&note)) } }
        @if let Some(worst) = drifts.iter().find_map(|drift| drift.worst) {
            @let worst = format!("{worst:.3} m/s²");
            p { "A reading corrected with the earlier calibration is off by up to " b { (worst) } "." }
        }
        (table(None, Some(axes()), &rows))
        p.dim { "± is half of a 95 % interval; bold: more than three standard deviations." }
    }
}

/// Rows of a triad's drift.
fn changes(drift: &Drift) -> Vec<Markup> {
    let known = [("bias", &drift.bias, unit(&drift.sensor)), ("scale", &drift.scale, "")];
    let row = |(name, changes, unit): (&str, &Option<[Change; 3]>, &str)| {
        let changes = changes.as_ref()?;
        Some(html! {
            tr { th { (drift.sensor) " " (name) " " small { (unit) } } @for change in changes { (cell(change)) } }
        })
    };
    known.into_iter().filter_map(row).collect()
}

fn cell(change: &Change) -> Markup {
    let class = if change.is_significant() { "n moved" } else { "n" };
    let text = estimate(change.by, 1.96 * change.std);
    let (value, half) = text.split_once(" ± ").unwrap_or((&text, ""));
    // A value that rounds to zero has no sign.
    let is_zero = value.parse() == Ok(0.0);
    let value = if is_zero { value.trim_start_matches('-') } else { value };
    html! { td class=(class) { (value) " " small { "± " (half) } } }
}
