//! The footer of a recording: where its summary stands, and the CRC of that.

use std::ops::Range;

use mcap::MAGIC;

use super::wire::{DATA_END, FRAME, Fields, op};

/// Length of a footer record and the magic behind it, in bytes.
pub const CLOSING: usize = FRAME + 20 + MAGIC.len();

/// What a footer says.
#[derive(Clone, Debug)]
pub(super) struct Footer {
    /// Where the summary section stands, footer excluded.
    pub(super) section: Range<u64>,
    /// Where the offsets of its groups stand, 0 without them.
    pub(super) offsets: u64,
    /// Of the section and the footer's own fields in front of it; 0 if nobody computed it.
    pub(super) crc: u32,
}

impl Footer {
    /// By the last [`CLOSING`] bytes of a file, which begin at `offset`; nothing without summary section.
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

/// Whether a file whose last bytes these are was closed by its recorder.
pub fn is_closing(bytes: &[u8]) -> bool {
    let mut fields = Fields(bytes);
    bytes.len() == CLOSING && (fields.u8(), fields.u64()) == (Some(op::FOOTER), Some(20)) && bytes.ends_with(MAGIC)
}
