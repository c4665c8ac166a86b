//! The rests one by one: residuals of ‖a‖ − g, reasons of rejection, and a table of all.

use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};

use super::elements::{section, table};
use super::imu::{Imu, Residual, Rest};
use super::signal;
use crate::Stamp;
use crate::report::NearMiss;
use crate::report::plot::{Along, Plot, Scale, moment};

/// Most secondary accelerometers whose residuals are drawn.
const DRAWN_SENSORS: usize = 8;
/// Most rests that are drawn, and most that are listed.
const DRAWN: usize = 600;
const LISTED: usize = 200;

/// Plots of ‖a‖ − g of each rest, before and after correction, accelerometer by accelerometer.
pub(super) fn residuals(imu: &Imu<'_>) -> Option<Markup> {
    let primary: Vec<_> = imu.rests.iter().map(|rest| rest.residual).collect();
    let primary = pair(imu, &primary, ["Before: ‖a‖ − g of the mean reading, m/s²", "After correction, m/s²"]);
    let sensors = imu.sensors().into_iter().filter(|sensor| !matches!(*sensor, "accelerometer" | "gyroscope"));
    let secondary = sensors.take(DRAWN_SENSORS).filter_map(|sensor| {
        let captions = ["before: ‖a‖ − g of the mean reading, m/s²", "after correction, m/s²"];
        let captions = captions.map(|caption| format!("{sensor}, {caption}"));
        pair(imu, &imu.residuals_of(sensor), captions.each_ref().map(String::as_str))
    });
    let pairs: Vec<_> = primary.into_iter().chain(secondary).collect();
    let content = html! {
        p.dim { "One dot a rest, in the colour of its face; small grey ones were rejected. At rest, ‖a‖ is g." }
        @for pair in &pairs { (pair) }
    };
    (!pairs.is_empty()).then(|| section("What remains at rest", content))
}

/// Plots of the residuals of one accelerometer, before and after correction.
fn pair(imu: &Imu<'_>, residuals: &[Residual], captions: [&str; 2]) -> Option<Markup> {
    let [before, after] = captions;
    let before = residual(imu, before, residuals.iter().map(|residual| residual.raw));
    let after = residual(imu, after, residuals.iter().map(|residual| residual.corrected));
    let plots: Vec<_> = before.into_iter().chain(after).collect();
    (!plots.is_empty()).then(|| html! { div.two { @for plot in &plots { (plot) } } })
}

fn residual(imu: &Imu<'_>, caption: &str, values: impl Iterator<Item = Option<f64>>) -> Option<Markup> {
    let known: Vec<_> = imu.rests.iter().zip(values).filter_map(|(rest, value)| Some((rest, value?))).collect();
    if known.is_empty() {
        return None;
    }
    // A rejected rest may be anywhere; accepted ones set the scale.
    let largest = |known: &mut dyn Iterator<Item = &(&Rest<'_>, f64)>| known.map(|(_, v)| v.abs()).fold(0.0, f64::max);
    let scale = largest(&mut known.iter().filter(|(rest, _)| rest.segment.accepted));
    let scale = if scale > 0.0 { scale } else { largest(&mut known.iter()) };
    let count = imu.rests.len() as f64;
    let mut plot = Plot::new(Scale::linear(0.4, count + 0.6, 0.0), Scale::linear(-scale, scale, 0.15));
    plot.rule(0.0, "zero", "");
    let step = imu.rests.len().div_ceil(DRAWN).max(1);
    for (rest, value) in known.iter().step_by(step) {
        let class = signal::class(rest);
        let face = if rest.segment.face.is_empty() { "no face" } else { &rest.segment.face };
        plot.dot(rest.number as f64, *value, &class, &format!("rest {} ({face}) {value:+.4} m/s²", rest.number));
    }
    let every = (imu.rests.len() / 8).max(1);
    let names: Vec<_> = (1..=imu.rests.len()).step_by(every).map(|n| (n as f64, n.to_string())).collect();
    Some(plot.figure("", caption, Along::Names(&names)))
}

/// Table of rejected rests with their reasons.
pub(super) fn rejected(imu: &Imu<'_>) -> Option<Markup> {
    let rejected: Vec<_> = imu.rests.iter().filter(|rest| !rest.segment.accepted).collect();
    if rejected.is_empty() {
        return None;
    }
    let row = |rest: &&Rest<'_>| {
        let reason = rest.segment.reason().as_str_name().to_lowercase().replace('_', " ");
        html! {
            tr {
                td.n { (rest.number) } td.n { (moment(rest.from)) } td.n { (length(rest)) }
                td { b { (reason) } " " (rest.segment.explanation) }
            }
        }
    };
    let rows: Vec<_> = rejected.iter().take(LISTED).map(row).collect();
    let head = html! { th.n { "rest" } th.n { "at" } th.n { "length" } th { "why, and what to do" } };
    let content = html! { (table(Some("wide"), Some(head), &rows)) (more(rejected.len(), LISTED)) };
    Some(section("Rejected rests", content))
}

