//! Biases over the temperature: what each rest shows of them, and the polynomial through it.

use maud::{Markup, html};
use nalgebra::Vector3;

use super::elements;
use super::imu::{Imu, Known};
use crate::fit::temperature::BiasCourse;
use crate::messages::{Segment, Triad};
use crate::report::plot::{Along, Plot, Scale};
use crate::report::vector;

/// Most rests that are drawn, and number of points of a curve.
const DRAWN: usize = 600;
const CURVE: usize = 60;

/// Section of an IMU whose rests have temperatures.
pub(super) fn section(imu: &Imu<'_>) -> Option<Markup> {
    let calibration = imu.findings.calibration.as_ref()?;
    let triads = [calibration.accelerometer.as_ref(), calibration.gyroscope.as_ref()];
    let drawings: Vec<_> = triads.into_iter().flatten().filter_map(|triad| biases(imu, triad)).collect();
    let content = html! {
        p.dim {
            "One dot a rest: the gyroscope's own mean, and of the accelerometer what its bias would be if gravity were "
            "exact, which only the axis along it tells. The curve is the polynomial with its 95 % interval; the cross is at "
            "the temperature that the published bias is for; an arrow is a rest beyond the scale."
        }
        @for drawing in &drawings { (drawing) }
    };
    (!drawings.is_empty()).then(|| elements::section("Bias over temperature", content))
}

/// A rest with its temperature and the bias that it shows.
struct Point {
    number: usize,
    celsius: f64,
    bias: Vector3<f64>,
    accepted: bool,
}

/// Plots of the biases of one triad, axis by axis; `None` unless they depend on the temperature.
fn biases(imu: &Imu<'_>, triad: &Triad) -> Option<Markup> {
    let known = Known::of(triad)?;
    let course = known.course.as_ref()?;
    let gravity = imu.findings.calibration.as_ref().map_or(9.80665, |found| found.gravity);
    let is_gyroscope = triad.sensor == "gyroscope";
    let point = |rest: &super::imu::Rest<'_>| {
        let celsius = rest.segment.temperature.filter(|celsius| celsius.is_finite())?;
        let bias = if is_gyroscope {
            mean(rest.segment, "gyroscope")?
        } else {
            shown(&known, mean(rest.segment, "accelerometer")?, celsius, gravity)?
        };
        Some(Point { number: rest.number, celsius, bias, accepted: rest.segment.accepted })
    };
    let step = imu.rests.len().div_ceil(DRAWN).max(1);
    let points: Vec<_> = imu.rests.iter().step_by(step).filter_map(point).collect();
    let unit = if is_gyroscope { "rad/s" } else { "m/s²" };
    let name = if is_gyroscope { "Gyroscope" } else { "Accelerometer" };
    let figures = ["x", "y", "z"].into_iter().enumerate().map(|(axis, letter)| {
        let caption = format!("{name} bias {letter}, {unit}, over °C");
        figure(&points, &known.calibration.bias, course, axis, &caption)
    });
    let figures: Vec<_> = figures.collect();
    Some(html! { div.three { @for figure in &figures { (figure) } } })
}

fn figure(points: &[Point], bias: &Vector3<f64>, course: &BiasCourse, axis: usize, caption: &str) -> Markup {
    let [low, high] = course.range;
    let at = |k: usize| low + (high - low) * k as f64 / CURVE as f64;
    let curve: Vec<_> = (0..=CURVE)
        .map(|k| (at(k), bias[axis] + course.change(at(k))[axis], 1.96 * course.change_std(at(k))[axis]))
        .collect();
    let accepted = points.iter().filter(|point| point.accepted).map(|point| point.bias[axis]);
    let values = || curve.iter().flat_map(|(_, y, half)| [y - half, y + half]).chain(accepted.clone());
    let (least, most) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let mut plot = Plot::new(Scale::linear(low, high, 0.04), Scale::linear(least, most, 0.1));
    let class = format!("a{axis}");
    let area: Vec<_> = curve.iter().map(|(x, y, half)| (*x, y - half, y + half)).collect();
    plot.area(&area, &format!("interval {class}"));
    let line: Vec<_> = curve.iter().map(|(x, y, _)| (*x, *y)).collect();
    plot.line(&line, &class);
    for Point { number, celsius, bias, accepted } in points {
        let title = format!("rest {number}: {:.5} at {celsius:.1} °C", bias[axis]);
        let class = if *accepted { format!("small {class}") } else { "small rejected".to_owned() };
        plot.dot(*celsius, bias[axis], &class, &title);
    }
    let half = 0.04 * (most - least);
    let title = format!("published: {:.5} at {:.1} °C", bias[axis], course.reference);
    plot.whisker(course.reference, bias[axis] - half, bias[axis] + half, &class, &title);
    plot.figure("low", caption, Along::Values("°C"))
}

fn mean(segment: &Segment, sensor: &str) -> Option<Vector3<f64>> {
    segment.means.iter().find(|mean| mean.sensor == sensor)?.mean.as_ref().map(vector)
}

/// Bias that a reading of gravity shows, if its direction is that of the corrected reading.
fn shown(known: &Known, measured: Vector3<f64>, celsius: f64, gravity: f64) -> Option<Vector3<f64>> {
    let up = known.correct(&measured, Some(celsius)).try_normalize(1e-9)?;
    Some(measured - known.calibration.sensitivity * up * gravity)
}
