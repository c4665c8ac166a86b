//! The CRC over all of the data section, which covers what no record's own CRC does. It costs as much as reading, so
//! that it is computed only of recordings without chunks, all of which is read anyway, or on demand.

use crc32fast::Hasher;

use super::Scan;
use crate::record::chunk::Opened;
use crate::record::horizon::Frame;

/// Of everything from the first byte on.
#[derive(Default)]
pub(super) struct DataCrc {
    /// Whether it is computed whatever the recording holds.
    demanded: bool,
    /// `None` once something was passed unseen.
    state: Option<Hasher>,
}

impl DataCrc {
    pub(super) fn update(&mut self, bytes: Option<&[u8]>) {
        match bytes {
            Some(bytes) => self.state.iter_mut().for_each(|hasher| hasher.update(bytes)),
            None => self.state = None,
        }
    }

    /// From the beginning.
    pub(super) fn begin(&mut self) {
        self.state = Some(Hasher::new());
    }

    /// From where another one stood.
    pub(super) fn resume(state: Option<u32>) -> Self {
        Self { demanded: false, state: state.map(Hasher::new_with_initial) }
    }

    pub(super) fn value(&self) -> Option<u32> {
        self.state.clone().map(Hasher::finalize)
    }

    /// A chunk begins.
    pub(super) fn chunk(&mut self) {
        if !self.demanded {
            self.state = None;
        }
    }
}

impl Scan {
    /// The same, but the CRC of the data section is checked even if there are chunks. Unless all of them are opened, it
    /// cannot be.
    pub fn verifying(mut self) -> Self {
        self.data_crc.demanded = true;
        self
    }

    /// Goes on behind the next `length` bytes of the data section.
    pub(super) fn consume(&mut self, length: u64) {
        if self.data_crc.state.is_some() {
            let bytes = usize::try_from(length).ok().and_then(|length| self.horizon.buffered().get(..length));
            self.data_crc.update(bytes);
        }
        self.horizon.skip(length);
    }

    /// Goes on behind a chunk that was opened elsewhere.
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

    /// Checks the CRC in the DataEnd record. Where something is damaged, it does not hold anyway.
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
