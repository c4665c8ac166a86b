//! Emission of messages, one by one, from records that are in order.

use std::ops::Range;

use crate::record::chunk::{Inflate, Opened, Storage};
use crate::record::frame_window::{Frame, FrameWindow};
use crate::record::wire::{Fields, op};

/// Records in order, whose messages are being emitted.
pub(super) struct Emission {
    pub(super) frame: Frame,
    /// Range of the bytes that hold the records, in the window or in `opened`.
    pub(super) data: Range<usize>,
    pub(super) place: Storage,
    /// The chunk, if it was opened elsewhere.
    pub(super) opened: Option<Opened>,
    /// Range of the current record within the records.
    pub(super) at: Range<usize>,
    /// Whether the end of a chunk is to be emitted afterwards.
    pub(super) ends: bool,
}

impl Emission {
    /// The records whose messages are being emitted.
    pub(super) fn records<'a>(&'a self, inflate: &'a Inflate, window: &'a FrameWindow) -> &'a [u8] {
        match &self.opened {
            Some(opened) => opened.records(self.place, &self.data),
            None => inflate.records(self.place, window.within(&self.data)),
        }
    }

    /// Advances to the next message. Returns whether there is one.
    pub(super) fn advance(&mut self, inflate: &Inflate, window: &FrameWindow) -> bool {
        loop {
            let records = self.records(inflate, window);
            let mut rest = Fields(records.get(self.at.end..).unwrap_or_default());
            let before = rest.0.len();
            let Some((opcode, _)) = rest.record() else { return false };
            self.at = self.at.end..self.at.end + before - rest.0.len();
            if opcode == op::MESSAGE {
                return true;
            }
        }
    }
}
