//! Plots of the readings over time, and of the statistic that decides on rest.

use maud::{Markup, html};

use super::elements::{axes, section, table};
use super::imu::{Imu, Rest};
use crate::Stamp;
use crate::messages::Vector3;
use crate::report::plot::{Along, Plot, Scale, moment};
use crate::report::{Envelope, Range};

/// Most bands that are drawn; neighbours of one kind that touch on the screen are merged.
const BANDS: usize = 2000;

/// The acceleration with the rests behind it; the means of the rests if there are no readings.
pub(super) fn acceleration(imu: &Imu<'_>) -> Option<Markup> {
    let outline = &imu.timeline.acceleration;
    let means = imu.rests.iter().filter_map(|rest| Some((rest, mean(rest)?)));
    let values = means.clone().flat_map(|(_, mean)| mean);
    let range = outline.range().or_else(|| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        (low <= high).then_some(Range { low, high })
    })?;
    let mut plot = Plot::new(Scale::linear(0.0, imu.seconds, 0.0), Scale::linear(range.low, range.high, 0.06));
    bands(imu, &mut plot);
    trace(imu, outline, &mut plot);
    if outline.span().is_none() {
        for (rest, mean) in means {
            (0..3).for_each(|axis| {
                plot.line(&[(rest.from, mean[axis]), (rest.until, mean[axis])], &format!("thick a{axis}"))
            });
        }
    }
    let content = html! {
        p.legend {
            @for (axis, name) in ["x", "y", "z"].iter().enumerate() { span class={ "key a" (axis) } { (name) } }
            span.key.shade { "accepted rest" }
            span.key.rejected { "rejected rest" }
        }
        (plot.figure("tall", "Acceleration as recorded, m/s²", Along::Clock))
        @if outline.span().is_none() {
            p.dim { "A sidecar holds no readings: drawn are the means of the rests." }
        }
        @for figure in others(imu) { (figure) }
    };
    Some(section("What the sensor read", content))
}

/// The gyroscope and the secondary accelerometers.
fn others(imu: &Imu<'_>) -> Vec<Markup> {
    let secondary =
        imu.findings.calibration.iter().flat_map(|found| &found.secondary).map(|triad| triad.sensor.as_str());
    let names = secondary.chain(std::iter::repeat("secondary accelerometer"));
    let named = imu.timeline.secondary.iter().zip(names).map(|(outline, name)| (outline, format!("{name}, m/s²")));
    let all = std::iter::once((&imu.timeline.rate, "Rotation as recorded, rad/s".to_owned())).chain(named);
    let figure = |(outline, caption): (&Envelope<3>, String)| {
        let Range { low, high } = outline.range()?;
        let mut plot = Plot::new(Scale::linear(0.0, imu.seconds, 0.0), Scale::linear(low, high, 0.06));
        bands_plain(imu, &mut plot);
        trace(imu, outline, &mut plot);
        Some(plot.figure("low", &caption, Along::Clock))
    };
    all.filter_map(figure).collect()
}

/// The three axes of an outline.
fn trace(imu: &Imu<'_>, outline: &Envelope<3>, plot: &mut Plot) {
    for axis in 0..3 {
        for run in outline.runs() {
            let at = |stamp: Stamp| stamp.seconds_since(imu.origin);
            let points: Vec<_> =
                run.iter().map(|(stamp, ranges)| (at(*stamp), ranges[axis].low, ranges[axis].high)).collect();
            plot.area(&points, &format!("a{axis}"));
        }
    }
}

