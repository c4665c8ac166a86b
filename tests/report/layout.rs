//! The layout for viewers: every panel that is placed exists, and shows what the annotated recording holds.

use std::collections::{BTreeMap, BTreeSet};

use crate::common::Folder;
use serde_json::Value;

fn placed(layout: &Value, out: &mut Vec<String>) {
    match layout {
        Value::String(id) => out.push(id.clone()),
        layout => ["first", "second"].iter().for_each(|side| placed(&layout[side], out)),
    }
}

/// Every string that begins like a topic, anywhere: message paths.
fn paths(value: &Value, out: &mut BTreeSet<String>) {
    match value {
        Value::String(text) if text.starts_with('/') => {
            out.insert(text.clone());
        }
        Value::Array(items) => items.iter().for_each(|item| paths(item, out)),
        Value::Object(fields) => fields.values().for_each(|value| paths(value, out)),
        _ => {}
    }
}

/// The fields of each type in a ROS 2 schema, by name, with their types; the message's own type is "".
type Definitions = BTreeMap<String, BTreeMap<String, String>>;

fn definitions(text: &str) -> Definitions {
    let (mut current, mut found) = (String::new(), Definitions::new());
    for line in text.lines().map(|line| line.split('#').next().unwrap().trim()) {
        if let Some(next) = line.strip_prefix("MSG: ") {
            current = next.to_owned();
        } else if let (Some((kind, name)), false) = (line.split_once(' '), line.contains('=')) {
            let element = kind.split('[').next().unwrap().replacen("/msg/", "/", 1);
            found.entry(current.clone()).or_default().insert(name.trim().to_owned(), element);
        }
    }
    found
}

/// Whether a message has what a path names behind its topic.
fn leads_somewhere(definitions: &Definitions, path: &str) -> bool {
    let mut kind = String::new();
    path.split('.').skip(1).all(|name| {
        let field = definitions.get(&kind).and_then(|fields| fields.get(name.split('[').next().unwrap()));
        field.inspect(|next| kind = (*next).clone()).is_some()
    })
}

/// The types of what a recording has messages of, by topic.
fn recorded(folder: &Folder, name: &str) -> BTreeMap<String, Definitions> {
    let bytes = folder.read(name);
    let mut topics = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let channel = message.unwrap().channel.clone();
        topics.entry(channel.topic.clone()).or_insert_with(|| {
            let schema = channel.schema.clone().unwrap();
            definitions(std::str::from_utf8(&schema.data).unwrap())
        });
    }
    topics
}

/// Names that a script reads from messages.
fn read_by(code: &str) -> BTreeSet<&str> {
    const MESSAGES: [&str; 4] = ["message", "triad", "face", "mean"];
    let words = code.split(|c: char| !c.is_alphanumeric() && !"_.?".contains(c)).map(|word| word.split(['.', '?']));
    let of_messages = words.filter(|word| MESSAGES.contains(&word.clone().next().unwrap()));
    of_messages.flat_map(|word| word.skip(1)).filter(|name| !name.is_empty()).collect()
}

#[test]
fn every_panel_is_placed_once_and_shows_what_the_recording_holds() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o annotated.mcap --set output.corrected=causal").ok();
    let recorded = recorded(&folder, "annotated.mcap");
    for input in ["demo.mcap", "annotated.mcap"] {
        let layout = folder.say(&format!("config layout {input}")).ok().json();
        let panels = layout["configById"].as_object().unwrap();
        let mut ids = Vec::new();
        placed(&layout["layout"], &mut ids);
        assert_eq!(ids.iter().collect::<BTreeSet<_>>(), panels.keys().collect(), "placed and configured");
        assert_eq!(ids.len(), panels.len(), "a panel is placed twice");

        let mut derived = BTreeMap::new();
        for script in layout["userNodes"].as_object().unwrap().values() {
            let code = script["sourceCode"].as_str().unwrap();
            assert!(!code.contains("_TOPIC") && !code.contains("PLACE") && !code.contains("FRAME"), "{code}");
            let quoted = |after: &str| code.split(after).nth(1).unwrap().split(';').next().unwrap().split('"');
            let inputs: Vec<_> = quoted("export const inputs = ").skip(1).step_by(2).collect();
            let types: Vec<_> = inputs.iter().map(|topic| recorded.get(*topic).expect(topic)).collect();
            let fields: BTreeSet<_> = types.iter().flat_map(|types| types.values()).flat_map(BTreeMap::keys).collect();
            for name in read_by(code) {
                let is_of_any = ["x", "y", "z", "length"].contains(&name);
                assert!(is_of_any || fields.iter().any(|field| *field == name), "no {name} in {inputs:?}");
            }
            derived.insert(quoted("export const output = ").nth(1).unwrap(), code);
        }

        let mut shown = BTreeSet::new();
        paths(&layout["configById"], &mut shown);
        for topic in ["stillness", "segment", "corrected"] {
            let topic = format!("/imu/data_raw/stillpoint/{topic}.");
            assert!(shown.iter().any(|path| path.starts_with(&topic)), "{topic} is not shown");
        }
        for path in &shown {
            let topic = path.split('.').next().unwrap();
            match (recorded.get(topic), derived.get(topic)) {
                (Some(types), _) => assert!(leads_somewhere(types, path), "{path} leads nowhere"),
                (_, Some(code)) => {
                    let names = path.split('.').skip(1);
                    names.for_each(|name| assert!(code.contains(&format!("{name}:")), "{path}: no {name} in {code}"));
                }
                // The name of the IMU, by which the panel finds its diagnostics.
                _ => assert_eq!(path, "/imu/data_raw"),
            }
        }
        for unused in derived.keys().filter(|topic| !shown.iter().any(|path| path.starts_with(**topic))) {
            assert_eq!(panels["3D!gravity0"]["topics"][unused]["visible"], true, "{unused} is not shown");
        }
    }
    folder.say("annotate demo.mcap -o plain.mcap").ok();
    let layout = folder.say("config layout plain.mcap").ok().json();
    let mut shown = BTreeSet::new();
    paths(&layout["configById"], &mut shown);
    assert!(shown.contains("/imu/data_raw.linear_acceleration.x"), "{shown:?}");
    assert!(!shown.iter().any(|path| path.contains("corrected")), "corrected messages that are not there: {shown:?}");
    folder.say("config layout demo.mcap -o layout.json").ok();
    folder.say("config layout demo.mcap -o layout.json").ok();
    folder.write("layout.json", b"{}");
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
