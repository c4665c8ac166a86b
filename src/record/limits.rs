//! Limits on the sizes in a recording: low enough that no file exhausts a machine, higher than what recorders write.

use super::records::ChunkHeader;
use super::wire::op;

const MIB: u64 = 1 << 20;

/// Limits of a recording. Whatever exceeds one is reported as damage that names the limit, and the rest is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Longest chunk that is opened, compressed or not, in bytes.
    pub chunk: u64,
    /// Most decompressed bytes of all compressed chunks together, as a multiple of the recording's length so far. A
    /// fixed 256 MiB is allowed on top.
    pub ratio: u64,
    /// Longest record that is held in memory, in bytes.
    pub record: u64,
    /// Longest schema, channel or metadata record that is read, in bytes.
    pub definition: u64,
    /// Memory that all schemas and channels may take together, in bytes.
    pub definitions: u64,
    /// Memory that the places and names of all attachments and metadata records may take, in bytes.
    pub attachments: u64,
    /// Largest number of channels.
    pub channels: u64,
}

/// Decompressed bytes allowed beyond [`Limits::ratio`].
const GRACE: u64 = 256 * MIB;

impl Default for Limits {
    fn default() -> Self {
        Self {
            chunk: 64 * MIB,
            ratio: 250,
            record: 64 * MIB,
            definition: 4 * MIB,
            definitions: 16 * MIB,
            attachments: 16 * MIB,
            channels: 1 << 16,
        }
    }
}

impl Limits {
    /// Refuses a chunk by its header, with the reason. It ends at byte `end`; `opened` bytes were decompressed before
    /// it.
    pub(super) fn refuse_chunk(&self, header: &ChunkHeader<'_>, opened: u64, end: u64) -> Result<(), String> {
        let Self { chunk, ratio, .. } = *self;
        let (size, inflated) = (header.uncompressed_size, header.inflated());
        if size > chunk {
            return Err(format!(
                "a chunk that claims {size} uncompressed bytes: those of more than {chunk} are not opened (limits.chunk_mib)"
            ));
        }
        if inflated > 0 && self.exceeds_ratio(opened.saturating_add(inflated), end) {
            return Err(format!(
                "a chunk that claims {size} uncompressed bytes, with which the recording opens to more than {ratio} times its \
                 length: it is not opened (limits.ratio)"
            ));
        }
        Ok(())
    }

    /// Reason why a schema, channel or metadata record of this length is not read.
    pub(super) fn refuse_definition(&self, opcode: u8, length: u64) -> String {
        let what = match opcode {
            op::SCHEMA => "schema",
            op::CHANNEL => "channel",
            _ => "metadata",
        };
        let most = self.definition;
        format!("a {what} record of {length} bytes: those of more than {most} are not read (limits.definition_mib)")
    }

    /// Whether `opened` decompressed bytes are too many for a recording of this length.
    pub fn exceeds_ratio(&self, opened: u64, length: u64) -> bool {
        opened > length.saturating_mul(self.ratio).saturating_add(GRACE)
    }
}
