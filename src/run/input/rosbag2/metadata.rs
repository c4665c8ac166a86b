//! The `metadata.yaml` of a rosbag2 recording: its file names, and the same document with the annotations in it. All
//! other content stays as it is. [`Bag`](super::Bag) reads and writes the file.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use crate::record::{Block, Inventory, Topic};
use crate::report::yaml;
use crate::topic;

/// The only key of the document.
const ROOT: &str = "rosbag2_bagfile_information";

/// Used content of a `metadata.yaml`.
#[derive(Clone, Debug)]
pub(super) struct Metadata {
    text: String,
    /// Content of the root key.
    info: Value,
    /// Names of the splits, in order.
    pub(super) files: Vec<String>,
}

/// Contents of one split of the result.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contents {
    /// First and last log time, in nanoseconds.
    pub(crate) span: Option<(u64, u64)>,
    /// Messages by topic.
    pub(crate) counts: BTreeMap<String, u64>,
}

impl Metadata {
    /// Parses a `metadata.yaml`; the error says why it cannot be used.
    pub(super) fn parse(text: String) -> Result<Self, String> {
        let unknown = |why: &str| format!("its metadata.yaml is none ({why}); name a .mcap file in it");
        let document = serde_saphyr::from_str::<Value>(&text);
        let mut document = document.map_err(|e| unknown(e.to_string().lines().next().unwrap_or_default()))?;
        let info = document.get_mut(ROOT).ok_or_else(|| unknown(&format!("it has no `{ROOT}`")))?.take();
        if !info.is_object() {
            return Err(unknown(&format!("its `{ROOT}` is empty")));
        }
        let said = |key: &str| info.get(key).and_then(Value::as_str).unwrap_or_default();
        let storage = said("storage_identifier");
        // A recorder that is stopped early may leave it empty: the names of the files say it, too.
        if !storage.is_empty() && storage != "mcap" {
            return Err(format!("its storage is `{storage}`, not mcap; convert it with `ros2 bag convert`"));
        }
        let how = match said("compression_mode").to_ascii_uppercase().as_str() {
            "FILE" => Some("files are compressed as a whole"),
            "MESSAGE" => Some("messages are compressed one by one"),
            _ => None,
        };
        if let Some(how) = how {
            let format = said("compression_format");
            return Err(format!("its {how} ({format}); decompress it with `ros2 bag convert`"));
        }
        let paths = info.get("relative_file_paths").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        // Early versions put the folder name in front.
        let name = |path: &Value| Some(Path::new(path.as_str()?).file_name()?.to_str()?.to_owned());
        let files: Option<Vec<String>> = paths.iter().map(name).collect();
        let files = files
            .filter(|files| !files.is_empty())
            .ok_or_else(|| unknown("its `relative_file_paths` name no files"))?;
        if let Some(other) = files.iter().find(|file| storage.is_empty() && !file.ends_with(".mcap")) {
            return Err(format!(
                "its metadata.yaml names no storage, and `{other}` is no .mcap file; convert it with `ros2 bag convert`"
            ));
        }
        Ok(Self { text, info, files })
    }

