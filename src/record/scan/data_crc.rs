//! CRC of the whole data section, which covers bytes that no record's own CRC covers. It costs as much as reading, so
//! it is computed only on demand, or for recordings without chunks, which are read completely anyway.

use crc32fast::Hasher;

/// CRC of everything from the first byte on.
#[derive(Default)]
pub(super) struct DataCrc {
    /// Whether it is computed in recordings with chunks, too.
    pub(super) demanded: bool,
    /// State of the computation; `None` once bytes were skipped unseen.
    pub(super) state: Option<Hasher>,
}

impl DataCrc {
    pub(super) fn update(&mut self, bytes: Option<&[u8]>) {
        match bytes {
            Some(bytes) => self.state.iter_mut().for_each(|hasher| hasher.update(bytes)),
            None => self.state = None,
        }
    }

    /// Starts at the beginning of the recording.
    pub(super) fn begin(&mut self) {
        self.state = Some(Hasher::new());
    }

    /// Resumes from the state of another computation.
    pub(super) fn resume(state: Option<u32>) -> Self {
        Self { demanded: false, state: state.map(Hasher::new_with_initial) }
    }

    pub(super) fn value(&self) -> Option<u32> {
        self.state.clone().map(Hasher::finalize)
    }

    /// Gives up at a chunk, unless demanded.
    pub(super) fn chunk(&mut self) {
        if !self.demanded {
            self.state = None;
        }
    }
}
