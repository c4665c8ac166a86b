//! What the program makes of recordings: the same bytes every time, the original inside, results that programs read.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;

use crate::common::Folder;
use serde_json::{Value, json};
use stillpoint::Error;
use stillpoint::config::Config;
use stillpoint::run::{self, Input, Options};
use stillpoint::simulate::Scenario;

#[test]
fn annotating_is_deterministic_idempotent_and_can_be_undone() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o once.mcap").ok();
    folder.say("annotate demo.mcap -o again.mcap").ok();
    folder.say("annotate once.mcap -o twice.mcap").ok();
    folder.say("strip once.mcap -o stripped.mcap").ok();
    assert!(folder.read("once.mcap") == folder.read("again.mcap"), "two runs differ");
    assert!(folder.read("once.mcap") == folder.read("twice.mcap"), "annotating twice is not annotating once");
    assert!(folder.read("stripped.mcap") == folder.read("demo.mcap"), "strip does not give the original back");
    assert!(folder.read("once.mcap").len() > folder.read("demo.mcap").len());
    folder.refuses("strip demo.mcap -o out.mcap", 1, &["demo.mcap: was not annotated"]);
}

#[test]
fn a_result_that_exists_is_left_alone_and_any_other_output_is_refused() {
    let folder = Folder::with_demo();
    for sidecar in ["", "--sidecar"] {
        folder.say(&format!("annotate demo.mcap {sidecar}")).ok();
        let run = folder.say(&format!("annotate demo.mcap {sidecar}")).ok();
        assert!(run.stderr.contains("already the result"), "{}", run.stderr);
        let other = format!("annotate demo.mcap --set still.min_fit_s=1.5 {sidecar}");
        folder.refuses(&other, 1, &["exists and is not the result"]);
        folder.say(&format!("{other} --force")).ok();
    }
    assert_eq!(folder.names(), ["demo.annotated.mcap", "demo.mcap", "demo.stillpoint.mcap"]);

    let mut damaged = folder.read("demo.annotated.mcap");
    *damaged.last_mut().unwrap() ^= 1;
    folder.write("demo.annotated.mcap", &damaged);
    folder.refuses("annotate demo.mcap --set still.min_fit_s=1.5", 1, &["exists and is not the result"]);
    folder.refuses("annotate demo.stillpoint.mcap", 1, &["holds annotations alone"]);
}

#[test]
fn each_of_several_inputs_is_finished_or_refused_on_its_own() {
    let folder = Folder::with_demo();
    folder.write("b.mcap", &folder.read("demo.mcap"));
    folder.write("bad.mcap", b"not a recording");
    let run = folder.say("annotate demo.mcap bad.mcap b.mcap --out-dir . --json -q");
    assert_eq!(run.code, 1);
    let lines: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 3);
    assert!(lines[1]["error"].as_str().unwrap().contains("bad.mcap: not an MCAP"));
    assert_eq!(folder.names(), ["b.annotated.mcap", "b.mcap", "bad.mcap", "demo.annotated.mcap", "demo.mcap"]);
    assert_eq!(lines[0]["imus"], lines[2]["imus"]);
}

#[test]
fn damage_is_used_around_reported_and_tells_the_exit_code() {
    let folder = Folder::with_demo();
    let whole = folder.read("demo.mcap");
    folder.write("cut.mcap", &whole[..whole.len() * 9 / 10]);
    let run = folder.say("annotate cut.mcap --json");
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(run.stderr.contains("warning: damaged at byte"), "{}", run.stderr);
    let result = run.json();
    assert!(result["damage"]["count"].as_u64().unwrap() >= 1);
    assert!(result["damage"]["found"][0]["offset"].as_u64().unwrap() > 0);
    assert!(result["rests"]["found"].as_u64().unwrap() >= 5);
    folder.say("annotate cut.mcap --accept-damage").ok();
    for looking in ["topics cut.mcap", "report cut.mcap", "export cut.mcap --format json"] {
        let run = folder.say(looking);
        assert_eq!(run.code, 3, "{looking}: {}", run.stderr);
        assert!(!run.stdout.is_empty() && (run.stderr + &run.stdout).contains("damaged"), "{looking}");
        folder.say(&format!("{looking} --accept-damage")).ok();
    }
    folder.say("strip cut.annotated.mcap -o stripped.mcap").ok();
    assert!(folder.read("stripped.mcap") == folder.read("cut.mcap"));

    let annotated = folder.read("cut.annotated.mcap");
    folder.write("cut_again.mcap", &annotated[..annotated.len() - 100]);
    assert_eq!(folder.say("annotate cut_again.mcap -o anew.mcap").code, 3);
    assert!(folder.read("anew.mcap") == annotated, "the original within a cut annotated recording is annotated");
}

