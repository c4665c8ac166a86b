//! What a recording on disk says of its sensors, as evidence that adds up.

use std::collections::BTreeMap;
use std::path::Path;

use crate::Error;
use crate::config::Config;
use crate::merge::{Identity, Merge};
use crate::report::Findings;
use crate::run::input::recording::Watch;
use crate::run::input::splits::Input;
use crate::run::inspect::findings;

/// What tells sensors apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SensorKey(Vec<Part>);

/// One thing that does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Topic,
    Name,
    FrameId,
    /// The one that the recording is in.
    Folder,
}

/// Evidence of one recording.
#[derive(Debug)]
pub struct Gathered {
    /// What it says of its sensors.
    pub evidence: Merge,
    /// How many damages it has.
    pub damages: u64,
}

impl SensorKey {
    /// Reads parts that are separated by commas.
    ///
    /// # Errors
    ///
    /// If one of them is none.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let part = |name: &str| match name.trim() {
            "topic" => Ok(Part::Topic),
            "name" => Ok(Part::Name),
            "frame-id" => Ok(Part::FrameId),
            "folder" => Ok(Part::Folder),
            other => {
                Err(Error::Usage(format!("--by {other:?}: sensors are told apart by topic, name, frame-id, folder")))
            }
        };
        text.split(',').map(part).collect::<Result<_, _>>().map(Self)
    }

    /// The key of an IMU in the recording on this path.
    fn of(&self, path: &Path, imu: &Findings) -> String {
        let part = |part: &Part| match part {
            Part::Topic => imu.topic.clone(),
            Part::Name => imu.name.clone(),
            Part::FrameId => Identity::frame_of(imu).to_owned(),
            Part::Folder => {
                let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
                let folder = whole.parent().and_then(Path::file_name).unwrap_or_default();
                folder.to_string_lossy().into_owned()
            }
        };
        self.0.iter().map(part).collect::<Vec<_>>().join(" ")
    }
}

/// Reads what is known of a recording or sidecar; of a raw recording, learns it first.
///
/// # Errors
///
/// As [`findings`].
pub fn gather(input: &Input, config: &Config, by: &SensorKey, watch: Watch<'_>) -> Result<Gathered, Error> {
    let found = findings(input, config, watch)?;
    let mut evidence = Merge::default();
    let mut times: BTreeMap<String, usize> = BTreeMap::new();
    for imu in &found.imus {
        let key = by.of(input.path(), imu);
        *times.entry(key.clone()).or_default() += 1;
        evidence.join(Merge::of(&key, imu));
    }
    if let Some((key, _)) = times.iter().find(|(_, times)| **times > 1) {
        let why =
            format!("several of its IMUs are called {key:?}: tell them apart with --by topic, or --by name,frame-id");
        return Err(Error::input(input.path(), why));
    }
    Ok(Gathered { evidence, damages: found.damages })
}
