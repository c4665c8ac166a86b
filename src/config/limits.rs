//! Limits of what is taken from outside. What bites is said by the name of its key.

use serde::{Deserialize, Serialize};

use crate::record;

/// What is taken of a recording and of viewers, at most.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Longest chunk that is opened, compressed or not, in MiB.
    pub chunk_mib: u64,
    /// All chunks together are opened to so many times the recording's length, beyond the first 256 MiB.
    pub ratio: u64,
    /// Longest record that is held, in MiB.
    pub record_mib: u64,
    /// Longest schema, channel or metadata record that is read, in MiB.
    pub definition_mib: u64,
    /// What all schemas and channels may take together, in MiB.
    pub definitions_mib: u64,
    /// Channels that a recording may have.
    pub channels: u64,
    /// Viewers at a time.
    pub viewers: usize,
    /// Longest message of a viewer, finished or not, and longest that viewers are shown, in KiB.
    pub viewer_kib: usize,
    /// Messages that viewers are shown in a second.
    pub viewer_rate: u32,
}

const MIB: u64 = 1 << 20;

impl Default for Limits {
    fn default() -> Self {
        let record::Limits { chunk, ratio, record, definition, definitions, channels } = record::Limits::default();
        Self {
            chunk_mib: chunk / MIB,
            ratio,
            record_mib: record / MIB,
            definition_mib: definition / MIB,
            definitions_mib: definitions / MIB,
            channels,
            viewers: 48,
            viewer_kib: 1024,
            viewer_rate: 12_800,
        }
    }
}

impl Limits {
    /// Those of recordings, which determine what is learned.
    pub fn of_recordings(&self) -> record::Limits {
        record::Limits {
            chunk: self.chunk_mib.saturating_mul(MIB),
            ratio: self.ratio,
            record: self.record_mib.saturating_mul(MIB),
            definition: self.definition_mib.saturating_mul(MIB),
            definitions: self.definitions_mib.saturating_mul(MIB),
            channels: self.channels,
        }
    }

    /// The same for everybody who watches: what is learned does not depend on it.
    pub(super) fn without_viewers(&self) -> Self {
        let Self { viewers, viewer_kib, viewer_rate, .. } = Self::default();
        Self { viewers, viewer_kib, viewer_rate, ..self.clone() }
    }
}
