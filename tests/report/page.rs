//! The report: one file that needs nothing else, tells what was annotated, and stays small whatever the recording.

use crate::common::Folder;
use crate::common::page::{check, pasted};
use stillpoint::Stamp;
use stillpoint::engine::{Event, Message};
use stillpoint::imu::{Sample, Sensor};
use stillpoint::messages::foxglove::Log;
use stillpoint::messages::segment::Reason;
use stillpoint::messages::triad::{Model, Status};
use stillpoint::messages::{Calibration, Coverage, Face, Header, Segment, Stillness, Triad, TriadMean, Vector3};
use stillpoint::report::{Findings, Page, Timeline};

#[test]
fn a_recording_its_annotated_copy_and_its_sidecar_tell_the_same() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o annotated.mcap").ok();
    folder.say("annotate demo.mcap --sidecar -o sidecar.mcap").ok();
    let page = |input: &str| {
        let output = format!("{input}.html");
        folder.say(&format!("report {input} -o {output}")).ok();
        folder.write("other", b"precious");
        folder.refuses(&format!("report {input} -o other"), 1, &["other: exists"]);
        let html = String::from_utf8(folder.read(&output)).unwrap();
        check(&html);
        html
    };
    let (raw, annotated, sidecar) = (page("demo.mcap"), page("annotated.mcap"), page("sidecar.mcap"));
    assert_eq!(raw, annotated.replace("annotated.mcap", "demo.mcap"));
    for html in [&raw, &sidecar] {
        for word in ["PROVISIONAL", "up once more", "+X", "-Z", "gyroscope", "min_fit_s"] {
            assert!(html.contains(word), "{word}");
        }
    }
    assert!(raw.contains(r#"class="area a0""#) && !sidecar.contains(r#"class="area a0""#));
    assert!(sidecar.contains("A sidecar holds no readings"));
    assert!(raw.len() < 400_000, "{}", raw.len());
}

#[test]
fn what_is_pasted_holds_the_numbers_of_the_export_exactly() {
    let folder = Folder::with_demo();
    folder.say("report demo.mcap -o demo.html").ok();
    let html = String::from_utf8(folder.read("demo.html")).unwrap();
    let exported = folder.say("export demo.mcap --format json").ok().json()["imus"][0].clone();
    let json: serde_json::Value = serde_json::from_str(&pasted(&html, "JSON")).unwrap();
    let yaml: serde_json::Value = serde_saphyr::from_str(&pasted(&html, "YAML")).unwrap();
    assert_eq!(json, yaml);
    assert_eq!((&json["topic"], &json["direction"]), (&exported["topic"], &exported["direction"]));
    for (triad, keys) in [("accelerometer", &["bias", "sensitivity", "status", "model"][..]), ("gyroscope", &["bias"])]
    {
        keys.iter().for_each(|key| assert_eq!(json[triad][key], exported[triad][key], "{triad} {key}"));
    }
    assert_eq!(
        json["gyroscope"]["sensitivity"],
        serde_json::json!([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    );
    // An identity that nothing told is said to be none.
    let said = "not estimated: the identity";
    assert!(json["gyroscope"]["sensitivity_is"].as_str().unwrap().starts_with(said), "{json}");
    assert!(json["accelerometer"]["sensitivity_is"].is_null(), "{json}");
    // Readings as the recording holds them are corrected as `output.corrected` would.
    let numpy = pasted(&html, "numpy");
    let line = |name: &str| numpy.lines().find(|line| line.starts_with(name)).unwrap().to_owned();
    assert!(line("# gyroscope").contains(said) && !line("# accelerometer").contains(said), "{numpy}");
    let bias = json["accelerometer"]["bias"].to_string();
    assert!(numpy.contains(&format!("accelerometer_bias = np.array({bias})")), "{numpy}");
    let Some(python) = crate::common::needs::python() else { return };
    let matrix: Vec<Vec<f64>> = serde_json::from_value(json["accelerometer"]["sensitivity"].clone()).unwrap();
    let matrix = nalgebra::Matrix3::from_iterator(matrix.into_iter().flatten()).transpose();
    let bias: [f64; 3] = serde_json::from_value(json["accelerometer"]["bias"].clone()).unwrap();
    let expected =
        matrix.try_inverse().unwrap() * (nalgebra::Vector3::new(1.0, -2.0, 9.5) - nalgebra::Vector3::from(bias));
    folder.write("pasted.py", format!("{numpy}\nprint(*correct_accelerometer([1.0, -2.0, 9.5]))\n").as_bytes());
    let mut run = std::process::Command::new(python);
    let printed = crate::common::finish(run.arg("pasted.py").current_dir(folder.path())).ok().stdout;
    let printed: Vec<f64> = printed.split_whitespace().map(|number| number.parse().unwrap()).collect();
    assert!((nalgebra::Vector3::from_column_slice(&printed) - expected).norm() < 1e-12, "{printed:?} {expected}");
}

#[test]
fn commands_to_paste_keep_the_settings_that_the_annotations_follow() {
    let folder = Folder::with_demo();
    let imu = r#"imu=[{topic="/imu/data_raw", name="front", preset="mpu9250"}]"#;
    let bounds = "fit.bounds.gyro_bias=[-0.2, 0.3]";
    let sets = ["--set", "fit.gravity=9.81744", "--set", imu, "--set", bounds];
    folder.run([&["annotate", "demo.mcap", "-o", "an notated.mcap"], &sets[..]].concat()).ok();
    folder.run(["report", "an notated.mcap", "-o", "page.html"]).ok();
    let html = String::from_utf8(folder.read("page.html")).unwrap();
    check(&html);
    let commands = pasted(&html, "Commands: a file for Kalibr, and the recording with corrected messages");
    assert!(commands.contains(" --set fit.gravity=9.81744") && !commands.contains("still."), "{commands}");
    let program = crate::common::program();
    let folder_of = std::path::Path::new(&program).parent().unwrap().display().to_string();
    let path = format!("{folder_of}:{}", std::env::var("PATH").unwrap());
    for command in commands.lines() {
        let mut shell = std::process::Command::new("sh");
        crate::common::finish(shell.args(["-c", command]).current_dir(folder.path()).env("PATH", &path)).ok();
    }
    assert!(folder.names().contains(&"imu-kalibr.yaml".to_owned()), "{:?}", folder.names());
    let exported = |name: &str| folder.run(["export", name, "--format", "json"]).ok().json();
    assert_eq!(exported("corrected.mcap"), exported("an notated.mcap"));
}

#[test]
fn commands_that_cannot_work_are_not_offered() {
    let folder = Folder::with_demo();
    let poses = "pose=[{face='-Z', rest_s=3}, {face='-X', rest_s=3}, {face='+Y', rest_s=3}]";
    folder.run(["simulate", "demo", "-o", "some.mcap", "-q", "--set", poses]).ok();
    folder.say("annotate some.mcap -o annotated.mcap").ok();
    folder.say("annotate demo.mcap --sidecar -o sidecar.mcap").ok();
    let commands = |name: &str, what: &str| {
        folder.say(&format!("report {name} -o {name}.html")).ok();
        pasted(&String::from_utf8(folder.read(&format!("{name}.html"))).unwrap(), &format!("Commands: {what}"))
    };
    // The gyroscope is known, the accelerometer is not.
    assert_eq!(
        commands("annotated.mcap", "the recording with corrected messages"),
        "stillpoint annotate annotated.mcap -o corrected.mcap --set output.corrected=final\n"
    );
    // Nor does a note of the accelerometer say how well gravity is known.
    let html = String::from_utf8(folder.read("annotated.mcap.html")).unwrap();
    assert!(html.contains("gravity 9.80665 ± 0.0400 m/s² (standard)"), "{html}");
    // A sidecar holds no messages to correct.
    assert_eq!(
        commands("sidecar.mcap", "a file for Kalibr"),
        "stillpoint export sidecar.mcap --format kalibr -o imu-kalibr.yaml\n"
    );
}

#[test]
fn a_drift_is_shown_with_its_interval_and_nothing_is_minus_zero() {
    let folder = Folder::with_demo();
    folder.say("export demo.mcap --format json -o before.json").ok();
    folder.say("report demo.mcap -o demo.html --against before.json").ok();
    let html = String::from_utf8(folder.read("demo.html")).unwrap();
    check(&html);
    let drift = html.split("Change since the earlier calibration").nth(1).unwrap().split("</table>").next().unwrap();
    assert_eq!(drift.matches("<small>± ").count(), 9, "{drift}");
    assert!(!drift.contains("-0.00000"), "{drift}");
}

#[test]
fn spans_that_were_nearly_rests_are_named() {
    let second = |at: i64| prost_types::Timestamp { seconds: at, nanos: 0 };
    let mut timeline = Timeline::new(Findings::new("/imu", "/imu"));
    for (at, statistic) in [(1, 80.0), (2, 3.6), (3, 4.2), (4, 4.2), (5, 80.0)] {
        let header = Some(Header { stamp: Some(second(at)), frame_id: String::new() });
        let said = Stillness { header, state: 1, statistic, enter: 3.0, leave: 5.0 };
        timeline.note(&Event { log_time: at as u64, message: Message::Stillness(said) });
    }
    let timelines = [timeline];
    let html = Page { recording: "x", timelines: &timelines, notes: &[], settings: "", earlier: None }.html();
    check(&html);
    for word in ["Nearly rests", ">3.6<", "still.enter=4"] {
        assert!(html.contains(word), "{word}");
    }
}

#[test]
fn what_is_annotated_is_read_and_never_fitted_again() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o annotated.mcap").ok();
    let said = folder.say("export annotated.mcap --format json").ok().json();
    // Settings that would leave no rest to fit.
    let report = folder.say("report annotated.mcap --json --set still.min_fit_s=50").ok().json();
    assert_eq!(report["imus"], said["imus"]);
    let fresh = folder.say("report demo.mcap --json --set still.min_fit_s=50").ok().json();
    assert_eq!(fresh["imus"][0]["accelerometer"]["status"], "UNDETERMINED");
}

#[test]
fn settings_that_annotations_do_not_follow_are_said_with_the_command_that_would() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o annotated.mcap --set fit.gravity=9.81744").ok();
    folder.say("annotate demo.mcap --sidecar -o sidecar.mcap").ok();
    folder.write("two.toml", b"[fit]\ngravity = 9.8\n[still]\nmin_rest_s = 0.5\n");
    let said = |line: &str| folder.say(line).ok().stderr;
    for verb in ["export annotated.mcap --format json", "report annotated.mcap", "report annotated.mcap --json"] {
        let warning = "warning: annotated.mcap: the annotations are read as they are, and fit.gravity is not applied; to \
                       calibrate anew: stillpoint annotate annotated.mcap -o anew.mcap --set fit.gravity=9.8\n";
        assert_eq!(said(&format!("{verb} --set fit.gravity=9.8")), warning, "{verb}");
        assert!(said(&format!("{verb} -c two.toml")).contains(
            "fit.gravity, still.min_rest_s are not applied; to calibrate anew: stillpoint annotate annotated.mcap -o anew.mcap -c \
             two.toml\n"
        ));
        // What they follow already, and what is not of the calibration.
        for set in ["fit.gravity=9.81744", "fit.max_error=0.1", "output.corrected=final"] {
            assert_eq!(said(&format!("{verb} --set {set}")), "", "{verb} {set}");
        }
    }
    assert!(
        said("export sidecar.mcap --format json --set fit.gravity=9.8").contains("stillpoint annotate RECORDING --set")
    );
    assert_eq!(said("export sidecar.mcap --format json --set limits.chunk_mib=65"), "");
    assert_eq!(said("export demo.mcap --format json --set fit.gravity=9.8"), "");
    // A merge fits again, to rests that were found before.
    assert_eq!(said("merge annotated.mcap sidecar.mcap --set fit.gravity=9.8"), "");
    let merged = said("merge annotated.mcap sidecar.mcap --set still.min_rest_s=0.5");
    assert!(
        merged.starts_with("warning: annotated.mcap (and 1 more): the annotations are read as they are"),
        "{merged}"
    );
    assert!(said("merge demo.mcap --set still.min_rest_s=0.5").is_empty());
}

#[test]
fn the_terminal_gets_the_summary_the_timeline_and_the_rests() {
    let folder = Folder::with_demo();
    folder.say("export demo.mcap --format json -o before.json").ok();
    let text = folder.say("report demo.mcap --against before.json").ok().stdout;
    for word in ["PROVISIONAL", "█", "accepted rest", "‖a‖ − g", "within the uncertainty", "next"] {
        assert!(text.contains(word), "{word} is not in\n{text}");
    }
    assert!(text.lines().all(|line| console::measure_text_width(line) <= 100), "{text}");
    assert!(!text.contains('\u{1b}'), "colours in a pipe");
    folder.refuses("report nothing.mcap", 1, &["nothing.mcap"]);
}

/// A day of a restless robot: thousands of rests, refits and warnings, and a name that would like to be more.
fn day() -> Timeline {
    const REST: i64 = 20;
    let nanos = |seconds: i64| Stamp::from_nanos((1_700_000_000 + seconds) * 1_000_000_000);
    let header = |at: i64| Some(Header { stamp: Some(nanos(at).into()), frame_id: String::new() });
    let vector = |x: f64| Some(Vector3 { x, y: -x, z: x / 2.0 });
    let faces = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];
    let mut timeline = Timeline::new(Findings::new("/imu<script>alert('x')</script>", "/imu"));
    for tick in 0..86_400 * 5 {
        let stamp = Stamp::from_nanos(nanos(0).nanos() + tick * 200_000_000);
        let value = nalgebra::Vector3::new((tick as f64).sin() * 9.8, (tick as f64 * 0.7).cos() * 9.8, 9.8);
        timeline.sample(Sensor::Accelerometer, &Sample { stamp, log_time: 0, value });
    }
    let mut note = |at: i64, message| timeline.note(&Event { log_time: nanos(at).nanos() as u64, message });
    for second in 0..86_400 {
        let statistic = if second % REST < 10 { 1.0 } else { 900.0 };
        note(
            second,
            Message::Stillness(Stillness { header: header(second), state: 2, statistic, enter: 3.0, leave: 5.0 }),
        );
    }
    for rest in 0..86_400 / REST {
        let at = rest * REST;
        let accepted = rest % 3 != 0;
        let mean = TriadMean {
            sensor: "accelerometer".into(),
            samples: 1000,
            mean: vector(6.0),
            std: vector(0.02),
            ..TriadMean::default()
        };
        note(
            at,
            Message::Segment(Segment {
                header: header(at),
                start: Some(nanos(at).into()),
                end: Some(nanos(at + 9).into()),
                accepted,
                face: faces[(rest % 6) as usize].into(),
                tilt_deg: Some(1.5),
                reason: if accepted { Reason::Accepted } else { Reason::Tilted }.into(),
                explanation: "23.4° from the nearest face, +X: was the sensor lying flat?".into(),
                means: vec![mean],
                ..Segment::default()
            }),
        );
        let triad = Triad {
            sensor: "accelerometer".into(),
            model: Model::BiasScale.into(),
            status: Status::Confirmed.into(),
            bias: vector(0.1),
            bias_std: vector(0.01),
            scale: vector(1.0),
            scale_std: vector(0.001),
            sensitivity: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            ..Triad::default()
        };
        note(
            at,
            Message::Calibration(Box::new(Calibration {
                header: header(at),
                revision: rest as u32,
                accelerometer: Some(triad),
                gravity: 9.80665,
                ..Calibration::default()
            })),
        );
        let text = "rest of 9.0 s rejected (TILTED): was the sensor lying flat?";
        note(at, Message::Log(Log { level: 3, message: text.into(), ..Log::default() }));
    }
    let faces = faces.map(|name| Face { name: name.into(), normal: None, placements: 700, seconds: 6300.0 });
    note(86_399, Message::Coverage(Coverage { faces: faces.to_vec(), complete: true, ..Coverage::default() }));
    timeline
}

