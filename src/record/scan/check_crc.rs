//! Computation and check of the data section's CRC.

use super::Scan;
use crate::record::chunk::Opened;
use crate::record::frame_window::Frame;

impl Scan {
    /// Checks the CRC of the data section even if there are chunks. This is possible only if all of them are opened.
    pub fn verifying(mut self) -> Self {
        self.data_crc.demanded = true;
        self
    }

    /// Skips the next `length` bytes of the data section.
    pub(super) fn consume(&mut self, length: u64) {
        if self.data_crc.state.is_some() {
            let bytes = usize::try_from(length).ok().and_then(|length| self.window.buffered().get(..length));
            self.data_crc.update(bytes);
        }
        self.window.skip(length);
    }

    /// Continues after a chunk that was opened elsewhere.
    pub(super) fn pass_opened(&mut self, frame: Frame, opened: Opened) {
        let mut data_crc = std::mem::take(&mut self.data_crc);
        let length = frame.length.to_le_bytes();
        for bytes in [&[frame.opcode][..], &length, opened.body()] {
            data_crc.update(Some(bytes));
        }
        self.pass(frame);
        self.data_crc = data_crc;
        self.spent = Some(opened);
    }

    /// Checks the CRC in the DataEnd record. Skipped if damage was found, since the CRC is wrong then anyway.
    pub(super) fn check_data_crc(&mut self, frame: Frame, stored: u32) {
        let computed = self.data_crc.value().filter(|_| stored != 0 && self.inventory.damage == 0);
        if computed.is_some_and(|computed| computed != stored) {
            self.damage(
                frame.offset,
                0,
                "the CRC of all data in front does not hold: some of it is damaged, but nothing tells where",
            );
        }
        self.data_crc.update(None);
    }
}
