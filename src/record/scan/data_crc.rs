//! The CRC over all of the data section, which covers what no record's own CRC does. It costs as much as reading, so
//! that it is computed only of recordings without chunks, all of which is read anyway, or on demand.

use crc32fast::Hasher;

/// Of everything from the first byte on.
#[derive(Default)]
pub(super) struct DataCrc {
    /// Whether it is computed whatever the recording holds.
    pub(super) demanded: bool,
    /// `None` once something was passed unseen.
    pub(super) state: Option<Hasher>,
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
