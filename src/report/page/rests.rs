//! The rests one by one: residuals of ‖a‖ − g, reasons of rejection, and a table of all.

use std::fmt::Write as _;

use super::{Imu, Rest, escape, section, signal};
use crate::Stamp;
use crate::report::plot::{Along, Plot, Scale, moment};

/// Most rests that are drawn, and most that are listed.
const DRAWN: usize = 600;
const LISTED: usize = 200;

/// Plots of ‖a‖ − g of each rest, before and after correction.
pub(super) fn residuals(imu: &Imu<'_>) -> String {
    let before = residual(imu, "Before: ‖a‖ − g of the mean reading, m/s²", |rest| rest.raw);
    let after = residual(imu, "After correction, m/s²", |rest| rest.corrected);
    if after.is_empty() && before.is_empty() {
        return String::new();
    }
    let legend = "<p class=\"dim\">One dot a rest, in the colour of its face; small grey ones were rejected. At rest, ‖a‖ is g.</p>";
    section("What remains at rest", &format!("{legend}<div class=\"two\">{before}{after}</div>"))
}

fn residual(imu: &Imu<'_>, caption: &str, value: fn(&Rest<'_>) -> Option<f64>) -> String {
    let known = || imu.rests.iter().filter_map(|rest| Some((rest, value(rest)?)));
    // A rejected rest may be anywhere; accepted ones set the scale.
    let scale = known().filter(|(rest, _)| rest.segment.accepted).map(|(_, v)| v.abs()).fold(0.0, f64::max);
    let scale = if scale > 0.0 { scale } else { known().map(|(_, v)| v.abs()).fold(0.0, f64::max) };
    if known().next().is_none() {
        return String::new();
    }
    let count = imu.rests.len() as f64;
    let mut plot = Plot::new(Scale::linear(0.4, count + 0.6, 0.0), Scale::linear(-scale, scale, 0.15));
    plot.rule(0.0, "zero", "");
    let step = imu.rests.len().div_ceil(DRAWN).max(1);
    for (rest, value) in known().step_by(step) {
        let class = signal::class(rest);
        let face = if rest.segment.face.is_empty() { "no face" } else { &rest.segment.face };
        plot.dot(rest.number as f64, value, &class, &format!("rest {} ({face}) {value:+.4} m/s²", rest.number));
    }
    let every = (imu.rests.len() / 8).max(1);
    let names: Vec<_> = (1..=imu.rests.len()).step_by(every).map(|n| (n as f64, n.to_string())).collect();
    plot.figure("", caption, Along::Names(&names))
}

/// Table of rejected rests with their reasons.
pub(super) fn rejected(imu: &Imu<'_>) -> String {
    let rejected = || imu.rests.iter().filter(|rest| !rest.segment.accepted);
    let count = rejected().count();
    if count == 0 {
        return String::new();
    }
    let mut rows = String::new();
    for rest in rejected().take(LISTED) {
        let reason = rest.segment.reason().as_str_name().to_lowercase().replace('_', " ");
        let _ = write!(
            rows,
            "<tr><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{:.1} s</td><td><b>{reason}</b> {}</td></tr>",
            rest.number,
            moment(rest.from),
            rest.until - rest.from,
            escape(&rest.segment.explanation)
        );
    }
    let more = more(count);
    let head = "<thead><tr><th class=\"n\">rest</th><th class=\"n\">at</th><th class=\"n\">length</th><th>why, and what to do</th></tr></thead>";
    section("Rejected rests", &format!("<div class=\"scroll\"><table class=\"wide\">{head}{rows}</table></div>{more}"))
}

/// Table of spans that were nearly rests.
pub(super) fn near_misses(imu: &Imu<'_>) -> String {
    let misses = &imu.findings.near_misses;
    let Some(advice) = misses.advice() else { return String::new() };
    let seconds = |stamp| Stamp::from_nanos(stamp).seconds_since(imu.origin);
    let mut rows = String::new();
    for miss in misses.iter() {
        let (from, until) = (seconds(miss.start), seconds(miss.end));
        let _ = write!(
            rows,
            "<tr><td class=\"n\">{}</td><td class=\"n\">{:.0} s</td><td class=\"n\">{:.1}</td><td class=\"n\">{:.1}</td></tr>",
            moment(from),
            (until - from).max(1.0),
            miss.lowest,
            miss.enter
        );
    }
    let more = more_than(misses.count(), misses.iter().count());
    let head = "<thead><tr><th class=\"n\">at</th><th class=\"n\">for about</th><th class=\"n\">noise floors reached</th>\
                <th class=\"n\">asked</th></tr></thead>";
    let text = format!("<p class=\"dim\">To take them: {}.</p>", escape(&advice));
    section("Nearly rests", &format!("{text}<div class=\"scroll\"><table>{head}{rows}</table></div>{more}"))
}

/// Table of accepted rests, collapsed.
pub(super) fn accepted(imu: &Imu<'_>) -> String {
    let accepted = || imu.rests.iter().filter(|rest| rest.segment.accepted);
    let count = accepted().count();
    if count == 0 {
        return String::new();
    }
    let mut rows = String::new();
    // Numbered among the accepted, so that none seems to be missing.
    let placements: std::collections::BTreeSet<_> = accepted().map(|rest| rest.segment.placement).collect();
    let placements: std::collections::BTreeMap<_, _> = placements.into_iter().zip(1..).collect();
    for rest in accepted().take(LISTED) {
        let placement: usize = placements.get(&rest.segment.placement).copied().unwrap_or_default();
        let tilt = rest.segment.tilt_deg.map(|tilt| format!("{tilt:.1}°")).unwrap_or_default();
        let value = |value: Option<f64>, decimals| {
            value.map(|v| format!("{v:+.decimals$}").replace('-', "−")).unwrap_or_default()
        };
        let _ = write!(
            rows,
            "<tr><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{:.1} s</td><td>{}</td><td class=\"n\">{tilt}</td>\
             <td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            rest.number,
            moment(rest.from),
            rest.until - rest.from,
            escape(&rest.segment.face),
            placement,
            value(rest.raw, 3),
            value(rest.corrected, 4)
        );
    }
    let head = "<thead><tr><th class=\"n\">rest</th><th class=\"n\">at</th><th class=\"n\">length</th><th>face</th><th class=\"n\">tilt</th>\
                <th class=\"n\">placement</th><th class=\"n\">‖a‖ − g, m/s²</th><th class=\"n\">corrected</th></tr></thead>";
    let more = more(count);
    format!(
        "<details><summary>Accepted rests ({count})</summary><div class=\"scroll\"><table>{head}{rows}</table></div>{more}</details>"
    )
}

fn more(count: usize) -> String {
    more_than(count, LISTED)
}

fn more_than(count: usize, listed: usize) -> String {
    match count.saturating_sub(listed) {
        0 => String::new(),
        further => format!("<p class=\"dim\">… and {further} more.</p>"),
    }
}
