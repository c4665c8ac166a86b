//! Walk over the records of a file whose bytes are available, from frame to frame.

use std::io;
use std::ops::Range;

use super::Error;
use super::footer::{CLOSING, Footer};
use super::frame_window::{Extent, Frame, FrameWindow, Stop};

/// Random access to bytes.
pub trait ReadAt {
    /// Fills `buffer` from byte `offset` on.
    ///
    /// # Errors
    /// If the bytes are not there or cannot be read.
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> io::Result<()>;
}

impl ReadAt for &[u8] {
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        let start = usize::try_from(offset).unwrap_or(usize::MAX);
        let bytes = self.get(start..).and_then(|rest| rest.get(..buffer.len()));
        buffer.copy_from_slice(bytes.ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }
}

/// Walk over the records in a part of a file.
#[derive(Default)]
pub(super) struct Walk {
    window: FrameWindow,
    /// Length of the record returned last, opcode and length included.
    passed: u64,
    end: u64,
    /// Read size, in bytes.
    block: u64,
}

impl Walk {
    pub(super) fn new(range: Range<u64>, block: u64) -> Self {
        let mut window = FrameWindow::default();
        window.set_extent(Extent { length: range.end, finished: true });
        window.skip(range.start);
        Self { window, passed: 0, end: range.end, block }
    }

    /// Next record, if a whole one follows.
    pub(super) fn next(&mut self, file: &mut impl ReadAt) -> Result<Option<Frame>, Error> {
        self.window.skip(self.passed);
        self.passed = 0;
        loop {
            match self.window.frame() {
                Ok(frame) => {
                    self.passed = frame.end() - frame.offset;
                    return Ok(Some(frame));
                }
                Err(stop) => {
                    if !self.fill(file, stop)? {
                        return Ok(None);
                    }
                }
            }
        }
    }

    /// First `most` bytes of the body of the record returned last.
    pub(super) fn body(&mut self, file: &mut impl ReadAt, frame: Frame, most: u64) -> Result<&[u8], Error> {
        while let Err(stop) = self.window.body(frame, most) {
            if !self.fill(file, stop)? {
                return Ok(&[]);
            }
        }
        Ok(self.window.body(frame, most).unwrap_or_default())
    }

    /// Offset after the records returned so far.
    pub(super) fn offset(&self) -> u64 {
        self.window.offset() + self.passed
    }

    fn fill(&mut self, file: &mut impl ReadAt, stop: Stop) -> Result<bool, Error> {
        let Stop::Read { offset, length } = stop else { return Ok(false) };
        let length = (length as u64).max(self.block).min(self.end - offset) as usize;
        let cause = |cause| Error::Read { offset, cause };
        file.read_at(offset, self.window.insert(length)).map_err(cause)?;
        self.window.notify_read(length);
        Ok(true)
    }
}

/// Footer at a file's end, if its recorder closed it.
pub(super) fn footer(file: &mut impl ReadAt, length: u64) -> Result<Option<Footer>, Error> {
    let Some(offset) = length.checked_sub(CLOSING as u64) else { return Ok(None) };
    Ok(Footer::parse(&read(file, offset..length)?, offset))
}

/// Range of the summary section of a file, footer excluded, by the footer at the file's end.
pub(super) fn summary_section(file: &mut impl ReadAt, length: u64) -> Result<Option<Range<u64>>, Error> {
    Ok(footer(file, length)?.map(|footer| footer.section))
}

/// Bytes in a range.
pub(super) fn read(file: &mut impl ReadAt, range: Range<u64>) -> Result<Vec<u8>, Error> {
    let mut bytes = vec![0; (range.end - range.start) as usize];
    file.read_at(range.start, &mut bytes).map_err(|cause| Error::Read { offset: range.start, cause })?;
    Ok(bytes)
}
