//! Content of the summary section, kept until its CRC is known. In a conflict, the data section is trusted more.

use crc32fast::Hasher;

use crate::record::frame_window::Frame;
use crate::record::wire::{FRAME, Fields, op};
use crate::record::{Channel, Inventory, Limits, Schema};

/// Content of the summary section, kept until its CRC is known.
#[derive(Default)]
pub(super) struct SummarySection {
    /// Whether DataEnd has been passed.
    pub(super) begun: bool,
    /// Memory of the records below, in bytes.
    pub(super) kept: u64,
    pub(super) crc: Hasher,
    pub(super) schemas: Vec<Schema>,
    pub(super) channels: Vec<Channel>,
    pub(super) private: Vec<(u8, Vec<u8>)>,
}

/// What became of a record of the summary section.
pub(super) enum RecordVerdict {
    /// It is kept.
    Kept,
    /// The data says the same, or it is of no use.
    Passed,
    Malformed,
}

/// Agreement of the summary section with the CRC in its footer.
pub(super) enum CrcVerdict {
    Sound,
    Wrong,
    /// The footer has none.
    Malformed,
}

impl SummarySection {
    /// Memory of the records, in bytes, once this one is taken.
    ///
    /// # Errors
    /// If that is more than a summary may take.
    pub(super) fn room_for(&self, frame: Frame, limits: &Limits) -> Result<u64, String> {
        let is_kept = matches!(frame.opcode, op::SCHEMA | op::CHANNEL | 0x80..);
        let kept = self.kept + if is_kept { frame.length + 256 } else { 0 };
        let most = limits.definitions.saturating_mul(2);
        if kept > most {
            return Err(format!(
                "a summary with more than {most} bytes of definitions: it is not used (limits.definitions_mib)"
            ));
        }
        Ok(kept)
    }

    /// Takes a whole record other than the footer.
    pub(super) fn take_record(&mut self, opcode: u8, whole: &[u8], data: &Inventory) -> RecordVerdict {
        self.crc.update(whole);
        let body = whole.get(FRAME..).unwrap_or_default();
        match opcode {
            op::SCHEMA => match Schema::parse(body) {
                None => return RecordVerdict::Malformed,
                Some(schema) if data.has_schema(&schema) => return RecordVerdict::Passed,
                Some(schema) => self.schemas.push(schema),
            },
            op::CHANNEL => match Channel::parse(body) {
                None => return RecordVerdict::Malformed,
                Some(channel) if data.has_channel(&channel) => return RecordVerdict::Passed,
                Some(channel) => self.channels.push(channel),
            },
            op::HEADER..=op::DATA_END => return RecordVerdict::Passed,
            opcode => self.private.push((opcode, whole.to_vec())),
        }
        RecordVerdict::Kept
    }

    /// Takes the footer, which ends the section.
    pub(super) fn close(&mut self, footer: &[u8]) -> CrcVerdict {
        // The CRC covers the footer up to the CRC itself.
        self.crc.update(footer.get(..FRAME + 16).unwrap_or_default());
        match Fields(footer.get(FRAME + 16..).unwrap_or_default()).u32() {
            None => CrcVerdict::Malformed,
            Some(stored) if stored != 0 && stored != self.crc.clone().finalize() => CrcVerdict::Wrong,
            Some(_) => CrcVerdict::Sound,
        }
    }
}
