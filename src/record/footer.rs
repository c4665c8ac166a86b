//! Footer of a recording: the place and CRC of its summary.

use std::ops::Range;

use mcap::MAGIC;

use super::wire::{DATA_END, FRAME, Fields, op};

/// Length of a footer record and the magic after it, in bytes.
pub const CLOSING: usize = FRAME + 20 + MAGIC.len();

/// Content of a footer.
#[derive(Clone, Debug)]
pub(super) struct Footer {
    /// Range of the summary section, footer excluded.
    pub(super) section: Range<u64>,
    /// Offset of the summary offset records, 0 without them.
    pub(super) offsets: u64,
    /// CRC of the summary section and the footer's fields before the CRC; 0 if not computed.
    pub(super) crc: u32,
}

impl Footer {
    /// Parses the last [`CLOSING`] bytes of a file, which begin at `offset`; `None` without summary section.
    pub(super) fn parse(closing: &[u8], offset: u64) -> Option<Self> {
        let mut fields = Fields(closing.get(FRAME..).filter(|_| is_closing(closing))?);
        let (start, offsets, crc) = (fields.u64()?, fields.u64()?, fields.u32()?);
        (MAGIC.len() as u64 + DATA_END..=offset).contains(&start).then_some(Self {
            section: start..offset,
            offsets,
            crc,
        })
    }
}

/// Whether these last bytes of a file show that its recorder closed it.
pub fn is_closing(bytes: &[u8]) -> bool {
    let mut fields = Fields(bytes);
    bytes.len() == CLOSING && (fields.u8(), fields.u64()) == (Some(op::FOOTER), Some(20)) && bytes.ends_with(MAGIC)
}