#[test]
fn required_calibrations_that_are_missing_tell_the_exit_code() {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.pose.truncate(3);
    let folder = Folder::with_scenario("three.mcap", &scenario);
    let run = folder.say("annotate three.mcap").ok();
    for word in ["UNDETERMINED", "missing", "next"] {
        assert!(run.stderr.contains(word), "no {word:?} in {}", run.stderr);
    }
    let run = folder.say("annotate three.mcap --require-calibration --json -q");
    assert_eq!((run.code, run.stderr.as_str()), (4, ""));
    let unmet =
        "warning: three.mcap: no accelerometer calibration for /imu/data_raw, and --require-calibration asks for one";
    for verb in ["annotate", "tail"] {
        let run = folder.say(&format!("{verb} three.mcap -o {verb}.mcap --require-calibration"));
        assert_eq!((run.code, run.stderr.lines().last()), (4, Some(unmet)), "{verb}: {}", run.stderr);
    }
    let merged = folder.say("merge three.mcap --require-calibration");
    let is_said = merged.stderr.contains("no accelerometer calibration for /imu/data_raw, and --require-calibration");
    assert!(merged.code == 4 && is_said, "{}", merged.stderr);
    let imu = &run.json()["imus"][0];
    assert_eq!(imu["accelerometer"]["bias"], Value::Null);
    assert_eq!(imu["coverage"]["complete"], false);
    assert!(imu["reason"].as_str().is_some_and(|reason| !reason.is_empty()));

    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap --require-calibration").ok();
}

#[test]
fn the_json_result_holds_what_the_truth_says() {
    let folder = Folder::with_demo();
    let truth = folder.say("simulate demo -o same.mcap --json").ok().json();
    assert!(folder.read("same.mcap") == folder.read("demo.mcap"));
    let result = folder.say("annotate demo.mcap --json").ok().json();
    assert_eq!(result["input"], "demo.mcap");
    assert_eq!(result["output"], "demo.annotated.mcap");
    assert_eq!(result["rests"], json!({"found": 9, "accepted": 9, "rejected": 0}));
    assert_eq!(result["damage"]["count"], 0);
    assert!(result["messages"].as_u64().unwrap() > 1000);
    let imu = &result["imus"][0];
    assert_eq!(imu["topic"], "/imu/data_raw");
    assert_eq!(imu["reason"], Value::Null);
    assert_eq!(imu["coverage"]["complete"], true);
    for (triad, parameters) in [("accelerometer", &["bias", "sensitivity"][..]), ("gyroscope", &["bias"])] {
        assert_ne!(imu[triad]["status"], "UNDETERMINED");
        for parameter in parameters {
            let within = |i: usize| {
                let entry = |of: &Value| if of[i].is_array() { of[i][i].as_f64() } else { of[i].as_f64() };
                let error = entry(&imu[triad][parameter]).unwrap() - entry(&truth["truth"][triad][parameter]).unwrap();
                let std = entry(&imu[triad][format!("{parameter}_std")]).unwrap();
                assert!(std > 0.0 && error.abs() < 5.0 * std, "{triad} {parameter} {i}: {error} beside ± {std}");
            };
            (0..3).for_each(within);
        }
    }
    assert_eq!(imu["accelerometer"]["sensitivity_std"][0][1], Value::Null);
}

#[test]
fn export_says_the_same_of_raw_annotated_and_sidecar_and_never_fits_again() {
    let folder = Folder::with_demo();
    let annotated = folder.say("annotate demo.mcap --json").ok().json();
    folder.say("annotate demo.mcap --sidecar").ok();
    let raw = folder.say("export demo.mcap --format json").ok().stdout;
    assert_eq!(serde_json::from_str::<Value>(&raw).unwrap()["imus"], annotated["imus"]);
    assert_eq!(folder.say("export demo.annotated.mcap --format json").ok().stdout, raw);
    assert_eq!(folder.say("export demo.stillpoint.mcap --format json -o out.json").ok().stdout, "");
    assert_eq!(folder.read("out.json"), raw.as_bytes());

    let other = "--format json --set fit.gravity=9.7";
    assert_eq!(folder.say(&format!("export demo.annotated.mcap {other}")).ok().stdout, raw);
    assert_ne!(folder.say(&format!("export demo.mcap {other}")).ok().stdout, raw);
}

