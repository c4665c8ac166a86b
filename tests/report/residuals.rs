//! What remains of ‖a‖ − g and ‖ω‖ at rest, and of the turns, on the page.

use crate::common::page::check;
use stillpoint::Stamp;
use stillpoint::messages::triad::Status;
use stillpoint::messages::{Calibration, Segment, Triad, TriadMean, Vector3};
use stillpoint::report::{Findings, Page, Timeline};

const GRAVITY: f64 = 9.8;

/// The page of one rest, during which each of these reads that much more than gravity, and has this bias, if it is known.
fn page(sensors: &[(&str, f64, Option<f64>)]) -> String {
    let along_z = |z: f64| Some(Vector3 { x: 0.0, y: 0.0, z });
    let mean = |&(sensor, excess, _): &(&str, f64, Option<f64>)| TriadMean {
        sensor: sensor.into(),
        mean: along_z(GRAVITY + excess),
        std: along_z(0.01),
        ..TriadMean::default()
    };
    let triad = |&(sensor, _, bias): &(&str, f64, Option<f64>)| Triad {
        sensor: sensor.into(),
        status: if bias.is_some() { Status::Confirmed } else { Status::Undetermined }.into(),
        bias: bias.and_then(along_z),
        ..Triad::default()
    };
    let (primary, secondary) = sensors.split_first().unwrap();
    let calibration = Calibration {
        accelerometer: Some(triad(primary)),
        secondary: secondary.iter().map(triad).collect(),
        gravity: GRAVITY,
        ..Calibration::default()
    };
    let rest = Segment {
        start: Some(Stamp::from_nanos(5_000_000_000).into()),
        end: Some(Stamp::from_nanos(8_000_000_000).into()),
        accepted: true,
        face: "+Z".into(),
        means: sensors.iter().map(mean).collect(),
        ..Segment::default()
    };
    let findings = Findings {
        rests: [(5_000_000_000, rest)].into(),
        calibration: Some(calibration),
        ..Findings::new("/imu", "/imu")
    };
    let timelines = [Timeline::new(findings)];
    let html = Page { recording: "x", timelines: &timelines, notes: &[], settings: "", earlier: None }.html();
    check(&html);
    html
}

/// The captions of the plots of residuals, each with what its only dot says.
fn plots(html: &str) -> Vec<(&str, &str)> {
    let section = html.split("<h3>What remains at rest</h3>").nth(1).unwrap().split("</section>").next().unwrap();
    let between = |text: &'static str, end: &'static str| {
        move |figure| -> &str { str::split(figure, text).nth(1).unwrap().split(end).next().unwrap() }
    };
    let figures: Vec<&str> = section.split("<figure").skip(1).collect();
    let (caption, dot) = (between("<figcaption>", "<"), between("<title>", "<"));
    figures.into_iter().map(|figure| (caption(figure), dot(figure))).collect()
}

#[test]
fn each_accelerometer_shows_what_remains_before_and_after_its_own_correction() {
    let html = page(&[("accelerometer", 0.5, Some(0.5)), ("highg", -2.0, Some(-1.75)), ("third", 0.125, None)]);
    let expected = [
        ("Before: ‖a‖ − g of the mean reading, m/s²", "rest 1 (+Z) +0.5000 m/s²"),
        ("After correction, m/s²", "rest 1 (+Z) +0.0000 m/s²"),
        ("highg, before: ‖a‖ − g of the mean reading, m/s²", "rest 1 (+Z) -2.0000 m/s²"),
        ("highg, after correction, m/s²", "rest 1 (+Z) -0.2500 m/s²"),
        ("third, before: ‖a‖ − g of the mean reading, m/s²", "rest 1 (+Z) +0.1250 m/s²"),
    ];
    assert_eq!(plots(&html), expected);
}

#[test]
fn the_rates_of_a_gyroscope_are_no_residual_of_gravity() {
    let html = page(&[("accelerometer", 0.5, Some(0.5)), ("gyroscope", 0.0, None)]);
    assert_eq!(
        plots(&html)[2..],
        [("Gyroscope, before: ‖ω‖ of the mean reading, rad/s", "rest 1 (+Z) +9.80000 rad/s")]
    );
}

#[test]
fn the_demo_shows_what_its_gyroscope_and_its_turns_leave() {
    let folder = crate::common::Folder::with_demo();
    folder.say("annotate demo.mcap -o a.mcap").ok();
    folder.say("report a.mcap -o a.html").ok();
    let html = String::from_utf8(folder.read("a.html")).unwrap();
    check(&html);
    let rate = |caption: &str| -> f64 {
        let (_, dot) = plots(&html).into_iter().find(|(found, _)| found.starts_with(caption)).unwrap();
        dot.split_whitespace().rev().nth(1).unwrap().parse().unwrap()
    };
    let (before, after) = (rate("Gyroscope, before"), rate("Gyroscope, after"));
    assert!((before - 0.0136).abs() < 0.0005 && after < 0.0005, "{before} {after}");
    let turns = html.split("<h3>What remains of the turns</h3>").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(turns.contains("Gravity missed after each turn, degrees") && turns.contains("turn 1 by "), "{turns}");
}

#[test]
fn a_rest_that_lies_far_off_is_an_arrow_at_the_edge_and_a_near_one_sets_the_scale() {
    let rest = |second: i64, accepted: bool, z: f64| {
        let stamp = Some(prost_types::Timestamp { seconds: second, nanos: 0 });
        let mean = Some(Vector3 { x: 0.0, y: 0.0, z });
        let mean = TriadMean { sensor: "accelerometer".into(), samples: 100, mean, ..TriadMean::default() };
        let segment = Segment { start: stamp, end: stamp, accepted, means: vec![mean], ..Segment::default() };
        (second * 1_000_000_000, segment)
    };
    let arrows = |rejected: f64| {
        let rests = [rest(5, true, 9.80665 + 0.5), rest(9, true, 9.80665 - 0.5), rest(12, false, 9.80665 + rejected)];
        let timelines = [Timeline::new(Findings { rests: rests.into(), ..Findings::new("/imu", "/imu") })];
        let html = Page { recording: "x", timelines: &timelines, notes: &[], settings: "", earlier: None }.html();
        check(&html);
        let section = html.split("<h3>What remains at rest</h3>").nth(1).unwrap().split("</section>").next().unwrap();
        let count = |what: &str| section.matches(what).count();
        [count("class=\"beyond above"), count("class=\"beyond below"), count("class=\"dot ")]
    };
    assert_eq!(arrows(3.0), [1, 0, 2]);
    assert_eq!(arrows(-3.0), [0, 1, 2]);
    assert_eq!(arrows(1.0), [0, 0, 3]);
}
