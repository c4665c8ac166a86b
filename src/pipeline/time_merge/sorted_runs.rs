//! Sorted runs of messages that wait outside of memory.

use std::ops::Range;

use crate::Error;
use crate::record::Message;

/// Bytes of a run read at once, unless a message is longer.
pub(super) const AT_ONCE: usize = 32 << 10;
/// Bytes of a message on the shelf before its data.
const HEAD: usize = 46;

/// Place of a message in the order: its time, and its number in the file.
pub(super) type Place = (u64, u64);

/// Room outside of memory, for bytes that are appended and read back by their position.
pub(crate) trait Shelf: Send {
    /// Appends bytes.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    fn append(&mut self, bytes: &[u8]) -> Result<(), Error>;

    /// Reads the bytes from position `at` on into all of `into`.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    fn read_at(&mut self, at: u64, into: &mut [u8]) -> Result<(), Error>;
}

/// A held message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Held {
    channel: u16,
    sequence: u32,
    log_time: u64,
    publish_time: u64,
    data: Vec<u8>,
}

/// Messages in order on the shelf.
pub(super) struct Run {
    /// Positions on the shelf of what was not read yet.
    rest: Range<u64>,
    /// Bytes that were read, of which so many are used up.
    read: Vec<u8>,
    used: usize,
}

impl Held {
    /// Copy of a message.
    pub(super) fn of(message: &Message<'_>) -> Self {
        let Message { channel, sequence, log_time, publish_time, data } = *message;
        Self { channel, sequence, log_time, publish_time, data: data.to_vec() }
    }

    pub(crate) fn message(&self) -> Message<'_> {
        let Self { channel, sequence, log_time, publish_time, ref data } = *self;
        Message { channel, sequence, log_time, publish_time, data }
    }

    /// Bytes on the shelf, and about as many in memory.
    pub(super) fn size(&self) -> usize {
        HEAD + self.data.len()
    }

    /// Writes the message and its place.
    pub(super) fn write(&self, (time, number): Place, into: &mut Vec<u8>) {
        into.extend(time.to_le_bytes());
        into.extend(number.to_le_bytes());
        into.extend(self.channel.to_le_bytes());
        into.extend(self.sequence.to_le_bytes());
        into.extend(self.log_time.to_le_bytes());
        into.extend(self.publish_time.to_le_bytes());
        into.extend((self.data.len() as u64).to_le_bytes());
        into.extend(&self.data);
    }
}

impl Run {
    /// Run of the messages at these positions of the shelf.
    pub(super) fn new(rest: Range<u64>) -> Self {
        Self { rest, read: Vec::new(), used: 0 }
    }

    /// Place of the next message.
    pub(super) fn peek(&mut self, shelf: &mut dyn Shelf) -> Result<Option<Place>, Error> {
        if self.rest.is_empty() && self.used == self.read.len() {
            return Ok(None);
        }
        let mut head = self.bytes(HEAD, shelf)?;
        Ok(Some((number(&mut head), number(&mut head))))
    }

    /// The next message.
    pub(super) fn take(&mut self, shelf: &mut dyn Shelf) -> Result<Option<Held>, Error> {
        if self.peek(shelf)?.is_none() {
            return Ok(None);
        }
        let mut head = self.bytes(HEAD, shelf)?;
        let _place: Place = (number(&mut head), number(&mut head));
        let (channel, sequence) = (u16::from_le_bytes(array(&mut head)), u32::from_le_bytes(array(&mut head)));
        let (log_time, publish_time) = (number(&mut head), number(&mut head));
        let size = HEAD + number(&mut head) as usize;
        let data = self.bytes(size, shelf)?.get(HEAD..).unwrap_or_default().to_vec();
        self.used += size;
        Ok(Some(Held { channel, sequence, log_time, publish_time, data }))
    }

    /// The next `count` bytes, which are not used up by it.
    fn bytes(&mut self, count: usize, shelf: &mut dyn Shelf) -> Result<&[u8], Error> {
        if self.read.len() < self.used + count {
            self.read.drain(..self.used);
            self.read.shrink_to(AT_ONCE);
            self.used = 0;
            let (kept, left) = (self.read.len(), (self.rest.end - self.rest.start) as usize);
            let more = AT_ONCE.max(count - kept).min(left);
            self.read.resize(kept + more, 0);
            shelf.read_at(self.rest.start, self.read.get_mut(kept..).unwrap_or_default())?;
            self.rest.start += more as u64;
        }
        Ok(self.read.get(self.used..self.used + count).unwrap_or_default())
    }
}

/// Splits off the first bytes.
fn array<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
    bytes.split_off(..N).and_then(|taken| taken.try_into().ok()).unwrap_or([0; N])
}

fn number(bytes: &mut &[u8]) -> u64 {
    u64::from_le_bytes(array(bytes))
}