fn length(rest: &Rest<'_>) -> String {
    format!("{:.1} s", rest.until - rest.from)
}

/// Table of spans that were nearly rests.
pub(super) fn near_misses(imu: &Imu<'_>) -> Option<Markup> {
    let misses = &imu.findings.near_misses;
    let advice = misses.advice()?;
    let row = |miss: &NearMiss| {
        let [from, until] = [miss.start, miss.end].map(|stamp| Stamp::from_nanos(stamp).seconds_since(imu.origin));
        html! {
            tr {
                td.n { (moment(from)) } td.n { (format!("{:.0} s", (until - from).max(1.0))) }
                td.n { (format!("{:.1}", miss.lowest)) } td.n { (format!("{:.1}", miss.enter)) }
            }
        }
    };
    let rows: Vec<_> = misses.iter().map(row).collect();
    let head = html! { th.n { "at" } th.n { "for about" } th.n { "noise floors reached" } th.n { "asked" } };
    let content = html! {
        p.dim { "To take them: " (advice) "." }
        (table(None, Some(head), &rows))
        (more(misses.count(), rows.len()))
    };
    Some(section("Nearly rests", content))
}

/// Table of accepted rests, collapsed.
pub(super) fn accepted(imu: &Imu<'_>) -> Option<Markup> {
    let accepted: Vec<_> = imu.rests.iter().filter(|rest| rest.segment.accepted).collect();
    if accepted.is_empty() {
        return None;
    }
    // Numbered among the accepted, so that none seems to be missing.
    let placements: BTreeSet<_> = accepted.iter().map(|rest| rest.segment.placement).collect();
    let placements: BTreeMap<_, usize> = placements.into_iter().zip(1..).collect();
    let row = |rest: &&Rest<'_>| {
        let placement = placements.get(&rest.segment.placement).copied().unwrap_or_default();
        let tilt = rest.segment.tilt_deg.map(|tilt| format!("{tilt:.1}°")).unwrap_or_default();
        let value = |value: Option<f64>, decimals| {
            value.map(|v| format!("{v:+.decimals$}").replace('-', "−")).unwrap_or_default()
        };
        html! {
            tr {
                td.n { (rest.number) } td.n { (moment(rest.from)) } td.n { (length(rest)) }
                td { (rest.segment.face) } td.n { (tilt) } td.n { (placement) }
                td.n { (value(rest.residual.raw, 3)) } td.n { (value(rest.residual.corrected, 4)) }
            }
        }
    };
    let rows: Vec<_> = accepted.iter().take(LISTED).map(row).collect();
    let head = html! {
        th.n { "rest" } th.n { "at" } th.n { "length" } th { "face" } th.n { "tilt" } th.n { "placement" }
        th.n { "‖a‖ − g, m/s²" } th.n { "corrected" }
    };
    Some(html! {
        details {
            summary { "Accepted rests (" (accepted.len()) ")" }
            (table(None, Some(head), &rows))
            (more(accepted.len(), LISTED))
        }
    })
}

/// How many there are beyond those listed.
fn more(count: usize, listed: usize) -> Markup {
    let further = count.saturating_sub(listed);
    html! { @if further > 0 { p.dim { "… and " (further) " more." } } }
}