    /// Text of the document, unchanged.
    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Text of the document for the annotated splits.
    pub(super) fn annotated(&self, splits: &[Contents], own: &[Topic]) -> String {
        let mut all = Contents::default();
        splits.iter().for_each(|split| all.add(split));
        let mut info = self.info.clone();
        info["relative_file_paths"] = json!(self.files);
        all.describe(&mut info);
        let files = info.get_mut("files").and_then(Value::as_array_mut);
        for (file, (name, contents)) in files.into_iter().flatten().zip(self.files.iter().zip(splits)) {
            if !file.is_object() {
                *file = json!({});
            }
            file["path"] = json!(name);
            contents.describe(file);
        }
        let count = |topic: &str| all.counts.get(topic).copied().unwrap_or_default();
        let mut topics = match info["topics_with_message_count"].take() {
            Value::Array(topics) => topics,
            _ => Vec::new(),
        };
        topics.retain(Value::is_object);
        let name = |topic: &Value| topic["topic_metadata"]["name"].as_str().unwrap_or_default().to_owned();
        for topic in &mut topics {
            topic["message_count"] = json!(count(&name(topic)));
        }
        let listed: Vec<_> = topics.iter().map(name).collect();
        let version = info["version"].as_u64().unwrap_or_default();
        let new = own.iter().filter(|topic| !listed.contains(&topic.name));
        let described = |topic: &Topic| {
            let mut described = describe_topic(topic, version);
            // A subscriber to the source topic also subscribes to the corrected one.
            let source = topic::corrected_imu(&topic.name);
            let source = source.and_then(|source| topics.iter().find(|listed| name(listed) == source));
            if let Some(offered) = source.and_then(|source| source["topic_metadata"].get("offered_qos_profiles")) {
                described["offered_qos_profiles"] = offered.clone();
            }
            json!({"topic_metadata": described, "message_count": count(&topic.name)})
        };
        let new: Vec<_> = new.map(described).collect();
        topics.extend(new);
        info["topics_with_message_count"] = Value::Array(topics);
        yaml::document(&json!({ ROOT: info }))
    }
}

impl Contents {
    /// Contents of a split without its annotations.
    pub(crate) fn of(inventory: &Inventory) -> Self {
        let mut counts = BTreeMap::new();
        for (&id, channel) in inventory.channels() {
            *counts.entry(channel.topic.clone()).or_default() += inventory.messages(id);
        }
        Self { span: inventory.span(), counts }
    }

