//! How far a recording is whole: a window of its bytes, walked one `[opcode][length][body]` frame at a time.
//! What is in the frames is left to [`Scan`](super::Scan).

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::shape::end;
use super::wire::{FRAME, Fields};

/// The part of a growing file that is being looked at.
#[derive(Debug, Default)]
pub(super) struct Horizon {
    buffer: Vec<u8>,
    /// Buffered and not yet consumed: `buffer[start..end]`.
    start: usize,
    end: usize,
    /// Place of `buffer[start]` in the file.
    offset: u64,
    extent: Extent,
}

/// What is known about the file's length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Extent {
    pub(super) length: u64,
    /// It will not grow any more.
    pub(super) finished: bool,
}

/// One whole record at the top level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Of the opcode, in the file.
    pub(super) offset: u64,
    pub(super) opcode: u8,
    /// Of the body.
    pub(super) length: u64,
}

impl Frame {
    /// The first byte behind it; beyond every file if its length is beyond all measure.
    pub(super) fn end(&self) -> u64 {
        end(self.offset, self.length)
    }
}

/// Why there is no answer yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// At least `length` bytes are needed from `offset` on.
    Read { offset: u64, length: usize },
    /// The next bytes are not whole, but may become so.
    Wait,
    /// Nothing follows.
    End,
    /// The file ends inside what was asked for.
    Cut { claimed: u64 },
}

impl Horizon {
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

    /// A part of what is buffered.
    pub(super) fn within(&self, range: &Range<usize>) -> &[u8] {
        self.buffered().get(range.clone()).unwrap_or_default()
    }

    /// The next `length` bytes.
    pub(super) fn peek(&self, length: usize) -> Result<&[u8], Stop> {
        match self.buffered().get(..length) {
            Some(bytes) => Ok(bytes),
            None => Err(self.want(length)),
        }
    }

    /// The frame that begins here, if all of it lies within the file.
    ///
    /// A recorder may rewrite the head of a record that is not whole (a chunk that is still open carries a length of
    /// `u64::MAX`), so whatever was buffered of one is forgotten and read again.
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
        // No file is as long as the largest number.
        match frame.end() <= self.extent.length && frame.end() < u64::MAX {
            true => Ok(frame),
            false if self.extent.finished => Err(Stop::Cut { claimed: length }),
            false => Err(self.forget_if_waiting(Stop::Wait)),
        }
    }

    /// Waits if the recorder may still rewrite what stands here: the recording grows, and nothing follows `end` yet. A
    /// recorder that patches the head of a chunk does so before it goes on behind it.
    pub(super) fn may_change(&self, end: u64) -> Result<(), Stop> {
        match self.extent.finished || end < self.extent.length {
            true => Ok(()),
            false => Err(Stop::Wait),
        }
    }

    /// The body of the frame that begins here, or its first `most` bytes.
    pub(super) fn body(&self, frame: Frame, most: u64) -> Result<&[u8], Stop> {
        let bytes = self.peek(FRAME + frame.length.min(most) as usize)?;
        Ok(bytes.get(FRAME..).unwrap_or_default())
    }

    /// Everything buffered from here on.
    pub(super) fn buffered(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or_default()
    }

    /// Goes on behind the next `length` bytes, buffered or not.
    pub(super) fn skip(&mut self, length: u64) {
        self.offset = self.offset.saturating_add(length);
        self.start = match usize::try_from(length) {
            Ok(length) => self.end.min(self.start.saturating_add(length)),
            Err(_) => self.end,
        };
    }

    /// Goes to another place.
    pub(super) fn seek(&mut self, offset: u64) {
        match offset.checked_sub(self.offset) {
            Some(ahead) => self.skip(ahead),
            None => {
                self.forget();
                self.offset = offset;
            }
        }
    }

    /// Goes to another place, of which nothing is buffered.
    pub(super) fn jump(&mut self, offset: u64) {
        self.forget();
        self.offset = offset;
    }

    /// What is here does not make sense yet. It is forgotten, since it may be written again.
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
