//! Evidence that a recording on disk gives of its sensors, ready to be merged.

use std::collections::BTreeMap;
use std::path::Path;

use crate::Error;
use crate::config::Config;
use crate::merge::{Identity, Merge};
use crate::report::Findings;
use crate::run::input::recording::Watch;
use crate::run::input::splits::Input;
use crate::run::inspect::{Found, findings};

/// Properties that distinguish sensors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SensorKey(Vec<Part>);

/// One such property.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    Topic,
    Name,
    FrameId,
    /// Name of the folder that holds the recording.
    Folder,
    /// Entry of the metadata of its channel.
    Metadata(String),
}

/// Evidence of one recording.
#[derive(Debug)]
pub struct Gathered {
    /// Evidence of its sensors.
    pub evidence: Merge,
    /// Configuration that its annotations were made with, as TOML, if they were read; empty if they do not tell.
    pub annotated_with: Option<String>,
    /// Number of damaged places.
    pub damages: u64,
}

impl SensorKey {
    /// Parses properties separated by commas.
    ///
    /// # Errors
    ///
    /// If one of them is unknown.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let part = |name: &str| match name.trim() {
            "topic" => Ok(Part::Topic),
            "name" => Ok(Part::Name),
            "frame-id" => Ok(Part::FrameId),
            "folder" => Ok(Part::Folder),
            "serial" => Ok(Part::Metadata("serial".to_owned())),
            other => match other.strip_prefix("metadata:") {
                Some(key) if !key.is_empty() => Ok(Part::Metadata(key.to_owned())),
                _ => Err(Error::Usage(format!(
                    "--by {other:?}: sensors are told apart by topic, name, frame-id, folder, serial, metadata:KEY"
                ))),
            },
        };
        text.split(',').map(part).collect::<Result<_, _>>().map(Self)
    }

    /// Key of an IMU in the recording at this path.
    fn of(&self, path: &Path, imu: &Findings, found: &Found) -> Result<String, Error> {
        let part = |part: &Part| {
            Ok(match part {
                Part::Topic => imu.topic.clone(),
                Part::Name => imu.name.clone(),
                Part::FrameId => Identity::frame_of(imu).to_owned(),
                Part::Metadata(key) => {
                    let entries = found.metadata.get(&imu.topic);
                    let value = entries.and_then(|entries| entries.get(key)).filter(|value| !value.is_empty());
                    value.cloned().ok_or_else(|| Error::input(path, no_metadata(&imu.topic, key, entries)))?
                }
                Part::Folder => {
                    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
                    let folder = whole.parent().and_then(Path::file_name).unwrap_or_default();
                    folder.to_string_lossy().into_owned()
                }
            })
        };
        Ok(self.0.iter().map(part).collect::<Result<Vec<_>, Error>>()?.join(" "))
    }
}

fn no_metadata(topic: &str, key: &str, entries: Option<&BTreeMap<String, String>>) -> String {
    let known: Vec<_> = entries.into_iter().flatten().map(|(key, _)| key.as_str()).collect();
    let known = match known.as_slice() {
        [] => "it has none; a sidecar never has".to_owned(),
        known => format!("it has {}", known.join(", ")),
    };
    format!("the metadata of the channel {topic} has no {key:?} to tell its sensor by: {known}")
}

/// Gathers the findings of a recording or sidecar; a raw recording is learned first.
///
/// # Errors
///
/// As [`findings`].
pub fn gather(input: &Input, config: &Config, by: &SensorKey, watch: Watch<'_>) -> Result<Gathered, Error> {
    let found = findings(input, config, watch)?;
    let mut evidence = Merge::default();
    let mut times: BTreeMap<String, usize> = BTreeMap::new();
    for imu in &found.imus {
        let key = by.of(input.path(), imu, &found)?;
        *times.entry(key.clone()).or_default() += 1;
        evidence.join(Merge::of(&key, imu));
    }
    if let Some((key, _)) = times.iter().find(|(_, times)| **times > 1) {
        let why =
            format!("several of its IMUs are called {key:?}: tell them apart with --by topic, or --by name,frame-id");
        return Err(Error::input(input.path(), why));
    }
    Ok(Gathered { evidence, annotated_with: found.annotated_with, damages: found.damages })
}
