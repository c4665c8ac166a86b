//! What pages and terminals show so that it can be read: names that cover nothing, signs written in one way, and the same story
//! everywhere of rests that nearly were, or that count in part.

use stillpoint::engine::{Event, Message};
use stillpoint::messages::{Header, Stillness};
use stillpoint::report::{Findings, Page, Timeline};

use crate::common::Folder;
use crate::common::page::check;

/// A timeline in which +Y is nearly at rest for two seconds, with this deviation of the gyroscope, between rests in which it is
/// 0.01; its readings stand before or behind its states.
fn nearly_at_rest(rate: f64, readings_first: bool) -> Timeline {
    use stillpoint::imu::{Sample, Sensor};
    use stillpoint::messages::{Coverage, Face, Segment, TriadMean, Vector3};
    let vector = |x, y, z| Some(Vector3 { x, y, z });
    let stamp = |at: i64| prost_types::Timestamp { seconds: at / 1000, nanos: (at % 1000 * 1_000_000) as i32 };
    let face = |name: &str, normal| Face { name: name.into(), normal, ..Face::default() };
    let faces = vec![face("+X", vector(1.0, 0.0, 0.0)), face("+Y", vector(0.0, 1.0, 0.0))];
    let mean = |sensor: &str, std: f64| TriadMean {
        sensor: sensor.into(),
        std: vector(std, 0.0, 0.0),
        ..TriadMean::default()
    };
    let means = vec![mean("accelerometer", 0.01), mean("gyroscope", 0.01)];
    let rest = Segment { start: Some(stamp(1)), end: Some(stamp(500)), means, ..Segment::default() };
    let said = |message| Event { log_time: 0, message };
    let mut timeline = Timeline::new(Findings::new("/imu", "/imu"));
    let read = |timeline: &mut Timeline| {
        for at in (0..6000).step_by(10) {
            let sign = if at % 20 == 0 { 1.0 } else { -1.0 };
            let (off, turn) = if (1800..4200).contains(&at) { (0.02, rate) } else { (3.0, 1.0) };
            for (sensor, value) in
                [(Sensor::Gyroscope, [sign * turn, 0.0, 0.0]), (Sensor::Accelerometer, [sign * off, 9.8, 0.3])]
            {
                let stamp = stillpoint::Stamp::from_nanos(at * 1_000_000);
                timeline.sample(sensor, &Sample { stamp, log_time: 0, value: value.into() });
            }
        }
    };
    if readings_first {
        read(&mut timeline);
    }
    timeline.note(&said(Message::Coverage(Coverage { faces, ..Coverage::default() })));
    timeline.note(&said(Message::Segment(rest)));
    for (at, statistic) in [(1000, 80.0), (2000, 3.6), (3000, 4.2), (4000, 4.2), (5000, 80.0)] {
        let header = Some(Header { stamp: Some(stamp(at)), frame_id: String::new() });
        timeline.note(&said(Message::Stillness(Stillness { header, state: 1, statistic, enter: 3.0, leave: 5.0 })));
    }
    if !readings_first {
        read(&mut timeline);
    }
    timeline
}

#[test]
fn a_span_that_was_nearly_a_rest_has_its_face_and_the_sensor_that_was_louder() {
    for (rate, louder) in [(0.038, "gyroscope"), (0.011, "accelerometer")] {
        for readings_first in [true, false] {
            let timelines = [nearly_at_rest(rate, readings_first)];
            let html = Page { recording: "x", timelines: &timelines, notes: &[], settings: "", earlier: None }.html();
            check(&html);
            let row = html.split("Nearly rests").nth(1).unwrap().split("</table>").next().unwrap();
            assert!(row.contains(&format!("<td>+Y</td><td>{louder}</td>")), "{row}");
        }
    }
}

/// Numbers of an attribute of SVG elements of a class or name.
fn places(svg: &str, element: &str, keys: [&str; 2]) -> Vec<(f64, f64)> {
    let value = |tag: &str, key: &str| {
        let (_, rest) = tag.split_once(&format!(" {key}=\"")).unwrap_or_else(|| panic!("no {key} in {tag}"));
        rest.split('"').next().unwrap().parse::<f64>().unwrap()
    };
    let tags = svg.split('<').filter(|tag| tag.starts_with(element));
    tags.map(|tag| (value(tag, keys[0]), value(tag, keys[1]))).collect()
}

