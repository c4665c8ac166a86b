//! Attachments: never held in memory, and told from damaged ones by their CRC.

use crc32fast::Hasher;

use super::data_crc::DataCrc;
use super::search::HEAD;
use super::{Scan, Stage};
use crate::record::horizon::{Frame, Horizon, Stop};
use crate::record::records::AttachmentIndex;
use crate::record::wire::{FRAME, Fields};

/// An attachment whose CRC is being computed; it is never held in memory.
pub(super) struct Attaching {
    frame: Frame,
    index: AttachmentIndex,
    crc: Hasher,
    left: u64,
}

impl Attaching {
    /// Takes what is buffered, until all attached bytes have been seen and the stored CRC is buffered.
    pub(super) fn hash(&mut self, horizon: &mut Horizon, data: &mut DataCrc) -> Result<(), Stop> {
        while self.left > 0 {
            horizon.peek(1)?;
            let buffered = horizon.buffered();
            let taken = buffered.get(..self.left.min(buffered.len() as u64) as usize).unwrap_or_default();
            self.crc.update(taken);
            data.update(Some(taken));
            let taken = taken.len() as u64;
            self.left -= taken;
            horizon.skip(taken);
        }
        horizon.peek(4).map(|_| ())
    }
}

impl Scan {
    pub(super) fn attachment_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let head = self.horizon.body(frame, HEAD)?;
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

    /// All of an attachment has been seen.
    pub(super) fn attached(&mut self) {
        let Stage::Attaching(Attaching { frame, index, crc, .. }) = std::mem::take(&mut self.stage) else { return };
        let stored = Fields(self.horizon.buffered()).u32().unwrap_or_default();
        if stored == 0 || stored == crc.finalize() {
            self.inventory.summary.attachments.push(index);
        } else {
            self.reject(frame, format!("attachment `{}`: its CRC does not hold", index.name));
        }
        self.pass(frame);
    }
}
