//! The verdict, the next step, and the most important numbers.

use maud::{Markup, html};

use super::elements::{breakable, sentence};
use super::imu::Imu;
use crate::messages::Triad;
use crate::report::{Findings, model};

pub(super) fn section(imu: &Imu<'_>) -> Markup {
    let Findings { name, topic, .. } = imu.findings;
    let next = imu.findings.next_step();
    let (class, label) = if imu.findings.is_done() { ("next done", "✓") } else { ("next", "Next") };
    let why = imu.findings.reason().filter(|why| *why != next);
    html! {
        h2 {
            (breakable(name))
            @if topic != name { " " small { (breakable(topic)) } }
        }
        p.badges { @for triad in imu.findings.triads() { (badge(triad)) " " } }
        p class=(class) { b { (label) } " " (sentence(&next)) }
        @if let Some(why) = why {
            p.why { "No accelerometer calibration: " (why.trim_end_matches('.')) "." }
        }
        div.tiles { (tiles(imu)) }
    }
}

fn badge(triad: &Triad) -> Markup {
    let status = triad.status().as_str_name();
    html! {
        span class={ "badge " (status.to_lowercase()) } {
            (triad.sensor) b { (status) }
            @if let Some(model) = model(triad.model()) { " " (model) }
        }
    }
}

fn tiles(imu: &Imu<'_>) -> Markup {
    let (found, accepted) = (imu.rests.len(), imu.findings.accepted());
    html! {
        (tile("Rests", html! { (accepted) " " small { "of " (found) " accepted" } }))
        @if let Some(coverage) = &imu.findings.coverage {
            @let seen = coverage.faces.iter().filter(|face| face.placements > 0).count();
            @let between = imu.findings.between_faces();
            (tile("Faces", html! { (seen) " " small {
                "of " (coverage.faces.len()) " seen" @if between > 0 { ", " (between) " placements between" }
            } }))
        }
        @if let Some([before, after]) = imu.findings.residuals() {
            @let change = format!("{before:.3} → {after:.4} ");
            (tile("Observed: ‖a‖ − g at rest, before → after", html! { (change) small { "m/s²" } }))
        }
        @if let Some(worst) = imu.accelerometer().and_then(|triad| triad.worst_case_error) {
            @let name = "Not excluded by these poses: an error of a corrected reading";
            (tile(name, html! { (format!("{worst:.3} ")) small { "m/s² (95 %)" } }))
        }
    }
}

fn tile(name: &str, value: Markup) -> Markup {
    html! { div.tile { span { (name) } strong { (value) } } }
}
