//! Convergence of the calibration, refit by refit.

use maud::{Markup, html};

use super::elements;
use super::imu::Imu;
use crate::Stamp;
use crate::messages::{Calibration, Triad, Vector3};
use crate::report::nanos;
use crate::report::plot::{Along, Plot, Scale};

/// Most revisions that are drawn; the last one always is.
const DRAWN: usize = 120;

pub(super) fn section(imu: &Imu<'_>) -> Option<Markup> {
    let accelerometer = |found: &'_ Calibration| found.accelerometer.clone();
    let gyroscope = |found: &'_ Calibration| found.gyroscope.clone();
    let drawings = [
        settling(imu, "Accelerometer bias, m/s²", accelerometer, |triad| (triad.bias, triad.bias_std)),
        settling(imu, "Accelerometer scale", accelerometer, |triad| (triad.scale, triad.scale_std)),
        settling(imu, "Gyroscope bias, rad/s", gyroscope, |triad| (triad.bias, triad.bias_std)),
    ];
    if drawings.iter().all(Option::is_none) {
        return None;
    }
    let content = html! {
        p.dim {
            "Each refit less the last one, with its 95 % interval: one that grows surer draws nearer to zero. "
            "The scale's interval holds that of gravity, which no further rest makes smaller."
        }
        @for drawing in drawings.iter().flatten() { (drawing) }
    };
    Some(elements::section("How it settled", content))
}

type Estimate = (Option<Vector3>, Option<Vector3>);

/// Plot of a parameter's revisions minus its last value; `None` with fewer than two.
fn settling(
    imu: &Imu<'_>,
    caption: &str,
    triad: impl Fn(&Calibration) -> Option<Triad>,
    parameter: impl Fn(Triad) -> Estimate,
) -> Option<Markup> {
    let revisions = &imu.timeline.revisions;
    let step = revisions.len().div_ceil(DRAWN).max(1);
    let point = |found: &Calibration| {
        let (Some(value), Some(std)) = parameter(triad(found)?) else { return None };
        let stamp = found.header.as_ref().map(|header| nanos(&header.stamp))?;
        let at = Stamp::from_nanos(stamp).seconds_since(imu.origin);
        Some((at, found.revision, xyz(&value), xyz(&std)))
    };
    let mut points: Vec<_> = revisions.iter().rev().step_by(step).filter_map(point).collect();
    points.reverse();
    let (_, _, last, _) = *points.last().filter(|_| points.len() > 1)?;

    // The first refits may be very uncertain; the later half sets the scale.
    let late = points.iter().skip(points.len() / 2);
    let reach = late.flat_map(|(_, _, value, std)| (0..3).map(|i| (value[i] - last[i]).abs() + 1.96 * std[i]));
    let reach = 1.6 * reach.fold(0.0, f64::max);
    // One drawing per axis: overlapping curves cannot be distinguished.
    let figure = |(axis, name): (usize, &str)| {
        let mut plot = Plot::new(Scale::linear(0.0, imu.seconds, 0.02), Scale::linear(-reach, reach, 0.0));
        plot.rule(0.0, "zero", "");
        let class = format!("a{axis}");
        let line: Vec<_> = points.iter().map(|(at, _, value, _)| (*at, value[axis] - last[axis])).collect();
        plot.line(&line, &format!("thin {class}"));
        for (at, revision, value, std) in &points {
            let (y, half) = (value[axis] - last[axis], 1.96 * std[axis]);
            let title = format!("revision {revision}, {name} {:.5} ± {half:.5}", value[axis]);
            plot.whisker(*at, y - half, y + half, &class, &title);
            plot.dot(*at, y, &format!("small {class}"), &title);
        }
        plot.figure("low", &format!("{caption}: {name}"), Along::Clock)
    };
    Some(html! { div.three { @for axis in ["x", "y", "z"].into_iter().enumerate() { (figure(axis)) } } })
}

fn xyz(v: &Vector3) -> [f64; 3] {
    [v.x, v.y, v.z]
}
