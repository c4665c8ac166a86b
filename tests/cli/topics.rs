//! `topics` on recordings that need a second look: units, twins, pairs of topics, JSON without a schema.

use std::collections::BTreeMap;

use crate::common::Folder;
use serde_json::{Value, json};

/// A recording of JSON messages without schema: by topic, what each of 300 messages says.
fn recording(folder: &Folder, topics: &[(&str, &dyn Fn(u32) -> Value)]) {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).unwrap();
    let channels: Vec<_> =
        topics.iter().map(|(topic, _)| writer.add_channel(0, topic, "json", &BTreeMap::new()).unwrap()).collect();
    for i in 0..300 {
        for (&channel_id, (_, message)) in channels.iter().zip(topics) {
            let log_time = 1_000_000_000 + u64::from(i) * 10_000_000;
            let header = mcap::records::MessageHeader { channel_id, sequence: i, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, message(i).to_string().as_bytes()).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    folder.write("raw.mcap", &bytes.into_inner());
}

fn noise(i: u32, k: f64) -> f64 {
    (f64::from(i) * k).sin() * 0.005
}

/// What `topics --json` says of a topic.
fn said(folder: &Folder, settings: &str, topic: &str) -> Value {
    let result = folder.say(&format!("topics raw.mcap --json {settings}")).ok().json();
    result["topics"].as_array().unwrap().iter().find(|said| said["topic"] == topic).unwrap().clone()
}

fn sample(i: u32, g: f64, degrees: f64) -> Value {
    json!({
        "timestamp": {"sec": 1 + i / 100, "nsec": i % 100 * 10_000_000},
        "accel": {"x": noise(i, 1.3) * g, "y": noise(i, 2.1) * g, "z": (1.0 + noise(i, 3.7)) * g},
        "gyro": [(0.01 + noise(i, 2.9) * 0.1) * degrees, noise(i, 0.7) * degrees, noise(i, 1.9) * degrees],
    })
}

#[test]
fn the_unit_of_gravity_is_told_from_the_readings_and_that_of_a_gyroscope_is_unconfirmed() {
    let folder = Folder::new();
    recording(&folder, &[("/imu", &|i| sample(i, 1.0, 57.3)), ("/good", &|i| sample(i + 1000, 9.81, 1.0))]);
    let imu = said(&folder, "", "/imu");
    let lines = "[[imu]]\ntopic = \"/imu\"\naccel = { path = \"accel\", unit = \"g\" }\ngyro = \"gyro\"\n";
    assert_eq!(imu["configuration"], lines);
    let remarks = imu["remarks"].to_string();
    assert!(remarks.contains("reads 1.00 at rest") && remarks.contains("its unit, rad/s, is unconfirmed"), "{remarks}");
    let good = said(&folder, "", "/good");
    assert!(good["remarks"].to_string().contains("accelerometer: reads 9.81 m/s² at rest, as it should"), "{good}");

    // With these lines, and the unit that nothing tells, nothing is to be remarked on; with others, they are offered again.
    let set = lines.replace("gyro = \"gyro\"", "gyro = { path = \"gyro\", unit = \"deg/s\" }");
    folder.write("map.toml", set.as_bytes());
    let mapped = said(&folder, "-c map.toml", "/imu");
    assert_eq!(
        (&mapped["used"], &mapped["remarks"], &mapped["configuration"]),
        (&json!(true), &json!([]), &Value::Null)
    );
    folder.write("wrong.toml", lines.replace(", unit = \"g\"", "").as_bytes());
    let wrong = said(&folder, "-c wrong.toml", "/imu");
    assert_eq!(wrong["configuration"], lines);
    folder.say("annotate raw.mcap -c map.toml -o out.mcap").ok();
}

#[test]
fn what_topics_prints_into_a_file_is_a_configuration() {
    let folder = Folder::new();
    let highg = |i| json!({"acceleration": {"x": noise(i, 1.0), "y": 0.1, "z": 9.8 + noise(i, 2.2)}});
    let text = |_| json!({"text": "hello"});
    recording(
        &folder,
        &[
            ("/front", &|i| sample(i, 9.81, 1.0)),
            ("/rear", &|i| sample(i + 1000, 1.0, 1.0)),
            ("/highg/acceleration", &highg),
            ("/other", &text),
        ],
    );
    let shown = folder.say("topics raw.mcap").ok().stdout;
    folder.write("imu.toml", shown.as_bytes());
    for said in ["# /other", "not an IMU", "topic = \"/front\"", "topic = \"/rear\"", "unit = \"g\""] {
        assert!(shown.contains(said), "{said} is not in {shown}");
    }
    folder.say("config check imu.toml").ok();
    let imus = folder.say("annotate raw.mcap -c imu.toml -o out.mcap --json").ok().json()["imus"].clone();
    let topics: Vec<_> = imus.as_array().unwrap().iter().map(|imu| imu["topic"].as_str().unwrap()).collect();
    assert!(topics.contains(&"/front") && topics.contains(&"/rear"), "{topics:?}");
    // Where nothing is offered, there are comments alone.
    let demo = Folder::with_demo();
    let shown = demo.say("topics demo.mcap").ok().stdout;
    assert!(shown.lines().all(|line| line.is_empty() || line.starts_with('#')), "{shown}");
}

#[test]
fn a_large_bias_is_no_unit_and_no_reading_as_it_should_be() {
    let folder = Folder::new();
    let biased = |by: f64| {
        move |i| {
            let mut value = sample(i, 9.81, 1.0);
            value["accel"]["z"] = json!(value["accel"]["z"].as_f64().unwrap() + by);
            value
        }
    };
    let (small, off, large, far) = (biased(0.1), biased(1.0), biased(1.6), biased(-3.0));
    recording(&folder, &[("/small", &small), ("/off", &off), ("/large", &large), ("/far", &far)]);
    let remarks = |topic| said(&folder, "", topic)["remarks"].to_string();
    for (topic, says) in [
        ("/small", "reads 9.91 m/s² at rest, as it should"),
        (
            "/off",
            "reads 10.81 m/s² at rest, where gravity is 9.81: in m/s², with a bias or a scale that is off by as much",
        ),
        (
            "/large",
            "reads 11.41 m/s² where it is quietest, and gravity is 9.81: no other unit would read so; a large bias",
        ),
        (
            "/far",
            "reads 6.81 m/s² where it is quietest, and gravity is 9.81: no other unit would read so; a large bias",
        ),
    ] {
        let remarks = remarks(topic);
        assert!(remarks.contains(says) && !remarks.contains("gravity removed"), "{topic}: {remarks}");
        assert_eq!(remarks.contains("as it should"), topic == "/small", "{remarks}");
    }
}

#[test]
fn readings_that_no_unit_explains_are_said_to_be_so() {
    let folder = Folder::new();
    recording(&folder, &[("/free", &|i| sample(i, 0.3, 1.0)), ("/mg", &|i| sample(i, 1000.0, 1.0))]);
    assert!(said(&folder, "", "/free")["remarks"].to_string().contains("gravity was removed"));
    let remarks = said(&folder, "", "/mg")["remarks"].to_string();
    assert!(remarks.contains("in mg or cm/s²"), "{remarks}");
}

#[test]
fn a_raw_topic_is_told_from_its_corrected_twin_and_from_copies() {
    let folder = Folder::new();
    let corrected = |i| {
        let mut value = sample(i, 9.81, 1.0);
        value["accel"]["x"] = json!(value["accel"]["x"].as_f64().unwrap() * 1.01 + 0.2);
        value
    };
    let other = |i| sample(i + 1000, 9.7, 1.0);
    recording(
        &folder,
        &[
            ("/imu/data_raw", &|i| sample(i, 9.81, 1.0)),
            ("/imu/data", &corrected),
            ("/relay", &corrected),
            ("/other", &other),
        ],
    );
    let remarks = |topic| said(&folder, "", topic)["remarks"].to_string();
    assert!(remarks("/imu/data").contains("/imu/data_raw corrected"), "{}", remarks("/imu/data"));
    assert!(remarks("/imu/data_raw").contains("the raw readings of /imu/data: use this one"));
    assert!(
        remarks("/relay").contains("repeats /imu/data, value for value")
            || remarks("/relay").contains("/imu/data repeats")
    );
    assert!(!remarks("/other").contains("same"), "{}", remarks("/other"));
}

#[test]
fn a_refusal_offers_an_imu_rather_than_one_half() {
    let folder = Folder::new();
    let vector = |i| json!({"acceleration": {"x": noise(i, 1.0), "y": 0.1, "z": 9.8}});
    recording(&folder, &[("/a", &vector), ("/b", &|i| sample(i, 9.81, 1.0))]);
    let refusal = folder.say("annotate raw.mcap -o out.mcap");
    assert_eq!(refusal.code, 1);
    let setting = r#"--set 'imu=[{topic = "/b", accel = "accel", gyro = "gyro"}]'"#;
    assert!(refusal.error().contains(setting), "{}", refusal.stderr);
}

#[test]
fn several_imus_are_learned_side_by_side() {
    let folder = Folder::new();
    let shaken = |i| {
        let mut value = sample(i, 9.81, 1.0);
        value["accel"]["x"] = json!((f64::from(i) * 1.7).sin() * 5.0);
        value
    };
    recording(&folder, &[("/front", &|i| sample(i, 9.81, 1.0)), ("/rear", &shaken)]);
    let imu = |topic: &str| format!("{{topic = '{topic}', accel = 'accel', gyro = 'gyro'}}");
    let setting = format!("imu=[{}, {}]", imu("/front"), imu("/rear"));
    let result = folder.run(["annotate", "raw.mcap", "-o", "out.mcap", "--json", "--set", &setting]).ok().json();
    let found = |i: usize| (&result["imus"][i]["topic"], &result["imus"][i]["rests"]["found"]);
    assert_eq!(found(0), (&json!("/front"), &json!(1)));
    assert_eq!(found(1), (&json!("/rear"), &json!(0)));
    let bytes = folder.read("out.mcap");
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let has = |topic: &str| summary.channels.values().any(|channel| channel.topic == topic);
    assert!(has("/front/stillpoint/stillness") && has("/front/stillpoint/segment"));
    assert!(has("/rear/stillpoint/stillness") && !has("/rear/stillpoint/segment"));
}

#[test]
fn a_secondary_accelerometer_may_have_a_clock_and_a_rate_of_its_own() {
    const G: f64 = 9.80665;
    // Six faces, three seconds each, a second of shaking before each.
    let force = |seconds: f64| {
        let face = (seconds / 4.0) as usize % 6;
        let shake = if seconds % 4.0 < 1.0 { 3.0 } else { 0.02 };
        let wobble = |k: f64| (seconds * k).sin() * shake;
        let mut force = [wobble(917.0), wobble(1313.0), wobble(1709.0)];
        force[face / 2] += if face.is_multiple_of(2) { G } else { -G };
        force
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).unwrap();
    let channels = ["/imu", "/highg"].map(|topic| writer.add_channel(0, topic, "json", &BTreeMap::new()).unwrap());
    let (mut next, mut sequence) = ([0.0, 0.0123], 0);
    while next[0] < 24.0 {
        // 100 Hz beside 37 Hz.
        let which = usize::from(next[1] < next[0]);
        let seconds = next[which];
        next[which] += [0.01, 1.0 / 37.0][which];
        let [x, y, z] = force(seconds);
        let nanos = 1_000_000_000 + (seconds * 1e9) as u64;
        let stamp = json!({"sec": nanos / 1_000_000_000, "nsec": nanos % 1_000_000_000});
        let message = match which {
            0 => {
                let gyro = [700.0, 900.0, 1100.0].map(|k: f64| (seconds * k).sin() * 0.001);
                json!({"stamp": stamp, "accel": [x, y, z], "gyro": gyro})
            }
            _ => json!({"stamp": stamp, "acc": [1.0 + 0.95 * x, 0.97 * y - 2.0, 0.5 + z]}),
        };
        // Recorded late, and not equally late.
        let log_time = nanos + [2_000_000, 31_000_000][which];
        let header =
            mcap::records::MessageHeader { channel_id: channels[which], sequence, log_time, publish_time: nanos };
        writer.write_to_known_channel(&header, message.to_string().as_bytes()).unwrap();
        sequence += 1;
    }
    writer.finish().unwrap();
    drop(writer);
    let folder = Folder::new();
    folder.write("raw.mcap", &bytes.into_inner());
    let secondary = "secondary = [{name = 'highg', topic = '/highg', accel = 'acc'}]";
    let setting = format!("imu=[{{topic = '/imu', accel = 'accel', gyro = 'gyro', {secondary}}}]");
    let result = folder.run(["annotate", "raw.mcap", "-o", "out.mcap", "--json", "--set", &setting]).ok().json();
    let found = &result["imus"][0]["secondary"][0];
    for (axis, (bias, scale)) in [(1.0, 0.95), (-2.0, 0.97), (0.5, 1.0)].into_iter().enumerate() {
        let [b, s] = [&found["bias"][axis], &found["sensitivity"][axis][axis]].map(|value| value.as_f64().unwrap());
        assert!((b - bias).abs() < 0.02 && (s - scale).abs() < 0.002, "{found}");
    }
}

#[test]
fn thousands_of_other_topics_are_counted_and_an_imu_behind_them_is_shown() {
    let folder = Folder::new();
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).unwrap();
    let text = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data").unwrap();
    for i in 0..4000 {
        writer.add_channel(text, &format!("/chatter/{i:04}"), "cdr", &BTreeMap::new()).unwrap();
    }
    let imu = writer.add_channel(0, "/imu", "json", &BTreeMap::new()).unwrap();
    for i in 0..300 {
        let log_time = 1_000_000_000 + u64::from(i) * 10_000_000;
        let header = mcap::records::MessageHeader { channel_id: imu, sequence: i, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, sample(i, 9.81, 1.0).to_string().as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    folder.write("raw.mcap", &bytes.into_inner());
    let shown = folder.say("topics raw.mcap").ok().stdout;
    assert!(shown.lines().count() < 150, "{} lines", shown.lines().count());
    for said in ["/chatter/0000", "and 3950 more that are no IMUs", "topic = \"/imu\""] {
        assert!(shown.contains(said), "{said}: {shown}");
    }
    assert_eq!(folder.say("topics raw.mcap --json").ok().json()["topics"].as_array().unwrap().len(), 4001);
}

#[test]
fn a_recording_annotated_with_a_mapping_does_not_want_it_again() {
    let folder = Folder::new();
    recording(&folder, &[("/imu", &|i| sample(i, 9.81, 1.0))]);
    let offered = folder.say("topics raw.mcap --json").ok().json();
    folder.write("map.toml", offered["topics"][0]["configuration"].as_str().unwrap().as_bytes());
    folder.say("annotate raw.mcap -o once.mcap -c map.toml").ok();
    let seen = folder.say("topics once.mcap --json").ok().json();
    let seen = seen["topics"].as_array().unwrap().iter().find(|said| said["topic"] == "/imu").unwrap();
    assert_eq!(seen["used"], true, "{seen}");
    folder.say("annotate once.mcap -o twice.mcap").ok();
    assert!(folder.read("once.mcap") == folder.read("twice.mcap"), "not what it was annotated to");
    // The original alone knows nothing of it.
    folder.say("strip once.mcap -o raw2.mcap").ok();
    folder.refuses("annotate raw2.mcap", 1, &["no usable IMU topic among /imu"]);
}

#[test]
fn a_large_bias_is_among_what_an_odd_length_may_be() {
    let folder = Folder::new();
    let (bias, pose) = ("accelerometer.bias=[0, 0, -8.0]", "pose=[{face=\"+Z\", rest_s=6}]");
    folder.run(["simulate", "demo", "-o", "a.mcap", "-q", "--set", bias, "--set", pose]).ok();
    let said = folder.say("topics a.mcap").ok().stdout;
    let may_be = "which is no unit of gravity: moving all the time, gravity removed, or a large bias";
    assert!(said.contains(may_be), "{said}");
}
