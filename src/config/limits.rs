//! Limits of outside data. A message about an exceeded limit names its key.

use serde::{Deserialize, Serialize};

use crate::record;

/// Limits of recordings and viewers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Longest chunk that is opened, compressed or not, in MiB.
    pub chunk_mib: u64,
    /// Most decompressed bytes of all chunks, as a multiple of the recording's length, beyond the first 256 MiB.
    pub ratio: u64,
    /// Longest record that is held, in MiB.
    pub record_mib: u64,
    /// Longest schema, channel or metadata record that is read, in MiB.
    pub definition_mib: u64,
    /// Total size of all schemas and channels, in MiB.
    pub definitions_mib: u64,
    /// Total size of the places and names of all attachments and metadata records, in MiB.
    pub attachments_mib: u64,
    /// Most channels of a recording.
    pub channels: u64,
    /// Most IMUs of a recording that no configuration names.
    pub imus: usize,
    /// Most viewers at a time.
    pub viewers: usize,
    /// Longest message from a viewer, finished or not, and to viewers, in KiB.
    pub viewer_kib: usize,
    /// Most messages per second that viewers are shown.
    pub viewer_rate: u32,
}

const MIB: u64 = 1 << 20;

impl Default for Limits {
    fn default() -> Self {
        let record::Limits { chunk, ratio, record, definition, definitions, attachments, channels } =
            record::Limits::default();
        Self {
            chunk_mib: chunk / MIB,
            ratio,
            record_mib: record / MIB,
            definition_mib: definition / MIB,
            definitions_mib: definitions / MIB,
            attachments_mib: attachments / MIB,
            channels,
            imus: 256,
            viewers: 48,
            viewer_kib: 1024,
            viewer_rate: 12_800,
        }
    }
}

impl Limits {
    /// Limits of recordings, which affect the findings.
    pub fn of_recordings(&self) -> record::Limits {
        record::Limits {
            chunk: self.chunk_mib.saturating_mul(MIB),
            ratio: self.ratio,
            record: self.record_mib.saturating_mul(MIB),
            definition: self.definition_mib.saturating_mul(MIB),
            definitions: self.definitions_mib.saturating_mul(MIB),
            attachments: self.attachments_mib.saturating_mul(MIB),
            channels: self.channels,
        }
    }

    /// The same with default limits of viewers, which do not affect the findings.
    pub(super) fn without_viewers(&self) -> Self {
        let Self { viewers, viewer_kib, viewer_rate, .. } = Self::default();
        Self { viewers, viewer_kib, viewer_rate, ..self.clone() }
    }
}