#[test]
fn topics_says_what_each_channel_is_used_for() {
    let folder = Folder::with_scenario("thesis.mcap", &{
        let mut scenario = Scenario::builtin("thesis-sequence-3").unwrap();
        scenario.pose.truncate(2);
        scenario.pose.iter_mut().for_each(|pose| pose.rest_s = 1.0);
        scenario
    });
    let text = folder.say("topics thesis.mcap").ok().stdout;
    assert!(text.contains("accelerometer of /imu/data_raw") && text.contains("/highg/acceleration"), "{text}");
    let topics = folder.say("topics thesis.mcap --json").ok().json()["topics"].clone();
    assert_eq!((&topics[0]["topic"], &topics[0]["used"]), (&json!("/highg/acceleration"), &json!(false)));
    assert!(topics[1]["hz"].as_f64() > Some(1.0));

    folder.write("offered.toml", topics[0]["configuration"].as_str().unwrap().as_bytes());
    let topics = folder.say("topics thesis.mcap --json -c offered.toml").ok().json()["topics"].clone();
    assert!(topics.as_array().unwrap().iter().all(|topic| topic["used"] == true), "{topics}");
    let misspelt = folder.run(["topics", "thesis.mcap", "--set", r#"imu=[{topic="/imu/data_rav"}]"#]).ok();
    assert!(misspelt.stdout.contains("did you mean /imu/data_raw?"), "{}", misspelt.stdout);
}

#[test]
fn quiet_is_quiet_and_the_result_alone_is_on_standard_output() {
    let folder = Folder::with_demo();
    let run = folder.say("annotate demo.mcap -q").ok();
    assert_eq!((run.stdout.as_str(), run.stderr.as_str()), ("", ""));
    let run = folder.say("annotate demo.mcap -o b.mcap").ok();
    assert_eq!(run.stdout, "");
    for word in ["9 found", "+X 2×", "bias m/s²", "±", "next", "wrote b.mcap"] {
        assert!(run.stderr.contains(word), "no {word:?} in {}", run.stderr);
    }
    assert!(run.stderr.lines().all(|line| line.chars().count() <= 100), "{}", run.stderr);
}

#[test]
fn the_default_configuration_can_be_shown_checked_and_used() {
    let folder = Folder::with_demo();
    folder.write("default.toml", folder.say("config show").ok().stdout.as_bytes());
    let checked = folder.say("config check default.toml --json").ok().json();
    assert_eq!(checked, folder.say("config show --json").ok().json());
    folder.say("annotate demo.mcap -o a.mcap -c default.toml").ok();
    folder.say("annotate demo.mcap -o b.mcap").ok();
    assert!(folder.read("a.mcap") == folder.read("b.mcap"));
}

#[test]
fn a_scenario_can_be_shown_edited_and_simulated() {
    let folder = Folder::with_demo();
    folder.write("mine.toml", folder.say("simulate demo --show").ok().stdout.as_bytes());
    folder.say("simulate mine.toml -o mine.mcap").ok();
    assert!(folder.read("mine.mcap") == folder.read("demo.mcap"));
    folder.say("simulate mine.toml -o other.mcap --set recording.seed=99").ok();
    assert!(folder.read("other.mcap") != folder.read("demo.mcap"));
}

#[test]
fn work_that_is_stopped_leaves_nothing_behind() {
    let folder = Folder::with_demo();
    let recording = Input::open(&folder.path().join("demo.mcap")).unwrap();
    let output = folder.path().join("out.mcap");
    for stopped_at in 0..2 {
        let calls = std::cell::Cell::new(0);
        let watch = |_: u64| {
            calls.set(calls.get() + 1);
            if calls.get() > stopped_at { Err(Error::Stopped) } else { Ok(()) }
        };
        let done =
            run::annotate(&recording, std::slice::from_ref(&output), &Config::default(), Options::default(), &watch);
        assert!(matches!(done, Err(Error::Stopped)));
        assert_eq!(folder.names(), ["demo.mcap"]);
    }
}

#[test]
fn chunks_without_an_imu_are_copied_unread_unless_they_are_to_be_verified() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    // The same messages, and in between chunks of nothing but pictures.
    let mut out = std::io::Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new().profile("ros2").compression(None).chunk_size(None);
    let mut writer = options.create(&mut out).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"uint8[] data").unwrap();
    let camera = writer.add_channel(schema, "/camera", "cdr", &Default::default()).unwrap();
    let mut channels = std::collections::BTreeMap::new();
    for (n, message) in mcap::MessageStream::new(&demo).unwrap().enumerate() {
        let message = message.unwrap();
        let channel = *channels.entry(message.channel.id).or_insert_with(|| {
            let mcap::Channel { topic, schema, message_encoding, metadata, .. } = &*message.channel;
            let schema = schema.as_ref().unwrap();
            let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            writer.add_channel(schema, topic, message_encoding, metadata).unwrap()
        });
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: message.sequence,
            log_time: message.log_time,
            publish_time: message.publish_time,
        };
        writer.write_to_known_channel(&header, &message.data).unwrap();
        if n % 1000 == 999 {
            let header = mcap::records::MessageHeader {
                channel_id: camera,
                sequence: 0,
                log_time: message.log_time,
                publish_time: message.log_time,
            };
            writer.flush().unwrap();
            writer.write_to_known_channel(&header, &[0xA5; 5000]).unwrap();
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    let mut file = out.into_inner();
    folder.write("x.mcap", &file);
    for verify in ["", "--verify"] {
        folder.say(&format!("annotate x.mcap -o whole{verify}.mcap {verify}")).ok();
    }
    assert!(folder.read("whole.mcap") == folder.read("whole--verify.mcap"), "reading more must not say more");

    // A wrong byte in the last picture is nobody's business, until it is asked for.
    let place = file.windows(100).rposition(|bytes| bytes == [0xA5; 100]).unwrap();
    file[place] = 0;
    folder.write("x.mcap", &file);
    folder.say("annotate x.mcap -o copied.mcap").ok();
    folder.say("strip copied.mcap -o back.mcap").ok();
    assert!(folder.read("back.mcap") == file);
    let run = folder.say("annotate x.mcap -o verified.mcap --verify");
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("a chunk whose CRC does not hold"), "{}", run.stderr);
}

