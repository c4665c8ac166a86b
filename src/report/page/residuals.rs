//! Residuals of calibrations: gravity and rotation at the rests, and the turns between them.

use maud::{Markup, html};

use super::elements::{more, section, table};
use super::imu::{Imu, Residual, Rest};
use super::signal;
use crate::Stamp;
use crate::messages::Turn;
use crate::report::nanos;
use crate::report::plot::{Along, Plot, Scale, moment};

/// Most sensors whose residuals are drawn.
const DRAWN_SENSORS: usize = 8;
/// Most rests or turns that are drawn, and most turns that are listed.
const DRAWN: usize = 600;
const LISTED: usize = 200;

/// Quantity that the calibration of a sensor leaves of its mean reading in a rest.
struct Left {
    captions: [String; 2],
    unit: &'static str,
    decimals: usize,
    by_rest: Vec<Residual>,
}

/// A value at a place along x, with its colour class and what it says when it is pointed at.
struct Dot {
    at: usize,
    value: f64,
    class: String,
    title: String,
    /// Whether it sets the scale.
    counts: bool,
}

/// Plots of ‖a‖ − g and ‖ω‖ of each rest, before and after correction, sensor by sensor.
pub(super) fn at_rest(imu: &Imu<'_>) -> Option<Markup> {
    let primary = Left {
        captions: ["Before: ‖a‖ − g of the mean reading, m/s²", "After correction, m/s²"].map(str::to_owned),
        unit: "m/s²",
        decimals: 4,
        by_rest: imu.rests.iter().map(|rest| rest.residual).collect(),
    };
    let rate = Left {
        captions: ["Gyroscope, before: ‖ω‖ of the mean reading, rad/s", "Gyroscope, after correction, rad/s"]
            .map(str::to_owned),
        unit: "rad/s",
        decimals: 5,
        by_rest: imu.rates_at_rest(),
    };
    let sensors = imu.sensors().into_iter().filter(|sensor| !matches!(*sensor, "accelerometer" | "gyroscope"));
    let secondary = sensors.take(DRAWN_SENSORS).map(|sensor| Left {
        captions: ["before: ‖a‖ − g of the mean reading, m/s²", "after correction, m/s²"]
            .map(|caption| format!("{sensor}, {caption}")),
        unit: "m/s²",
        decimals: 4,
        by_rest: imu.residuals_of(sensor),
    });
    let pairs: Vec<_> =
        std::iter::once(primary).chain(secondary).chain([rate]).filter_map(|left| pair(imu, &left)).collect();
    let content = html! {
        p.dim {
            "One dot a rest, in the colour of its face; small grey ones were rejected; an arrow is one beyond the scale. At rest, "
            "‖a‖ is g and ‖ω‖ zero."
        }
        @for pair in &pairs { (pair) }
    };
    (!pairs.is_empty()).then(|| section("What remains at rest", content))
}

/// Plots of the residuals of one sensor, before and after correction.
fn pair(imu: &Imu<'_>, left: &Left) -> Option<Markup> {
    let [before, after] = &left.captions;
    let dots = |value: fn(&Residual) -> Option<f64>| -> Vec<Dot> {
        let rests = imu.rests.iter().zip(&left.by_rest);
        let dot = |(rest, residual): (&Rest<'_>, &Residual)| {
            let value = value(residual)?;
            let face = if rest.segment.face.is_empty() { "no face" } else { &rest.segment.face };
            let title = format!("rest {} ({face}) {value:+.*} {}", rest.number, left.decimals, left.unit);
            let counts = rest.segment.accepted;
            Some(Dot { at: rest.number, value, class: signal::class(rest), title, counts })
        };
        rests.filter_map(dot).collect()
    };
    let before = figure(before, &dots(|residual| residual.raw), imu.rests.len(), "rest");
    let after = figure(after, &dots(|residual| residual.corrected), imu.rests.len(), "rest");
    let plots: Vec<_> = before.into_iter().chain(after).collect();
    (!plots.is_empty()).then(|| html! { div.two { @for plot in &plots { (plot) } } })
}

