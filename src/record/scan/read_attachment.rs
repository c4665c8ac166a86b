//! Attachment records of the data section.

use crc32fast::Hasher;

use super::Scan;
use super::attachments::Attaching;
use super::search::HEAD;
use super::stage::Stage;
use crate::record::frame_window::{Frame, Stop};
use crate::record::inventory::NamedRecord;
use crate::record::records::AttachmentIndex;
use crate::record::wire::{FRAME, Fields};

impl Scan {
    pub(super) fn attachment_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let head = self.window.body(frame, HEAD)?;
        let mut fields = Fields(head);
        let index = AttachmentIndex::parse_attachment(&mut fields, frame.offset, frame.end() - frame.offset);
        let size = head.len() - fields.0.len();
        let room = frame.length.checked_sub(size as u64 + 4);
        match index.filter(|index| room.is_some_and(|room| index.data_size <= room)) {
            Some(index) => {
                let mut crc = Hasher::new();
                crc.update(head.get(..size).unwrap_or_default());
                self.consume((FRAME + size) as u64);
                let left = index.data_size;
                self.stage = Stage::Attaching(Attaching { frame, index, crc, left });
            }
            None => {
                self.reject(frame, "a malformed attachment record");
                self.pass(frame);
            }
        }
        Ok(())
    }

    /// Keeps the place of an attachment or metadata record, as long as there is room.
    pub(super) fn place_record(&mut self, frame: Frame, record: NamedRecord) {
        if let Some(what) = self.inventory.place(record, &self.limits) {
            self.damage(frame.offset, 0, what);
        }
    }

    /// Checks the CRC of an attachment, all of which has been seen.
    pub(super) fn attached(&mut self) {
        let Stage::Attaching(Attaching { frame, index, crc, .. }) = std::mem::take(&mut self.stage) else { return };
        let stored = Fields(self.window.buffered()).u32().unwrap_or_default();
        if stored == 0 || stored == crc.finalize() {
            self.place_record(frame, NamedRecord::Attachment(index));
        } else {
            self.reject(frame, format!("attachment `{}`: its CRC does not hold", index.name));
        }
        self.pass(frame);
    }
}
