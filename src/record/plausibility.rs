//! Shape of records: lengths that fit an opcode, and the length that a record's own content implies. With these,
//! corrupt lengths are told from sound ones, and records from bytes that merely look like one.

use super::wire::{FRAME, op};

/// Longest plausible record, in bytes. It may be too long to be held in memory.
const LIMIT: u64 = 1 << 30;
/// Longest plausible attachment, in bytes. Attachments are never held in memory.
const LONGEST_ATTACHMENT: u64 = 1 << 48;

/// Most bytes of unknown fields that are accepted at the end of a record after damage.
pub(super) const SPARE: u64 = 4096;

/// Whether a record of this opcode can have a body of this length. A chunk that is still open claims `u64::MAX`.
pub(super) fn fits(opcode: u8, length: u64) -> bool {
    let (least, most) = match opcode {
        0 => return false,
        op::HEADER | op::METADATA => (8, LIMIT),
        op::FOOTER => (20, 20),
        op::SCHEMA => (14, LIMIT),
        op::CHANNEL => (16, LIMIT),
        op::MESSAGE => (22, LIMIT),
        op::CHUNK if length == u64::MAX => return true,
        op::CHUNK => (40, 2 * LIMIT),
        op::MESSAGE_INDEX => (6, LIMIT),
        op::CHUNK_INDEX => (64, LIMIT),
        op::ATTACHMENT => (36, LONGEST_ATTACHMENT),
        op::ATTACHMENT_INDEX => (48, LIMIT),
        op::STATISTICS => (46, LIMIT),
        op::METADATA_INDEX => (20, LIMIT),
        op::SUMMARY_OFFSET => (17, LIMIT),
        // The specification does not allow to extend it, but all readers read it if it is extended.
        op::DATA_END => (4, SPARE + 4),
        _ => (0, LIMIT),
    };
    (least..=most).contains(&length)
}

/// Whether a record can begin with these bytes. At the end of a recording there may be few of them.
pub(super) fn begins(bytes: &[u8]) -> bool {
    match (bytes.first(), head(bytes)) {
        (_, Some((opcode, length))) => fits(opcode, length),
        (Some(&opcode), None) => is_defined(opcode),
        (None, None) => true,
    }
}

/// Whether MCAP defines this opcode.
pub(super) fn is_defined(opcode: u8) -> bool {
    (op::HEADER..=op::DATA_END).contains(&opcode)
}

/// Opcode and length at the beginning of a record.
pub(super) fn head(bytes: &[u8]) -> Option<(u8, u64)> {
    let (opcode, rest) = bytes.split_first()?;
    Some((*opcode, u64::from_le_bytes(*rest.first_chunk()?)))
}

/// Length of a record's body, as its content implies it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Measure {
    /// The body has this length.
    Says(u64),
    /// The length is known only after this many bytes of the body.
    Needs(u64),
    /// The content does not state the length.
    Silent,
}

/// Measures a record by the beginning of its body.
pub(super) fn measure(opcode: u8, body: &[u8]) -> Measure {
    let mut ruler = Ruler { body, at: 0 };
    let measured = match opcode {
        op::HEADER | op::METADATA => ruler.blobs(0, 2),
        op::SCHEMA => ruler.blobs(2, 3),
        op::CHANNEL => ruler.blobs(4, 3),
        op::MESSAGE_INDEX => ruler.blobs(2, 1),
        op::CHUNK => ruler.blobs(28, 1).and_then(|()| ruler.bytes()),
        op::ATTACHMENT => ruler.blobs(16, 2).and_then(|()| ruler.bytes()).map(|()| ruler.skip(4)),
        op::FOOTER => return Measure::Says(20),
        op::DATA_END => return Measure::Says(4),
        _ => return Measure::Silent,
    };
    measured.map_or_else(Measure::Needs, |()| Measure::Says(ruler.at))
}

/// Cursor that skips fields without reading their content. An error is the number of bytes needed.
struct Ruler<'a> {
    body: &'a [u8],
    at: u64,
}

impl Ruler<'_> {
    fn skip(&mut self, length: u64) {
        self.at = self.at.saturating_add(length);
    }

    /// Skips `fixed` bytes, and `count` strings with their lengths.
    fn blobs(&mut self, fixed: u64, count: usize) -> Result<(), u64> {
        self.skip(fixed);
        for _ in 0..count {
            let length = u32::from_le_bytes(self.take()?);
            self.skip(length.into());
        }
        Ok(())
    }

    /// Skips bytes with a 64-bit length before them.
    fn bytes(&mut self) -> Result<(), u64> {
        let length = u64::from_le_bytes(self.take()?);
        self.skip(length);
        Ok(())
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], u64> {
        let rest = usize::try_from(self.at).ok().and_then(|at| self.body.get(at..));
        let taken = rest.and_then(|rest| rest.first_chunk().copied());
        self.skip(N as u64);
        taken.ok_or(self.at)
    }
}

/// Offset of the first byte after a record that begins at `offset` and has a body of this length.
pub(super) fn end(offset: u64, length: u64) -> u64 {
    offset.saturating_add(FRAME as u64).saturating_add(length)
}