#[test]
fn a_chunk_of_pictures_that_defines_the_imu_is_read() {
    let folder = Folder::new();
    folder.say("simulate demo -o demo.mcap").ok();
    let demo = folder.read("demo.mcap");
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().profile("ros2").compression_threads(0).create(&mut out).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"uint8[] data").unwrap();
    let camera = writer.add_channel(schema, "/camera", "cdr", &Default::default()).unwrap();
    let picture = |writer: &mut mcap::Writer<_>, log_time| {
        let header = mcap::records::MessageHeader { channel_id: camera, sequence: 0, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &[0xA5; 5000]).unwrap();
        writer.flush().unwrap();
    };
    let mut channels = std::collections::BTreeMap::new();
    for (n, message) in mcap::MessageStream::new(&demo).unwrap().enumerate() {
        let message = message.unwrap();
        if n == 0 {
            (0..3).for_each(|_| picture(&mut writer, message.log_time));
        }
        let is_new = !channels.contains_key(&message.channel.id);
        let channel_id = *channels.entry(message.channel.id).or_insert_with(|| {
            let mcap::Channel { topic, schema, message_encoding, metadata, .. } = &*message.channel;
            let schema = schema.as_ref().unwrap();
            let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            writer.add_channel(schema, topic, message_encoding, metadata).unwrap()
        });
        if is_new {
            picture(&mut writer, message.log_time);
        }
        let mcap::Message { sequence, log_time, publish_time, .. } = message;
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &message.data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let whole = out.into_inner();
    // With its summary, and without: cut off behind the readings.
    for (name, file) in [("whole", &whole[..]), ("cut", &whole[..whole.len() * 9 / 10])] {
        folder.write(&format!("{name}.mcap"), file);
        let code = if name == "whole" { 0 } else { 3 };
        for verify in ["", "--verify"] {
            let run = folder.say(&format!("annotate {name}.mcap -o {name}{verify}.out.mcap --json {verify}"));
            assert_eq!(run.code, code, "{}", run.stderr);
            assert!(run.json()["imus"][0]["accelerometer"].is_object(), "{name} {verify}");
        }
        assert!(folder.read(&format!("{name}.out.mcap")) == folder.read(&format!("{name}--verify.out.mcap")), "{name}");
    }
}

