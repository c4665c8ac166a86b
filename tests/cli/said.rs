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
