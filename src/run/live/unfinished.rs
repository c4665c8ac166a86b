//! Length of unfinished WebSocket messages (RFC 6455, section 5.2), counted from the incoming bytes.

/// Byte counter of one direction of a connection.
#[derive(Debug, Default)]
pub(super) struct Unfinished {
    /// Head of a frame, as far as received.
    head: Vec<u8>,
    /// Missing bytes of the current frame.
    left: u64,
    /// Length of the frames of an unfinished message, in bytes.
    message: u64,
}

impl Unfinished {
    /// Takes bytes; returns the length of the longest message they belong to, as claimed by its frames.
    pub(super) fn take(&mut self, mut bytes: &[u8]) -> u64 {
        let mut longest = 0;
        while !bytes.is_empty() {
            if self.left > 0 {
                let skipped = usize::try_from(self.left).map_or(bytes.len(), |left| left.min(bytes.len()));
                self.left -= skipped as u64;
                bytes = bytes.get(skipped..).unwrap_or_default();
                continue;
            }
            let Some((&next, rest)) = bytes.split_first() else { break };
            self.head.push(next);
            bytes = rest;
            if let Some((is_last, is_control, length)) = frame(&self.head) {
                self.head.clear();
                self.left = length;
                let all = if is_control { length } else { self.message.saturating_add(length) };
                longest = longest.max(all);
                if !is_control {
                    self.message = if is_last { 0 } else { all };
                }
            }
        }
        longest
    }
}

/// Parses the head of a frame once it is complete: whether the message ends with it, whether it is a control frame, and
/// its length in bytes.
fn frame(head: &[u8]) -> Option<(bool, bool, u64)> {
    let (&first, rest) = head.split_first()?;
    let (&second, rest) = rest.split_first()?;
    let mask = if second & 0x80 == 0 { 0 } else { 4 };
    let (length, taken) = match second & 0x7f {
        126 => (u64::from(u16::from_be_bytes(*rest.first_chunk()?)), 2),
        127 => (u64::from_be_bytes(*rest.first_chunk()?), 8),
        short => (u64::from(short), 0),
    };
    (rest.len() == taken + mask).then_some((first & 0x80 != 0, first & 0x08 != 0, length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_as_long_as_its_frames_claim_in_whatever_pieces_they_come() {
        let short = [&[0x81, 0x85, 1, 2, 3, 4][..], b"hello"].concat();
        let long = [&[0x02, 0xfe, 0x01, 0x00, 1, 2, 3, 4][..], &[7; 256]].concat();
        let ping = [0x89, 0x80, 1, 2, 3, 4].to_vec();
        let rest = [&[0x80, 0xff, 0, 0, 0, 0, 0, 1, 0, 0, 1, 2, 3, 4][..], &[7; 65_536]].concat();
        let stream = [short.clone(), long, ping, rest, short].concat();
        for piece in [1, 7, 4096, stream.len()] {
            let mut unfinished = Unfinished::default();
            let longest = stream.chunks(piece).map(|bytes| unfinished.take(bytes)).max();
            assert_eq!(longest, Some(256 + 65_536));
            assert_eq!((unfinished.left, unfinished.message), (0, 0));
        }
        assert_eq!(Unfinished::default().take(&[0x82, 0xff, 0, 0, 0, 0, 4, 0, 0, 0, 1, 2, 3, 4]), 1 << 26);
    }
}
