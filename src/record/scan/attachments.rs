//! Check of an attachment by its CRC, without holding it in memory.

use crc32fast::Hasher;

use super::data_crc::DataCrc;
use crate::record::frame_window::{Frame, FrameWindow, Stop};
use crate::record::records::AttachmentIndex;

/// An attachment whose CRC is being computed. It is never held in memory.
pub(super) struct Attaching {
    pub(super) frame: Frame,
    pub(super) index: AttachmentIndex,
    pub(super) crc: Hasher,
    pub(super) left: u64,
}

impl Attaching {
    /// Hashes the buffered bytes, until all attached bytes have been seen and the stored CRC is buffered.
    pub(super) fn hash(&mut self, window: &mut FrameWindow, data: &mut DataCrc) -> Result<(), Stop> {
        while self.left > 0 {
            window.peek(1)?;
            let buffered = window.buffered();
            let taken = buffered.get(..self.left.min(buffered.len() as u64) as usize).unwrap_or_default();
            self.crc.update(taken);
            data.update(Some(taken));
            let taken = taken.len() as u64;
            self.left -= taken;
            window.skip(taken);
        }
        window.peek(4).map(|_| ())
    }
}
