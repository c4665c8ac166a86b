//! The rests one by one: reasons of rejection, spans that were nearly rests, and a table of all.

use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};

use super::elements::{more, section, table};
use super::imu::{Imu, Rest};
use crate::Stamp;
use crate::report::NearMiss;
use crate::report::plot::moment;

/// Most rests that are listed.
const LISTED: usize = 200;

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
                td {
                    b { (reason) } " " (rest.segment.explanation)
                    @if imu.findings.is_used_in_part(rest.segment) { " (used for what is known in part)" }
                }
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
                td.n { (format!("{:.1}", miss.lowest)) }
                td { (imu.findings.face_of(miss).unwrap_or_default()) } td { (imu.findings.sensor_of(miss).unwrap_or_default()) }
            }
        }
    };
    let rows: Vec<_> = misses.iter().map(row).collect();
    let asked = misses.iter().map(|miss| miss.enter).fold(f64::INFINITY, f64::min);
    let head = html! { th.n { "at" } th.n { "for" } th.n { "quietest" } th { "face up" } th { "louder" } };
    let content = html! {
        p.dim {
            "Quietest is in noise floors, of which " (format!("{asked:.1}")) " are asked; louder is the sensor that kept it from being a "
            "rest. To take them: " (advice) "."
        }
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
        let value = |value: Option<f64>, decimals| value.map(|v| format!("{v:+.decimals$}")).unwrap_or_default();
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
