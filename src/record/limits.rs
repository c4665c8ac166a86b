//! What is taken of a recording at most: little enough that no file exhausts a machine, more than recorders write.

use super::records::ChunkHeader;
use super::wire::op;

const MIB: u64 = 1 << 20;

/// Limits of a recording. What is beyond one is damage that names it, and the rest is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Longest chunk that is opened, compressed or not, in bytes.
    pub chunk: u64,
    /// All chunks together are opened to so many times the recording's length, as far as that has come, …
    pub ratio: u64,
    /// Longest record that is held, in bytes.
    pub record: u64,
    /// Longest schema, channel or metadata record that is read, in bytes.
    pub definition: u64,
    /// Bytes that all schemas and channels may take together.
    pub definitions: u64,
    /// Channels that a recording may have.
    pub channels: u64,
}

/// … and to so much more.
const GRACE: u64 = 256 * MIB;

impl Default for Limits {
    fn default() -> Self {
        Self {
            chunk: 64 * MIB,
            ratio: 250,
            record: 64 * MIB,
            definition: 4 * MIB,
            definitions: 16 * MIB,
            channels: 1 << 16,
        }
    }
}

impl Limits {
    /// Why a chunk that ends at byte `end` is not opened, if so much was opened before; by what its head says.
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

    /// Why a schema, channel or metadata record of so many bytes is not read.
    pub(super) fn refuse_definition(&self, opcode: u8, length: u64) -> String {
        let what = match opcode {
            op::SCHEMA => "schema",
            op::CHANNEL => "channel",
            _ => "metadata",
        };
        let most = self.definition;
        format!("a {what} record of {length} bytes: those of more than {most} are not read (limits.definition_mib)")
    }

    /// Whether so many bytes are too many to have come out of a recording that is so long.
    pub fn exceeds_ratio(&self, opened: u64, length: u64) -> bool {
        opened > length.saturating_mul(self.ratio).saturating_add(GRACE)
    }
}