/// The rests as bands, each with the name of its face if there is room.
fn bands(imu: &Imu<'_>, plot: &mut Plot) {
    let mut drawn = Vec::<(f64, f64, String, &Rest<'_>, usize)>::new();
    for rest in &imu.rests {
        let class = class(rest);
        match drawn.last_mut() {
            Some((_, until, last, _, count)) if *last == class && plot.extent(*until, rest.from).1 < 5e-4 => {
                *until = rest.until;
                *count += 1;
            }
            _ => drawn.push((rest.from, rest.until, class, rest, 1)),
        }
    }
    let step = drawn.len().div_ceil(BANDS).max(1);
    let mut free_from = 0.0;
    for (from, until, class, rest, count) in drawn.iter().step_by(step) {
        plot.band(*from, *until, &format!("band {class}"), &title(rest, *count));
        let (left, width) = plot.extent(*from, *until);
        let middle = left + width / 2.0;
        let name = &rest.segment.face;
        // About the width of two letters on a phone.
        if rest.segment.accepted && !name.is_empty() && middle > free_from {
            plot.tag(middle, class, name);
            free_from = middle + 0.025 * (1 + name.chars().count()) as f64;
        }
    }
}

fn title(rest: &Rest<'_>, count: usize) -> String {
    let span = format!("{} to {} ({:.1} s)", moment(rest.from), moment(rest.until), rest.until - rest.from);
    let what = match (rest.segment.accepted, count) {
        (true, 1) => format!("rest {} on {}", rest.number, rest.segment.face),
        (false, 1) => format!("rest {} rejected: {}", rest.number, rest.segment.explanation),
        _ => format!("{count} rests from {} on", rest.number),
    };
    format!("{what}, {span}")
}

/// Colour class of a rest.
pub(super) fn class(rest: &Rest<'_>) -> String {
    match rest.face.filter(|_| rest.segment.accepted) {
        Some(face) => format!("f{}", face % 12),
        None if rest.segment.accepted => "f".to_owned(),
        None => "rejected".to_owned(),
    }
}

fn mean(rest: &Rest<'_>) -> Option<[f64; 3]> {
    let mean = rest.segment.means.iter().find(|mean| mean.sensor == "accelerometer")?.mean.as_ref()?;
    Some([mean.x, mean.y, mean.z])
}

/// The statistic with its thresholds, and the noise at rest.
pub(super) fn statistic(imu: &Imu<'_>) -> Option<Markup> {
    let outline = &imu.timeline.statistic;
    // Thresholds from a recording may hold any value.
    let thresholds = imu.timeline.thresholds.filter(|both| both.iter().all(|&one| one.is_finite() && one > 0.0));
    let (Some(range), Some([enter, leave])) = (outline.range(), thresholds) else {
        return noise(imu).map(|noise| section("Noise at rest", noise));
    };
    let mut plot = Plot::new(
        Scale::linear(0.0, imu.seconds, 0.0),
        Scale::decades(range.low.max(0.1).min(enter), range.high.min(1e4).max(leave * 2.0)),
    );
    bands_plain(imu, &mut plot);
    for run in outline.runs() {
        let at = |stamp: Stamp| stamp.seconds_since(imu.origin);
        let points: Vec<_> = run.iter().map(|(stamp, [range])| (at(*stamp), range.low, range.high)).collect();
        plot.area(&points, "statistic");
        plot.line(&points.iter().map(|&(x, _, high)| (x, high)).collect::<Vec<_>>(), "statistic");
    }
    plot.rule(leave, "leave", "moving above");
    plot.rule(enter, "enter", "still below");
    let content = html! {
        (plot.figure("", "Deviation over the learned noise floor", Along::Clock))
        @if !imu.timeline.was_judged {
            p.dim { "No credible noise floor was learned: the sensor was never seen still." }
        }
        @if let Some(noise) = noise(imu) { (noise) }
    };
    Some(section("How rest was told from motion", content))
}

fn bands_plain(imu: &Imu<'_>, plot: &mut Plot) {
    let step = imu.rests.len().div_ceil(BANDS).max(1);
    for rest in imu.rests.iter().step_by(step) {
        let class = if rest.segment.accepted { "band plain" } else { "band rejected" };
        plot.band(rest.from, rest.until, class, &title(rest, 1));
    }
}

/// Table of the median standard deviation of one sample during the rests, sensor by sensor; `None` without any.
fn noise(imu: &Imu<'_>) -> Option<Markup> {
    let rows: Vec<_> = imu.sensors().into_iter().map(|sensor| noise_of(imu, sensor)).collect();
    let shares: Vec<_> = imu.sensors().into_iter().map(|sensor| uncorrelated(imu, sensor)).collect();
    let content = || {
        html! {
            p.dim { "Noise of one sample at rest: median standard deviation over the rests" }
            (table(None, Some(axes()), &rows))
            p.dim { "Of uncorrelated samples, this share would say as much: " (shares.join(", ")) "." }
        }
    };
    (!rows.is_empty()).then(content)
}

fn noise_of(imu: &Imu<'_>, sensor: &str) -> Markup {
    let means = || imu.rests.iter().flat_map(|rest| &rest.segment.means).filter(|mean| mean.sensor == sensor);
    let median = |axis: fn(&Vector3) -> f64| {
        let mut values: Vec<_> = means().filter_map(|mean| mean.std.as_ref().map(axis)).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).map(|std| format!("{std:.5}")).unwrap_or_default()
    };
    let unit = if sensor == "gyroscope" { "rad/s" } else { "m/s²" };
    html! {
        tr {
            th { (sensor) " " small { (unit) } }
            @for std in [median(|v| v.x), median(|v| v.y), median(|v| v.z)] { td.n { (std) } }
        }
    }
}

/// Share of a sensor's samples at rest that uncorrelated ones would need, to say as much.
fn uncorrelated(imu: &Imu<'_>, sensor: &str) -> String {
    let means = imu.rests.iter().flat_map(|rest| &rest.segment.means).filter(|mean| mean.sensor == sensor);
    let (effective, samples) = means.fold((0.0, 0), |(e, n), mean| (e + mean.effective_samples, n + mean.samples));
    let share = (100.0 * effective / samples.max(1) as f64).min(100.0);
    format!("{sensor} {share:.0} %")
}