/// Plot of values at places from 1 to `count`, numbers of that thing; `None` without any.
fn figure(caption: &str, dots: &[Dot], count: usize, thing: &str) -> Option<Markup> {
    if dots.is_empty() {
        return None;
    }
    // What was rejected may be anywhere: if it lies too far off to draw the others apart, what counts sets the scale.
    const FAR: f64 = 3.0;
    let largest = |dots: &mut dyn Iterator<Item = &Dot>| dots.map(|dot| dot.value.abs()).fold(0.0, f64::max);
    let (counting, all) = (largest(&mut dots.iter().filter(|dot| dot.counts)), largest(&mut dots.iter()));
    let scale = if counting > 0.0 && all > FAR * counting { counting } else { all };
    let lowest = if dots.iter().all(|dot| dot.value >= 0.0) { 0.0 } else { -scale };
    let mut plot = Plot::new(Scale::linear(0.4, count as f64 + 0.6, 0.0), Scale::linear(lowest, scale, 0.15));
    plot.rule(0.0, "zero", "");
    let step = count.div_ceil(DRAWN).max(1);
    for dot in dots.iter().step_by(step) {
        plot.dot(dot.at as f64, dot.value, &dot.class, &dot.title);
    }
    let every = (count / 8).max(1);
    let names: Vec<_> = (1..=count).step_by(every).map(|n| (n as f64, n.to_string())).collect();
    Some(plot.figure("", caption, Along::Names(&names, thing)))
}

/// Plot of the angle that each turn misses gravity by, and a table of the turns, collapsed.
pub(super) fn of_turns(imu: &Imu<'_>) -> Option<Markup> {
    let turns: Vec<&Turn> = imu.findings.turns.values().collect();
    if turns.is_empty() {
        return None;
    }
    let dot = |(at, turn): (usize, &&Turn)| {
        let value = turn.residual?.to_degrees();
        let (number, angle) = (at + 1, turn.angle.to_degrees());
        let title = format!("turn {number} by {angle:.0}°: {value:.2}° ({})", verdict(turn));
        let class = if turn.used { "f" } else { "rejected" }.to_owned();
        Some(Dot { at: number, value, class, title, counts: turn.used })
    };
    let dots: Vec<_> = turns.iter().enumerate().filter_map(dot).collect();
    let degrees = |angle: f64, decimals| format!("{:.decimals$}°", angle.to_degrees());
    let row = |(at, turn): (usize, &&Turn)| {
        let start = Stamp::from_nanos(nanos(&turn.start)).seconds_since(imu.origin);
        html! {
            tr {
                td.n { (at + 1) } td.n { (moment(start)) } td.n {
                    // Of a turn that could not be followed nothing is known.
                    @if turn.axis.is_some() || turn.angle > 0.0 { (degrees(turn.angle, 0)) } @else { "unknown" }
                }
                td.n { @if let Some(residual) = turn.residual { (degrees(residual, 2)) } }
                td { (verdict(turn)) @if !turn.used && !turn.explanation.is_empty() { ": " (turn.explanation) } }
            }
        }
    };
    let rows: Vec<_> = turns.iter().enumerate().take(LISTED).map(row).collect();
    let head =
        html! { th.n { "turn" } th.n { "at" } th.n { "angle" } th.n { "missed by" } th { "in the calibration" } };
    let content = html! {
        p.dim {
            "One dot a turn between two rests: the angle between gravity as the gyroscope predicts it and as it is read. Small "
            "grey ones are not in the calibration; an arrow is one beyond the scale."
        }
        @if let Some(plot) = figure("Gravity missed after each turn, degrees", &dots, turns.len(), "turn") { (plot) }
        details {
            summary { "Turns (" (turns.len()) ")" }
            (table(Some("wide"), Some(head), &rows))
            (more(turns.len(), LISTED))
        }
    };
    Some(section("What remains of the turns", content))
}

fn verdict(turn: &Turn) -> String {
    match turn.used {
        true => "yes".to_owned(),
        // The reason of one that nothing is wrong with is that all of them together say too little.
        false if turn.reason == 0 => "not yet".to_owned(),
        false => format!("no, {}", turn.reason().as_str_name().to_lowercase()),
    }
}