    /// Adds the annotations of a block.
    pub(crate) fn count(&mut self, topics: &[Topic], block: &Block) {
        for topic in block.annotations.iter().filter_map(|annotation| topics.get(annotation.topic)) {
            match self.counts.get_mut(&topic.name) {
                Some(count) => *count += 1,
                None => _ = self.counts.insert(topic.name.clone(), 1),
            }
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for (topic, count) in &other.counts {
            *self.counts.entry(topic.clone()).or_default() += count;
        }
        self.span = match (self.span, other.span) {
            (Some((from, until)), Some((start, end))) => Some((from.min(start), until.max(end))),
            (span, other) => span.or(other),
        };
    }

    /// Writes message count, duration and start time of the recording or of one of its files.
    fn describe(&self, node: &mut Value) {
        node["message_count"] = json!(self.counts.values().sum::<u64>());
        if let Some((from, until)) = self.span {
            node["duration"] = json!({"nanoseconds": until - from});
            node["starting_time"] = json!({"nanoseconds_since_epoch": from});
        }
    }
}

/// A topic of Stillpoint as rosbag2 writes it in this version of the file (`rosbag2_storage/yaml.hpp`).
fn describe_topic(topic: &Topic, version: u64) -> Value {
    let mut described = json!({
        "name": topic.name,
        "type": topic.schema_name,
        "serialization_format": topic.message_encoding,
    });
    match version {
        ..4 => {}
        4..9 => described["offered_qos_profiles"] = json!(""),
        _ => described["offered_qos_profiles"] = json!([]),
    }
    if version >= 7 {
        described["type_description_hash"] = json!("");
    }
    described
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topic::Kind;

    const TEXT: &str = "\
rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  duration:
    nanoseconds: 5
  starting_time:
    nanoseconds_since_epoch: 10
  message_count: 2
  topics_with_message_count:
    - topic_metadata:
        name: /imu
        type: sensor_msgs/msg/Imu
        serialization_format: cdr
        offered_qos_profiles:
          - history: keep_last
            deadline:
              sec: 9223372036
              nsec: 854775807
      message_count: 2
  compression_format: \"\"
  compression_mode: \"\"
  relative_file_paths:
    - bag/a.mcap
  files:
    - path: a.mcap
      starting_time:
        nanoseconds_since_epoch: 10
      duration:
        nanoseconds: 5
      message_count: 2
  custom_data:
    robot: \"07\"
    shift: \"yes\"
  from_the_future: [1, two]
";

    #[test]
    fn a_storage_that_is_not_named_is_told_from_the_names_of_the_files() {
        let named = |storage: &str, file: &str| {
            let info = format!("{{storage_identifier: {storage}, relative_file_paths: [{file}]}}");
            Metadata::parse(format!("{ROOT}: {info}")).map(|metadata| metadata.files)
        };
        for empty in ["", "\"\"", "null"] {
            assert_eq!(named(empty, "a.mcap"), Ok(vec!["a.mcap".to_owned()]), "{empty:?}");
            assert!(named(empty, "a.db3").unwrap_err().contains("`a.db3` is no .mcap"), "{empty:?}");
        }
        assert!(named("sqlite3", "a.db3").unwrap_err().contains("`sqlite3`"));
    }

    #[test]
    fn what_is_not_ours_survives_and_annotations_are_listed() {
        let metadata = Metadata::parse(TEXT.to_owned()).unwrap();
        assert_eq!(metadata.files, ["a.mcap"]);
        let counts = BTreeMap::from([("/imu".to_owned(), 3), (topic::of("/imu", Kind::Segment), 4)]);
        let own = Topic {
            name: topic::of("/imu", Kind::Segment),
            schema_name: "stillpoint_msgs/msg/Segment".to_owned(),
            schema_encoding: "ros2msg".into(),
            schema: Vec::new(),
            message_encoding: "cdr".into(),
            metadata: BTreeMap::new(),
        };
        let corrected = Topic { name: topic::of("/imu", Kind::Corrected), ..own.clone() };
        let written = metadata.annotated(&[Contents { span: Some((7, 20)), counts }], &[own, corrected]);
        let load = |text: &str| serde_saphyr::from_str::<Value>(text).unwrap();
        let (before, after) = (load(TEXT), load(&written));
        let (before, after) = (&before[ROOT], &after[ROOT]);
        for key in ["version", "storage_identifier", "custom_data", "from_the_future", "compression_mode"] {
            assert_eq!(before[key], after[key], "{key}");
        }
        let topics = |info: &Value| info["topics_with_message_count"].as_array().unwrap().len();
        assert_eq!((topics(before), topics(after)), (1, 3));
        let offered =
            |n: usize| after["topics_with_message_count"][n]["topic_metadata"]["offered_qos_profiles"].clone();
        assert_eq!((offered(1), offered(2)), (json!([]), offered(0)));
        let imu = |info: &Value| info["topics_with_message_count"][0]["topic_metadata"].clone();
        assert_eq!(imu(before), imu(after));
        assert_eq!(after["custom_data"], json!({"robot": "07", "shift": "yes"}));
        assert_eq!(after["message_count"].as_u64(), Some(7));
        assert_eq!(after["files"][0]["message_count"].as_u64(), Some(7));
        assert_eq!(after["duration"]["nanoseconds"].as_u64(), Some(13));
        assert_eq!(after["files"][0]["starting_time"]["nanoseconds_since_epoch"].as_u64(), Some(7));
        assert_eq!(after["relative_file_paths"][0].as_str(), Some("a.mcap"));
        assert_eq!(after["topics_with_message_count"][1]["message_count"].as_u64(), Some(4));
    }

    #[test]
    fn what_cannot_be_read_is_refused_with_the_true_reason() {
        let refused = |from: &str, to: &str| Metadata::parse(TEXT.replace(from, to)).unwrap_err();
        assert!(refused("identifier: mcap", "identifier: sqlite3").contains("sqlite3"));
        assert!(refused("mode: \"\"", "mode: FILE").contains("compressed as a whole"));
        assert!(refused("mode: \"\"", "mode: message").contains("one by one"));
        assert!(refused("- bag/a.mcap", "[]").contains("relative_file_paths"));
        assert!(refused("rosbag2", "rosbag3").contains(ROOT));
        assert!(Metadata::parse(String::new()).is_err() && Metadata::parse("a: [".to_owned()).is_err());
    }
}
