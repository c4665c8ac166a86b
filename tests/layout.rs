//! The layout for viewers: every panel that is placed exists, and shows what the annotated recording holds.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::{BTreeMap, BTreeSet};

use common::Folder;
use serde_json::Value;

fn placed(layout: &Value, out: &mut Vec<String>) {
    match layout {
        Value::String(id) => out.push(id.clone()),
        layout => ["first", "second"].iter().for_each(|side| placed(&layout[side], out)),
    }
}

/// Every string that begins like a topic, anywhere.
fn topics(value: &Value, out: &mut BTreeSet<String>) {
    match value {
        Value::String(text) if text.starts_with('/') => {
            out.insert(text.split(['.', '[']).next().unwrap().to_owned());
        }
        Value::Array(items) => items.iter().for_each(|item| topics(item, out)),
        Value::Object(fields) => fields.values().for_each(|value| topics(value, out)),
        _ => {}
    }
}

#[test]
fn every_panel_is_placed_once_and_shows_topics_that_there_are() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o annotated.mcap").ok();
    for input in ["demo.mcap", "annotated.mcap"] {
        let layout = folder.say(&format!("config layout {input}")).ok().json();
        let panels = layout["configById"].as_object().unwrap();
        let mut ids = Vec::new();
        placed(&layout["layout"], &mut ids);
        assert_eq!(ids.iter().collect::<BTreeSet<_>>(), panels.keys().collect(), "placed and configured");
        assert_eq!(ids.len(), panels.len(), "a panel is placed twice");

        let listed = folder.say("topics annotated.mcap --json").ok().json();
        let of_source =
            listed["topics"].as_array().unwrap().iter().map(|topic| topic["topic"].as_str().unwrap().to_owned());
        let annotations = ["stillness", "segment", "coverage", "calibration", "corrected"];
        let known: BTreeSet<_> = of_source
            .chain(annotations.map(|last| format!("/imu/data_raw/stillpoint/{last}")))
            .chain(["/stillpoint/log", "/studio_script/bands0", "/studio_script/gravity0"].map(str::to_owned))
            .collect();
        let mut shown = BTreeSet::new();
        topics(&layout["configById"], &mut shown);
        assert!(shown.is_subset(&known), "{:?}", shown.difference(&known));
        for script in layout["userNodes"].as_object().unwrap().values() {
            let code = script["sourceCode"].as_str().unwrap();
            assert!(
                code.contains("\"/imu/data_raw/stillpoint/") && !code.contains("IMU/") && !code.contains("PLACE"),
                "{code}"
            );
        }
    }
    folder.say("config layout demo.mcap -o layout.json").ok();
    folder.refuses("config layout demo.mcap -o layout.json", 1, &["exists"]);
    folder.write("empty.mcap", b"");
    folder.refuses("config layout empty.mcap", 1, &["empty.mcap"]);
}

#[test]
fn arrays_are_plotted_by_element_and_three_fields_by_name() {
    let folder = Folder::new();
    let recordings = [
        ("arrays", r#"{"accel": [0.1, 0.2, 9.8], "gyro": [0, 0, 0]}"#, "accel", ["accel[0]", "accel[1]", "accel[2]"]),
        ("fields", r#"{"ax": 0.1, "ay": 0.2, "az": 9.8}"#, r#"["ax", "ay", "az"]"#, ["ax", "ay", "az"]),
    ];
    for (name, message, accel, axes) in recordings {
        let accel = if accel.starts_with('[') { accel.to_owned() } else { format!("{accel:?}") };
        folder.write("map.toml", format!("[[imu]]\ntopic = \"/imu\"\naccel = {accel}\n").as_bytes());
        folder.write(&format!("{name}.mcap"), &json_recording(message));
        let layout = folder.say(&format!("config layout {name}.mcap -c map.toml")).ok().json();
        let lines = layout["configById"]["Plot!acceleration0"]["paths"].as_array().unwrap();
        let shown: Vec<_> = lines.iter().map(|line| line["value"].as_str().unwrap()).collect();
        let on = |topic: &str| axes.map(|axis| format!("{topic}.{axis}"));
        assert_eq!(shown, [on("/imu"), on("/imu/stillpoint/corrected")].concat());
    }
}

/// A recording of one message, again and again.
fn json_recording(message: &str) -> Vec<u8> {
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let channel = writer.add_channel(0, "/imu", "json", &BTreeMap::new()).unwrap();
    for i in 0..200_u32 {
        let time = 1_700_000_000_000_000_000 + u64::from(i) * 10_000_000;
        let header =
            mcap::records::MessageHeader { channel_id: channel, sequence: i, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, message.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn several_imus_have_a_tab_each() {
    use stillpoint::report::{LayoutImu, layout};
    let imu = |name: &str| LayoutImu { name: name.into(), ..LayoutImu::default() };
    let layout = layout(&[imu("/front"), imu("/re\"ar`${x}")]);
    let tabs = layout["configById"]["Tab!imus"]["tabs"].as_array().unwrap();
    assert_eq!(tabs.len(), 2);
    assert_eq!(layout["layout"], "Tab!imus");
    let code = layout["userNodes"]["stillpoint-bands-1"]["sourceCode"].as_str().unwrap();
    assert!(code.contains("[\"/rear{x}/stillpoint/calibration\"]"), "a name cannot leave its string: {code}");
}
