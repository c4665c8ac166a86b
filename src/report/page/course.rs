//! Parameters over many recordings, with the changes between them.

use maud::{Markup, html};

use super::elements::{notes, section, table};
use super::imu::Imu;
use crate::Stamp;
use crate::report::calendar::day;
use crate::report::plot::{Along, Plot, Scale};
use crate::report::{Curve, Jump};

/// Most recordings that are drawn; the last one always is.
const DRAWN: usize = 300;
/// Most changes that are drawn and listed.
const JUMPS: usize = 200;
/// Dates along x.
const DATES: usize = 3;

/// Parameters over time; `None` on the page of a single recording.
pub(super) fn course(imu: &Imu<'_>) -> Option<Markup> {
    let course = imu.timeline.course.as_ref()?;
    let jumps = course.jumps.get(..JUMPS).unwrap_or(&course.jumps);
    let row = |jump: &Jump| {
        let (from, until) = (day(jump.after), day(jump.before));
        html! { tr { td { (from) @if from != until { " to " (until) } } td { (jump.what) } } }
    };
    let rows: Vec<_> = jumps.iter().map(row).collect();
    let content = html! {
        @if let Some(notes) = notes(&course.notes) { (notes) }
        @if !rows.is_empty() {
            (table(Some("wide"), Some(html! { th { "between" } th { "change" } }), &rows))
        }
        p.dim { "One dot a recording, with its 95 % interval; a shaded span holds a change." }
        @for curve in &course.curves { @if let Some(figures) = figures(curve, jumps) { (figures) } }
    };
    Some(section("Over the recordings", content))
}

/// A drawing for each axis; `None` of fewer than two recordings.
fn figures(curve: &Curve, jumps: &[Jump]) -> Option<Markup> {
    let (first, last) = (curve.points.first()?.0, curve.points.last()?.0);
    let span = last.seconds_since(first);
    if span <= 0.0 {
        return None;
    }
    let step = curve.points.len().div_ceil(DRAWN).max(1);
    let mut points: Vec<_> = curve.points.iter().rev().step_by(step).collect();
    points.reverse();
    let at = |stamp: Stamp| stamp.seconds_since(first);
    let dates = (0..DATES).map(|i| span * i as f64 / (DATES - 1) as f64);
    let names: Vec<_> = dates.map(|x| (x, day(first.plus_nanos((x * 1e9) as i64)))).collect();
    let figure = |(axis, name): (usize, &str)| {
        let ends = points.iter().flat_map(|(_, value, std)| [-1.96, 1.96].map(|k| value[axis] + k * std[axis]));
        let (low, high) = ends
            .filter(|end| end.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), end| (low.min(end), high.max(end)));
        if low > high {
            return html! {};
        }
        let mut plot = Plot::new(Scale::linear(0.0, span, 0.12), Scale::linear(low, high, 0.06));
        for jump in jumps {
            plot.band(at(jump.after), at(jump.before), "band jump", &jump.what);
        }
        for (stamp, value, std) in &points {
            let (class, half) = (format!("a{axis}"), 1.96 * std[axis]);
            let title = format!("{}: {name} {:.5} ± {half:.5}", day(*stamp), value[axis]);
            plot.whisker(at(*stamp), value[axis] - half, value[axis] + half, &class, &title);
            plot.dot(at(*stamp), value[axis], &format!("small {class}"), &title);
        }
        plot.figure("low", &format!("{}: {name}", curve.caption), Along::Names(&names, "date"))
    };
    Some(html! { div.three { @for axis in ["x", "y", "z"].into_iter().enumerate() { (figure(axis)) } } })
}
