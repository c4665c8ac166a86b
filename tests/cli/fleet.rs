//! Lists of recordings: parts of them, manifests, exit codes that schedulers act on, and one calibration out of many.

use serde_json::Value;
use stillpoint::simulate::{Scenario, record};

use crate::common::page::check;
use crate::common::{Folder, program};

/// A folder with three recordings of one sensor, of two faces each, a day apart.
fn faces() -> Folder {
    let folder = Folder::new();
    for (day, faces) in [["+X", "-Y"], ["-X", "+Z"], ["+Y", "-Z"]].into_iter().enumerate() {
        let mut scenario = Scenario::builtin("demo").unwrap();
        scenario.pose.retain(|pose| pose.face.as_deref().is_some_and(|face| faces.contains(&face)));
        scenario.recording.seed = day as u64 + 1;
        scenario.recording.start_s += 86_400 * day as u32;
        let mut bytes = Vec::new();
        record(&scenario, &mut bytes).unwrap();
        folder.write(&format!("{day}.mcap"), &bytes);
    }
    folder
}

fn lines(folder: &Folder, name: &str) -> Vec<Value> {
    let text = String::from_utf8(folder.read(name)).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn recordings_none_of_which_suffices_are_a_calibration_together() {
    let folder = faces();
    folder.say("annotate 0.mcap 1.mcap").ok();
    folder.say("annotate 2.mcap --sidecar").ok();
    let alone = folder.say("export 0.annotated.mcap --format json").ok();
    assert!(alone.stdout.contains("\"seconds\": 0.0") && !alone.stdout.contains("\"seconds\": -"), "{}", alone.stdout);
    assert_eq!(alone.json()["imus"][0]["accelerometer"]["status"], "UNDETERMINED");
    let merged = folder.say("merge 0.annotated.mcap 1.annotated.mcap 2.stillpoint.mcap --format json").ok();
    // Raw, in another order, and one of them twice.
    let raw = folder.say("merge 2.mcap 0.mcap 1.mcap 0.annotated.mcap --format json").ok();
    assert_eq!(merged.stdout, raw.stdout);
    let imu = &merged.json()["imus"][0];
    assert_eq!((&imu["topic"], &imu["history"]["recordings"]), (&"/imu/data_raw".into(), &3.into()));
    assert_eq!(imu["accelerometer"]["status"], "PROVISIONAL");
    for (axis, truth) in [0.255, -0.142, 0.310].into_iter().enumerate() {
        let (bias, std) = (&imu["accelerometer"]["bias"][axis], &imu["accelerometer"]["bias_std"][axis]);
        let (bias, std) = (bias.as_f64().unwrap(), std.as_f64().unwrap());
        assert!((bias - truth).abs() < 4.0 * std && std < 0.05, "{axis}: {bias} ± {std}");
    }
    let people = folder.say("merge 0.mcap 1.mcap 2.mcap").ok().stdout;
    assert!(people.contains(" rests of 3 recordings") && people.contains("over time"), "{people}");
    folder.say("merge 0.mcap 1.mcap 2.mcap --format kalibr -o imu.yaml --report page.html").ok();
    let page = String::from_utf8(folder.read("page.html")).unwrap();
    check(&page);
    let course = page.split("<h3>Over the recordings</h3>").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(course.contains(" rests of 3 recordings") && course.contains("Accelerometer bias, m/s²: x"), "{course}");
    assert_eq!(course.matches("<figure").count(), 9, "{course}");
    assert!(!page.contains("as recorded") && !page.contains("stillpoint export"), "no readings, no one command");
    folder.refuses("merge 0.mcap 1.mcap --report 1.mcap --force", 1, &["1.mcap"]);
    assert!(String::from_utf8(folder.read("imu.yaml")).unwrap().contains("accelerometers"));
    // What tells sensors apart.
    let two = folder.say("merge 0.mcap 1.mcap --by topic,frame-id --json").ok().json();
    assert_eq!(two["imus"].as_array().unwrap().len(), 1);
    folder.refuses("merge 0.mcap --by colour", 2, &["colour", "topic, name, frame-id, folder, serial, metadata:KEY"]);
    assert_eq!(folder.say("merge 0.mcap --require-calibration --json").code, 4);
}

#[test]
fn one_annotated_recording_alone_is_merged_to_what_its_export_says() {
    let folder = Folder::new();
    let mut bytes = Vec::new();
    record(&Scenario::builtin("demo").unwrap(), &mut bytes).unwrap();
    folder.write("demo.mcap", &bytes);
    folder.say("annotate demo.mcap").ok();
    let alone = folder.say("export demo.annotated.mcap --format json").ok().json();
    let merged = folder.say("merge demo.annotated.mcap --format json").ok().json();
    for triad in ["accelerometer", "gyroscope"] {
        let [alone, merged] = [&alone, &merged].map(|all| &all["imus"][0][triad]);
        assert_eq!((&alone["model"], &alone["status"]), (&merged["model"], &merged["status"]));
        for number in ["bias", "bias_std", "sensitivity"] {
            assert_eq!(alone[number], merged[number], "{triad} {number}");
        }
    }
    assert!(merged["imus"][0]["history"]["turns"].as_u64().unwrap() >= 6, "{merged}");
}

/// The recording with its channels labelled by their recorder.
fn labelled(bytes: &[u8], topic: &str, serial: &str) -> Vec<u8> {
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        let mut message = message.unwrap();
        let mut channel = (*message.channel).clone();
        channel.topic = channel.topic.replace("/imu/data_raw", topic);
        channel.metadata.insert("serial".to_owned(), serial.to_owned());
        message.channel = std::sync::Arc::new(channel);
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn recordings_of_one_serial_number_are_joined_whatever_their_topic() {
    let folder = faces();
    for (day, (topic, serial)) in
        [("/front/imu", "A7"), ("/rear/imu", "A7"), ("/rear/imu", "B2")].into_iter().enumerate()
    {
        let name = format!("{day}.mcap");
        folder.write(&name, &labelled(&folder.read(&name), topic, serial));
    }
    folder.say("annotate 0.mcap").ok();
    let merged = folder.say("merge 0.annotated.mcap 1.mcap 2.mcap --by serial --json").ok().json();
    let said = |imu: &Value| (imu["key"].clone(), imu["topic"].clone(), imu["history"]["recordings"].clone());
    let said: Vec<_> = merged["imus"].as_array().unwrap().iter().map(said).collect();
    let sensor = |key: &str, recordings: u64| (key.into(), "/rear/imu".into(), recordings.into());
    assert_eq!(said, [sensor("A7", 2), sensor("B2", 1)]);
    let same = folder.say("merge 0.annotated.mcap 1.mcap 2.mcap --by metadata:serial --json").ok();
    assert_eq!(same.json(), merged);
    folder.refuses("merge 1.mcap --by metadata:vehicle", 1, &["/rear/imu", "vehicle", "it has serial"]);
}

#[test]
fn one_bad_recording_never_stops_the_others_and_the_manifest_says_what_became_of_each() {
    let folder = faces();
    folder.write("bad.mcap", b"no recording at all");
    folder.write("list", b"0.mcap\r\nbad.mcap\n\n1.mcap\nmissing.mcap\n2.mcap\n");
    let run = folder.say("annotate --inputs-from list --manifest outcome.jsonl");
    assert_eq!(run.code, 6, "{}", run.stderr);
    let outcomes = |lines: &[Value]| -> Vec<String> {
        lines.iter().map(|line| line["outcome"].as_str().unwrap().to_owned()).collect()
    };
    let first = lines(&folder, "outcome.jsonl");
    assert_eq!(outcomes(&first), ["written", "hopeless", "written", "hopeless", "written"]);
    assert!(first[1]["error"].as_str().unwrap().contains("bad.mcap") && first[1]["code"] == 6);
    assert!(first[0]["rests"]["accepted"].as_u64().unwrap() >= 2);
    let before = folder.read("0.annotated.mcap");
    folder.say("annotate --inputs-from list --manifest outcome.jsonl");
    assert_eq!(outcomes(&lines(&folder, "outcome.jsonl")), ["skipped", "hopeless", "skipped", "hopeless", "skipped"]);
    assert!(before == folder.read("0.annotated.mcap"));
    // Nothing but a manifest is replaced by one.
    folder.refuses("annotate 0.mcap --manifest list", 1, &["list: exists"]);
    folder.refuses("annotate 0.mcap --manifest 0.mcap", 1, &["0.mcap"]);
    assert_eq!(folder.say("annotate bad.mcap").code, 1, "what is named by hand keeps its code");
}

#[test]
fn parts_of_a_list_are_worked_on_once_each_and_the_same_part_twice_at_once_does_no_harm() {
    let folder = faces();
    folder.write("list", b"0.mcap\n1.mcap\n2.mcap\n");
    folder.say("annotate --inputs-from list --out-dir whole").ok();
    folder.say("annotate --inputs-from list --shard 0/2 --out-dir parts").ok();
    let names = |name: &str| -> Vec<_> {
        let entries = std::fs::read_dir(folder.path().join(name)).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    assert_eq!(names("parts"), ["0.annotated.mcap", "2.annotated.mcap"]);
    // As a task of a job, which starts the same part a second time.
    let task = || {
        let mut command = std::process::Command::new(program());
        command.args("annotate --inputs-from list --shard auto/2 --out-dir parts".split(' '));
        command.env("JOB_COMPLETION_INDEX", "1").current_dir(folder.path());
        command.stderr(std::process::Stdio::piped()).spawn().unwrap()
    };
    for twin in [task(), task(), task()] {
        let output = twin.wait_with_output().unwrap();
        let code = output.status.code().unwrap();
        // Who came second finds it done, or is to come again.
        assert!(code == 0 || code == 5, "{code}: {}", String::from_utf8_lossy(&output.stderr));
    }
    crate::common::same_folders(&folder.path().join("whole"), &folder.path().join("parts"));
    folder.refuses("annotate 0.mcap --shard 2/2", 2, &["part 2 of 2", "the last one is 1"]);
}

#[test]
fn recordings_of_one_name_in_a_list_are_told_apart_by_their_folders_and_one_named_twice_counts_once() {
    let folder = faces();
    for (at, name) in ["a/r.mcap", "b/r.mcap", "b/own.mcap"].into_iter().enumerate() {
        std::fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
        folder.write(name, &folder.read(&format!("{at}.mcap")));
    }
    folder.write("list", b"a/r.mcap\nb/r.mcap\na/r.mcap\nb/own.mcap\n./b/r.mcap\n");
    let annotate = "annotate --inputs-from list --out-dir out --manifest outcome.jsonl";
    folder.say(annotate).ok();
    let outputs = |lines: &[Value]| -> Vec<String> {
        lines.iter().map(|line| line["output"].as_str().unwrap().to_owned()).collect()
    };
    let names = ["out/a/r.annotated.mcap", "out/b/r.annotated.mcap", "out/own.annotated.mcap"];
    assert_eq!(outputs(&lines(&folder, "outcome.jsonl")), names);
    folder.say("annotate a/r.mcap -o own.mcap -q").ok();
    assert!(folder.read("out/a/r.annotated.mcap") == folder.read("own.mcap"));
    folder.say(&format!("{annotate} --shard 1/2")).ok();
    assert_eq!(outputs(&lines(&folder, "outcome.jsonl")), names[1..2], "the same part is the same recording");
    // Results of an earlier run that are listed with the recordings are left out, wherever they lie.
    let all =
        "b/own.mcap\na/r.mcap\nout/a/r.annotated.mcap\nout/b/r.annotated.mcap\nout/own.annotated.mcap\nb/r.mcap\n";
    folder.write("list", all.as_bytes());
    folder.say(annotate).ok();
    let [a, b, own] = names;
    assert_eq!(outputs(&lines(&folder, "outcome.jsonl")), [own, a, b]);
}

#[test]
fn recordings_of_a_list_that_nothing_tells_apart_are_refused_and_the_others_go_on() {
    let folder = faces();
    // It only has such a name.
    folder.write("0.annotated.mcap", &folder.read("0.mcap"));
    folder.write("list", b"0.mcap\n1.mcap\n0.annotated.mcap\n");
    let run = folder.say("annotate --inputs-from list --out-dir out --manifest outcome.jsonl");
    assert_eq!(run.code, 6, "{}", run.stderr);
    let lines = lines(&folder, "outcome.jsonl");
    let outcomes: Vec<_> = lines.iter().map(|line| line["outcome"].as_str().unwrap()).collect();
    assert_eq!(outcomes, ["hopeless", "written", "hopeless"]);
    let error = lines[0]["error"].as_str().unwrap();
    assert!(error.contains("out/0.annotated.mcap, as 0.annotated.mcap would"), "{error}");
    folder.refuses("annotate 0.mcap 0.annotated.mcap --out-dir out2", 2, &["would both be written to out2/0"]);
}
