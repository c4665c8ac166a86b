//! Names in a recording that would like to be markup: they change no element of the page and steer nothing.

use crate::common::page::{check, pasted};
use stillpoint::Stamp;
use stillpoint::engine::{Event, Message};
use stillpoint::messages::foxglove::Log;
use stillpoint::messages::segment::Reason;
use stillpoint::messages::triad::{Model, Status};
use stillpoint::messages::{Calibration, Coverage, Face, Header, Segment, Stillness, Triad, TriadMean, Vector3};
use stillpoint::report::{Findings, Page, Timeline};

/// Ends every element that text stands in, opens others, ends an attribute, and holds what is not seen.
const HOSTILE: &str = "/a_b</title></style></pre></svg><script>alert('x')</script><img/onerror='y'>\" onload=\"z\" \
                       ]]> --> &lt;&amp;\u{0}\u{1b}[2J\u{7}\u{9b}\u{202e}\u{2028}\r\n\t";

/// A name of the same length that is none of this.
fn harmless() -> String {
    HOSTILE.chars().map(|c| if c.is_ascii_alphanumeric() || "/_".contains(c) { c } else { 'a' }).collect()
}

/// A timeline that fills every section of a page, with this for every text that comes from a recording.
fn timeline(name: &str) -> Timeline {
    let text = || name.to_owned();
    let header =
        |second: i64| Some(Header { stamp: Some(Stamp::from_nanos(second * 1_000_000_000).into()), frame_id: text() });
    let vector = |x: f64| Some(Vector3 { x, y: 0.0, z: 0.1 });
    let mut timeline = Timeline::new(Findings { source_type: text(), ..Findings::new(name, &format!("{name}{name}")) });
    let mut note = |second: i64, message| timeline.note(&Event { log_time: second as u64 * 1_000_000_000, message });
    for (second, statistic) in [(1, 80.0), (2, 3.6), (3, 80.0)] {
        let said = Stillness { header: header(second), state: 1, statistic, enter: 3.0, leave: 5.0 };
        note(second, Message::Stillness(said));
    }
    let mean =
        |sensor: String| TriadMean { sensor, samples: 9, mean: vector(9.0), std: vector(0.1), ..TriadMean::default() };
    for (second, accepted, reason) in [(4, true, Reason::Accepted), (8, false, Reason::Tilted)] {
        let stamp = |second: i64| Some(Stamp::from_nanos(second * 1_000_000_000).into());
        let rest = Segment {
            header: header(second),
            start: stamp(second),
            end: stamp(second + 2),
            accepted,
            reason: reason.into(),
            face: text(),
            explanation: text(),
            tilt_deg: Some(1.0),
            means: vec![mean("accelerometer".into()), mean(text())],
            ..Segment::default()
        };
        note(second, Message::Segment(rest));
    }
    let triad = |sensor: String, bias: f64| Triad {
        sensor,
        model: Model::BiasScale.into(),
        status: Status::Confirmed.into(),
        bias: vector(bias),
        bias_std: vector(0.01),
        scale: vector(1.0),
        scale_std: vector(0.01),
        sensitivity: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        notes: vec![text()],
        ..Triad::default()
    };
    for (second, bias) in [(6, 0.1), (7, 0.2)] {
        let found = Calibration {
            header: header(second),
            accelerometer: Some(triad("accelerometer".into(), bias)),
            gyroscope: Some(triad(format!("{name}2"), bias)),
            secondary: vec![triad(text(), bias)],
            gravity: 9.8,
            gravity_source: text(),
            ..Calibration::default()
        };
        note(second, Message::Calibration(Box::new(found)));
    }
    let faces = vec![Face { name: text(), normal: vector(1.0), placements: 1, seconds: 2.0 }];
    note(9, Message::Coverage(Coverage { faces, next_step: text(), ..Coverage::default() }));
    note(9, Message::Log(Log { level: 3, message: text(), name: text(), ..Log::default() }));
    timeline
}

/// The page of a recording whose every text is this.
fn page(name: &str, is_known: bool) -> String {
    let timelines = [timeline(name)];
    let known = timelines[0].findings.clone();
    // Of two strangers none is the IMU, and the page says so.
    let strangers = vec![Findings::new("/a", "/a"), Findings::new("/b", "/b")];
    let earlier = if is_known { vec![known] } else { strangers };
    let notes = [name.to_owned()];
    Page { recording: name, timelines: &timelines, notes: &notes, settings: name, earlier: Some(&earlier) }.html()
}

/// The tags in their order, without the values of their attributes.
fn tags(html: &str) -> Vec<String> {
    let tags = html.split('<').skip(1).map(|part| part.split('>').next().unwrap());
    tags.map(|tag| tag.split('"').step_by(2).collect()).collect()
}

#[test]
fn no_name_in_a_recording_changes_an_element_of_its_page() {
    for is_known in [true, false] {
        let html = page(HOSTILE, is_known);
        check(&html);
        assert_eq!(tags(&html), tags(&page(&harmless(), is_known)));
        // Heading, badges, faces, rests, plots, notes, log, settings and what is to be pasted.
        let escaped = html.matches("&lt;script&gt;alert('x')&lt;/script&gt;").count();
        assert!(escaped >= 25, "{escaped}");
        for section in
            ["Faces", "Calibration", "To paste", "What remains", "How it settled", "Rejected", "Nearly", "Log"]
        {
            assert!(html.contains(section), "{section}");
        }
    }
}

#[test]
fn no_character_that_is_not_seen_reaches_the_page() {
    let html = page(HOSTILE, true);
    let hidden = |c: char| c != '\n' && c.is_control() || "\u{202e}\u{2028}".contains(c);
    assert_eq!(html.chars().find(|&c| hidden(c)), None);
    assert!(html.contains("\\u{1b}[2J"));
}

#[test]
fn what_is_pasted_reads_back_as_the_name_that_it_was() {
    let html = page(HOSTILE, true);
    let json: serde_json::Value = serde_json::from_str(&pasted(&html, "JSON")).unwrap();
    let yaml: serde_json::Value = serde_saphyr::from_str(&pasted(&html, "YAML")).unwrap();
    assert_eq!(json["topic"], format!("{HOSTILE}{HOSTILE}"));
    assert_eq!(json[HOSTILE]["bias"][0], 0.2);
    assert_eq!(json, yaml);
}
