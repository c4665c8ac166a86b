//! Records in order, from which messages are told one by one.

use std::ops::Range;

use crate::record::chunk::{Inflate, Opened, Place};
use crate::record::horizon::{Frame, Horizon};
use crate::record::wire::{Fields, op};

/// Records in order, from which messages are told.
pub(super) struct Telling {
    pub(super) frame: Frame,
    /// The bytes that hold the records, in front of the horizon or in `opened`.
    pub(super) data: Range<usize>,
    pub(super) place: Place,
    /// The chunk, if somebody else opened it.
    pub(super) opened: Option<Opened>,
    /// The record that is being told, within the records.
    pub(super) at: Range<usize>,
    /// Whether the end of a chunk is to be told.
    pub(super) ends: bool,
}

impl Telling {
    /// The records from which is told.
    pub(super) fn records<'a>(&'a self, inflate: &'a Inflate, horizon: &'a Horizon) -> &'a [u8] {
        match &self.opened {
            Some(opened) => opened.records(self.place, &self.data),
            None => inflate.records(self.place, horizon.within(&self.data)),
        }
    }

    /// Goes on to the next message, if there is one.
    pub(super) fn advance(&mut self, inflate: &Inflate, horizon: &Horizon) -> bool {
        loop {
            let records = self.records(inflate, horizon);
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
