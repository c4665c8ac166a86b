//! What a reader is told once, and what with: merged recordings whose numbers stay the same, spans that were nearly rests.

use nalgebra::Vector3;

use crate::common::Folder;
use crate::real_recordings::{MAPPED, START, both, recording, six_faces};
use crate::session::GYRO_BIAS;

#[test]
fn a_merge_counts_what_reads_alike_and_prints_it_once() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -q").ok();
    for seed in 2..6 {
        folder.say(&format!("simulate demo -o {seed}.mcap -q --set recording.seed={seed}")).ok();
    }
    for inputs in ["demo.annotated.mcap", "demo.annotated.mcap 2.mcap 3.mcap 4.mcap 5.mcap"] {
        let text = folder.say(&format!("merge {inputs}")).ok().stdout;
        assert!(text.lines().count() < 40, "{} lines for {inputs}: {text}", text.lines().count());
        assert!(text.lines().all(|line| console::measure_text_width(line) <= 100), "{text}");
        // Of what is told over time, no two lines differ by the days alone.
        let (_, course) = text.split_once("over time").unwrap_or_default();
        let numbers: Vec<_> =
            course.lines().filter_map(|line| line.split_once("×  ")).map(|(_, numbers)| numbers).collect();
        assert!(numbers.windows(2).all(|pair| pair[0] != pair[1]), "{text}");
    }
}

#[test]
fn a_span_that_was_nearly_a_rest_is_named_with_its_face_and_the_louder_sensor() {
    // While +Y is up, the gyroscope is nearly four times as loud as at the other rests.
    let shaken = six_faces().into_iter().map(|mut m| {
        let up = m.accel - Vector3::new(0.12, 9.64, 0.2);
        if up.amax() < 0.5 {
            m.gyro = Vector3::from(GYRO_BIAS) + (m.gyro - Vector3::from(GYRO_BIAS)) * 3.8;
        }
        ("/imu", START + m.at, both(&m, START + m.at))
    });
    let folder = Folder::new();
    folder.write("a.mcap", &recording(shaken));
    let run = folder.run(["annotate", "a.mcap", "--set", MAPPED]).ok();
    let said = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        said.contains("with the face up and the louder sensor: ") && said.contains(", +Y up, gyroscope)"),
        "{said}"
    );
    // As much is told by the recording and by its annotated copy.
    for name in ["a.mcap", "a.annotated.mcap"] {
        folder.run(["report", name, "-o", "page.html", "--force", "--set", MAPPED]).ok();
        let html = String::from_utf8(folder.read("page.html")).unwrap();
        assert!(html.contains("<td>+Y</td><td>gyroscope</td>"), "{name}");
    }
}

#[test]
fn asked_for_by_name_or_not_the_turns_make_six_faces_triangular() {
    let folder = Folder::new();
    folder.write("six.mcap", &std::fs::read("testdata/six-faces.mcap").unwrap());
    let learned = |model: &str| {
        let out = format!("{model}.mcap");
        folder.run(["annotate", "six.mcap", "-o", &out, "--json", "--set", &format!("fit.model={model}")]).ok().json()
    };
    let (asked, auto) = (learned("triangular"), learned("auto"));
    assert_eq!(asked["imus"][0]["accelerometer"]["model"], "triangular");
    assert_eq!(asked["imus"][0]["accelerometer"]["status"], "CONFIRMED");
    for name in ["bias", "sensitivity", "bias_std", "sensitivity_std"] {
        assert_eq!(asked["imus"][0]["accelerometer"][name], auto["imus"][0]["accelerometer"][name], "{name}");
    }
}

#[test]
fn what_gravity_does_to_a_gyroscope_is_printed_with_its_interval_and_in_the_formula() {
    let folder = Folder::new();
    let sensitivity = "gyroscope.g_sensitivity=[[0.0005, 0, 0], [0, -0.0004, 0], [0, 0.0003, 0]]";
    folder.run(["simulate", "six-faces", "-o", "six.mcap", "--set", sensitivity]).ok();
    let run = folder.say("annotate six.mcap").ok();
    for said in ["S · true + G · true acceleration", "G, row x", "G, row z", "G is the g-sensitivity, rad/s per m/s²"]
    {
        assert!(run.stderr.contains(said), "{said}: {}", run.stderr);
    }
    let row = run.stderr.lines().find(|line| line.contains("G, row x")).unwrap();
    assert_eq!(row.matches('±').count(), 3, "{row}");
    let exported = folder.say("export six.annotated.mcap --format json").ok().json();
    let direction = exported["imus"][0]["direction"].as_str().unwrap().to_owned();
    assert!(direction.contains("of the gyroscope + g_sensitivity * true acceleration"), "{direction}");
    // The demo has none.
    let folder = Folder::with_demo();
    let run = folder.say("annotate demo.mcap").ok();
    assert!(!run.stderr.contains("G, row") && !run.stderr.contains("acceleration,"), "{}", run.stderr);
}

#[test]
fn a_turn_by_hand_is_at_no_end_of_the_range() {
    let folder = Folder::with_demo();
    let run = folder.say("tail demo.mcap -o t.mcap").ok();
    assert!(!run.stderr.contains("end of the range"), "{}", run.stderr);
}