#[test]
fn no_name_on_the_maps_of_directions_covers_a_dot() {
    let folder = Folder::with_demo();
    // Poses all around, some of them where names like to stand.
    let pose = |up: [f64; 3]| format!("{{up=[{}, {}, {}], rest_s=2}}", up[0], up[1], up[2]);
    let around = (0..24).map(|i| {
        let (azimuth, height) = (f64::from(i) * 2.4, 0.95 - f64::from(i) * 0.08);
        let flat = (1.0 - height * height).max(0.0).sqrt();
        pose([flat * azimuth.cos(), flat * azimuth.sin(), height])
    });
    let below = [[0.0, -0.75, 0.66], [0.0, 0.75, 0.66], [0.0, -0.2, 0.98], [0.3, 0.0, 0.95]].map(pose);
    let poses = format!("pose=[{}]", around.chain(below).collect::<Vec<_>>().join(", "));
    folder.run(["simulate", "demo", "-o", "around.mcap", "-q", "--set", &poses]).ok();
    for name in ["demo.mcap", "around.mcap"] {
        folder.say(&format!("report {name} -o page.html --force")).ok();
        let html = String::from_utf8(folder.read("page.html")).unwrap();
        let maps: Vec<_> =
            html.split("<figure class=\"map\">").skip(1).map(|map| map.split("</svg>").next().unwrap()).collect();
        assert_eq!(maps.len(), 2);
        let mut dots = 0;
        for map in maps {
            let spots = places(map, "circle class=\"spot", ["cx", "cy"]);
            dots += spots.len();
            for (x, y) in places(map, "text", ["x", "y"]) {
                // A name stands on its line, and is about as high and twice as wide as a dot and its own letters.
                let covered = spots.iter().filter(|(cx, cy)| (cx - x).abs() < 16.0 && (cy - (y - 7.0)).abs() < 10.0);
                assert_eq!(covered.count(), 0, "{name}: a name at {x}, {y}");
                assert!(x.abs() <= 136.0 && y.abs() <= 146.0, "{name}: a name at {x}, {y} is cut");
            }
        }
        assert!(dots > 8, "{dots}");
    }
}

#[test]
fn a_sign_is_written_in_one_way_wherever_people_read() {
    let folder = Folder::with_demo();
    // Gravity in part, a flipped axis, and what the page and the terminal say of them.
    let one = "pose=[{face='-Z', rest_s=3}, {face='-Z', tilt_deg=20, rest_s=3}, {face='-X', rest_s=3}]";
    folder.run(["simulate", "demo", "-o", "one.mcap", "-q", "--set", one]).ok();
    for name in ["demo", "one"] {
        let run = folder.say(&format!("annotate {name}.mcap -o {name}.annotated.mcap")).ok();
        folder.say(&format!("report {name}.annotated.mcap -o {name}.html")).ok();
        let html = String::from_utf8(folder.read(&format!("{name}.html"))).unwrap();
        let text = folder.say(&format!("report {name}.annotated.mcap")).ok().stdout;
        assert!(html.contains("-Z") && run.stderr.contains("-Z"), "{name}");
        for said in [&run.stderr, &html, &text] {
            // Before a number or a letter it would be a sign; with a blank behind it, it subtracts.
            let signs = said.match_indices('−').filter(|(at, sign)| !said[at + sign.len()..].starts_with(' '));
            assert_eq!(signs.count(), 0, "{name}: {said}");
        }
    }
}

#[test]
fn rests_that_tell_in_part_are_said_to_do_so_where_they_are_rejected() {
    let folder = Folder::with_demo();
    let poses = "pose=[{face='+Z', rest_s=3}, {face='+Z', tilt_deg=25, rest_s=3}, {face='+X', tilt_deg=25, rest_s=3}]";
    folder.run(["simulate", "demo", "-o", "tilted.mcap", "-q", "--set", poses]).ok();
    let run = folder.say("annotate tilted.mcap").ok();
    let said = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("in part bias z + 9.807 · scale z = "), "{said}");
    assert!(said.contains("1 accepted, 2 rejected, 2 of them used for what is known in part"), "{said}");
    assert_eq!(said.matches("(used for what is known in part)").count(), 2, "{said}");
    folder.say("report tilted.annotated.mcap -o page.html").ok();
    let html = String::from_utf8(folder.read("page.html")).unwrap();
    check(&html);
    assert_eq!(html.matches("(used for what is known in part)").count(), 2);
    // Where all is known, nothing is known in part.
    folder.run(["simulate", "demo", "-o", "whole.mcap", "-q"]).ok();
    assert!(!folder.say("annotate whole.mcap").ok().stderr.contains("in part"));
}
