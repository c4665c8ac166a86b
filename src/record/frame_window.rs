//! Window of a recording's bytes, walked one whole `[opcode][length][body]` frame at a time.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::plausibility::end;
use super::wire::{FRAME, Fields};

/// Buffered part of a file that may grow.
#[derive(Debug, Default)]
pub(super) struct FrameWindow {
    buffer: Vec<u8>,
    /// Range buffered and not yet consumed: `buffer[start..end]`.
    start: usize,
    end: usize,
    /// Offset of `buffer[start]` in the file.
    offset: u64,
    extent: Extent,
}

/// Known length of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Extent {
    pub(super) length: u64,
    /// Whether the file will not grow any more.
    pub(super) finished: bool,
}

/// A whole record at the top level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Offset of the opcode in the file.
    pub(super) offset: u64,
    pub(super) opcode: u8,
    /// Length of the body, in bytes.
    pub(super) length: u64,
}

impl Frame {
    /// Offset of the first byte after it; beyond every file if the length overflows.
    pub(super) fn end(&self) -> u64 {
        end(self.offset, self.length)
    }
}

/// Reason why there is no answer yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// At least `length` bytes are needed from `offset` on.
    Read { offset: u64, length: usize },
    /// The next bytes are not whole, but may become so.
    Wait,
    /// The file ends here.
    End,
    /// The file ends inside the requested bytes.
    Cut { claimed: u64 },
}

impl FrameWindow {
    /// Room for `length` bytes that follow those already inserted.
    pub(super) fn insert(&mut self, length: usize) -> &mut [u8] {
        if self.buffer.len() - self.end < length && self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        if self.buffer.len() - self.end < length {
            self.buffer.resize(self.end + length, 0);
        }
        &mut self.buffer[self.end..self.end + length]
    }

    pub(super) fn notify_read(&mut self, length: usize) {
        self.end = (self.end + length).min(self.buffer.len());
    }

    pub(super) fn set_extent(&mut self, extent: Extent) {
        self.extent = extent;
    }

    pub(super) fn extent(&self) -> Extent {
        self.extent
    }

    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    /// Part of the buffered bytes.
    pub(super) fn within(&self, range: &Range<usize>) -> &[u8] {
        self.buffered().get(range.clone()).unwrap_or_default()
    }

    /// Next `length` bytes.
    pub(super) fn peek(&self, length: usize) -> Result<&[u8], Stop> {
        match self.buffered().get(..length) {
            Some(bytes) => Ok(bytes),
            None => Err(self.want(length)),
        }
    }

    /// Frame that begins here, if all of it lies within the file.
    ///
    /// A recorder may rewrite the head of a record that is not whole (an open chunk has a length of `u64::MAX`), so the
    /// buffered bytes of such a record are dropped and read again.
    pub(super) fn frame(&mut self) -> Result<Frame, Stop> {
        let head = self.peek(FRAME).map(|head| {
            let mut fields = Fields(head);
            (fields.u8().unwrap_or_default(), fields.u64().unwrap_or_default())
        });
        let (opcode, length) = match head {
            Ok(head) => head,
            Err(stop) => return Err(self.forget_if_waiting(stop)),
        };
        let frame = Frame { offset: self.offset, opcode, length };
        // `u64::MAX` is the saturated end: no file is so long.
        match frame.end() <= self.extent.length && frame.end() < u64::MAX {
            true => Ok(frame),
            false if self.extent.finished => Err(Stop::Cut { claimed: length }),
            false => Err(self.forget_if_waiting(Stop::Wait)),
        }
    }

    /// Waits if the recorder may still rewrite these bytes: the recording grows, and nothing follows `end` yet. A
    /// recorder patches the head of a chunk before it writes on after it.
    pub(super) fn may_change(&self, end: u64) -> Result<(), Stop> {
        match self.extent.finished || end < self.extent.length {
            true => Ok(()),
            false => Err(Stop::Wait),
        }
    }

    /// Body of the frame that begins here, or its first `most` bytes.
    pub(super) fn body(&self, frame: Frame, most: u64) -> Result<&[u8], Stop> {
        let bytes = self.peek(FRAME + frame.length.min(most) as usize)?;
        Ok(bytes.get(FRAME..).unwrap_or_default())
    }

    /// All bytes buffered from here on.
    pub(super) fn buffered(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or_default()
    }

    /// Skips the next `length` bytes, buffered or not.
    pub(super) fn skip(&mut self, length: u64) {
        self.offset = self.offset.saturating_add(length);
        self.start = match usize::try_from(length) {
            Ok(length) => self.end.min(self.start.saturating_add(length)),
            Err(_) => self.end,
        };
    }

    /// Moves to another offset.
    pub(super) fn seek(&mut self, offset: u64) {
        match offset.checked_sub(self.offset) {
            Some(ahead) => self.skip(ahead),
            None => {
                self.forget();
                self.offset = offset;
            }
        }
    }

    /// Moves to another offset and drops the buffer.
    pub(super) fn jump(&mut self, offset: u64) {
        self.forget();
        self.offset = offset;
    }

    /// Drops the buffer and waits: these bytes do not make sense yet and may be rewritten.
    pub(super) fn wait(&mut self) -> Stop {
        self.forget();
        Stop::Wait
    }

    fn want(&self, length: usize) -> Stop {
        let left = self.extent.length.saturating_sub(self.offset);
        if length as u64 <= left {
            let buffered = self.end - self.start;
            Stop::Read { offset: self.offset + buffered as u64, length: length - buffered }
        } else if !self.extent.finished {
            Stop::Wait
        } else if left == 0 {
            Stop::End
        } else {
            Stop::Cut { claimed: length as u64 }
        }
    }

    fn forget_if_waiting(&mut self, stop: Stop) -> Stop {
        if stop == Stop::Wait {
            self.forget();
        }
        stop
    }

    fn forget(&mut self) {
        (self.start, self.end) = (0, 0);
    }
}