#[test]
fn a_day_fits_in_two_megabytes_and_cannot_break_out() {
    let timelines = [day()];
    let page = Page { recording: "a<b>.mcap", timelines: &timelines, notes: &[], settings: "[still]\n", earlier: None };
    let html = page.html();
    check(&html);
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
    assert!(html.contains("… and") && html.contains("24.0 h"));
}

#[test]
fn any_fixture_any_model_and_nothing_at_all_are_shown() {
    let normal = |x: f64, y: f64, z: f64| Some(Vector3 { x, y, z });
    let face = |name: &str, normal| Face { name: name.into(), normal, placements: 1, seconds: 3.0 };
    let faces: Vec<_> =
        (0..12).map(|i| face(&format!("face {i}"), normal(0.6, 0.0, if i % 2 == 0 { 0.8 } else { -0.8 }))).collect();
    let full = Triad {
        sensor: "gyroscope".into(),
        model: Model::CrossAxis.into(),
        status: Status::Provisional.into(),
        bias: normal(0.1, f64::NAN, 0.2),
        sensitivity: vec![1.0, 0.01, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0, 1.0],
        g_sensitivity: vec![1e-5; 9],
        g2_sensitivity: vec![1e-6; 3],
        ..Triad::default()
    };
    let calibration =
        Calibration { gyroscope: Some(full), accelerometer: Some(Triad::default()), ..Calibration::default() };
    let findings = Findings {
        coverage: Some(Coverage { faces, ..Coverage::default() }),
        calibration: Some(calibration),
        ..Findings::new("/imu", "/imu")
    };
    let mut rest = Segment { start: Some(at(5)), end: Some(at(5)), ..Segment::default() };
    rest.means =
        vec![TriadMean { sensor: "accelerometer".into(), mean: normal(f64::NAN, 0.0, 0.0), ..TriadMean::default() }];
    let odd = Findings { rests: [(5_000_000_000, rest)].into(), ..Findings::new("/odd", "/odd") };
    let timelines = [Timeline::new(findings), Timeline::new(Findings::new("/none", "/none")), Timeline::new(odd)];
    let page =
        Page { recording: "x.mcap", timelines: &timelines, notes: &["damaged".into()], settings: "", earlier: None };
    let html = page.html().replace("NaN", "");
    check(&html);
    for word in ["face 11", "S, row x", "g-sensitivity", "g²-sensitivity", "None was published"] {
        assert!(html.contains(word), "{word}");
    }
}

fn at(seconds: i64) -> prost_types::Timestamp {
    prost_types::Timestamp { seconds, nanos: 0 }
}