#[test]
fn a_rate_table_with_a_reference_topic_calibrates_the_full_model() {
    let folder = Folder::new();
    let truth = folder.say("simulate rate-table -o table.mcap --json").ok().json();
    let imu =
        "[[imu]]\ntopic = \"/imu/data_raw\"\n[imu.reference]\ntopic = \"/table/state\"\n[fit]\nmodel = \"full\"\n";
    folder.write("table.toml", imu.as_bytes());
    let annotated = folder.say("annotate table.mcap -o out.mcap -c table.toml --json").ok().json()["imus"][0].clone();
    folder.say("export out.mcap --format json -o out.json").ok();
    let exported: Value = serde_json::from_slice(&folder.read("out.json")).unwrap();
    assert_eq!(exported["imus"][0]["accelerometer"], annotated["accelerometer"]);
    for (triad, cross, unknowns) in [("accelerometer", "rate_sensitivity", 21), ("gyroscope", "g_sensitivity", 24)] {
        let (found, truth) = (&annotated[triad], &truth["truth"][triad]);
        assert_eq!(found["model"], "full", "{}", found["notes"]);
        assert_eq!(found["covariance"].as_array().unwrap().len(), unknowns * unknowns);
        for key in ["sensitivity", cross] {
            for i in 0..9 {
                let [found, truth] = [found, truth].map(|of| of[key][i / 3][i % 3].as_f64().unwrap());
                assert!((found - truth).abs() < 3e-3, "{triad} {key} {i}: {found} {truth}");
            }
        }
    }
    let topics = folder.say("topics table.mcap -c table.toml").ok().stdout;
    assert!(topics.contains("reference force of /imu/data_raw"), "{topics}");
    folder.refuses("annotate table.mcap --set fit.model=full", 2, &["fit.model", "needs a reference"]);
}

#[test]
fn with_every_channel_id_taken_nothing_is_lost_and_the_sidecar_is_advised() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    let crowded = |messages: &[mcap::Message<'_>]| {
        let mut file = Cursor::new(Vec::new());
        let mut writer = mcap::Writer::new(&mut file).unwrap();
        messages.iter().for_each(|message| writer.write(message).unwrap());
        let schema = writer.add_schema("anything", "jsonschema", b"{}").unwrap();
        let used: BTreeSet<_> = messages.iter().map(|message| message.channel.topic.as_str()).collect();
        // The writer overflows at the last one.
        for n in used.len()..usize::from(u16::MAX - 1) {
            writer.add_channel(schema, &format!("/{n}"), "json", &BTreeMap::new()).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    };
    let messages: Vec<_> = mcap::MessageStream::new(&demo).unwrap().map(Result::unwrap).collect();
    folder.write("imu.mcap", &crowded(&messages));
    folder.refuses("annotate imu.mcap", 1, &["imu.mcap: ", "channel ids", "taken", "--sidecar"]);
    folder.say("annotate imu.mcap --sidecar -q").ok();
    folder.write("none.mcap", &crowded(&[]));
    folder.say("annotate none.mcap --allow-no-imu -q").ok();
    folder.say("strip none.annotated.mcap -o back.mcap -q").ok();
    assert!(folder.read("back.mcap") == folder.read("none.mcap"), "strip does not give the original back");
}

#[test]
fn an_annotated_copy_of_a_damaged_recording_says_so_in_its_report_and_exports() {
    let demo = Folder::with_demo().read("demo.mcap");
    let cut = demo[..demo.len() * 2 / 3].to_vec();
    let mut hole = demo.clone();
    hole[demo.len() / 2..demo.len() / 2 + 4000].fill(0);
    for (name, bytes) in [("cut", cut), ("hole", hole)] {
        let folder = Folder::new();
        folder.write("raw.mcap", &bytes);
        assert_eq!(folder.say("annotate raw.mcap -o a.mcap").code, 3, "{name}");
        let (before, after) = (folder.say("report raw.mcap"), folder.say("report a.mcap"));
        let damaged = |text: &str| text.lines().filter(|line| line.contains("damaged at byte")).count();
        assert_eq!((before.code, after.code), (3, 3), "{name}: {}", after.stdout);
        assert!(damaged(&before.stdout) > 0, "{name}: {}", before.stdout);
        assert_eq!(damaged(&after.stdout), damaged(&before.stdout), "{name}: {}", after.stdout);
        assert_eq!(folder.say("export a.mcap --format json -o a.json").code, 3, "{name}");
        assert_eq!(folder.say("report a.mcap --accept-damage").code, 0, "{name}");
    }
}
