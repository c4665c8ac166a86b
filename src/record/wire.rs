//! Byte layout of MCAP: little-endian fields, length-prefixed strings and maps, `[opcode][length][body]` records. The
//! records themselves are in [`records`](super::records).

use std::collections::BTreeMap;

pub(super) use mcap::records::op;

/// Length of the opcode and length before each record's body.
pub(super) const FRAME: usize = 9;
/// Length of a DataEnd record, in bytes.
pub(super) const DATA_END: u64 = FRAME as u64 + 4;

/// Number of bytes that show whether a file is MCAP.
pub const START: usize = mcap::MAGIC.len();

/// Whether a file that begins with these bytes is MCAP.
pub fn is_beginning(bytes: &[u8]) -> bool {
    bytes.starts_with(mcap::MAGIC)
}

/// Parser that takes fields off the front of a record's body; `None` if it is too short or a string is not UTF-8.
#[derive(Clone)]
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn bytes(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.bytes(1)?.first().copied()
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes after a 32-bit length.
    pub(super) fn blob(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.bytes(length as usize)
    }

    pub(super) fn str(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.blob()?).ok()
    }

    pub(super) fn string(&mut self) -> Option<String> {
        self.str().map(str::to_owned)
    }

    /// Map of strings. A repeated key is malformed.
    pub(super) fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut pairs = Fields(self.blob()?);
        let mut map = BTreeMap::new();
        while !pairs.0.is_empty() {
            if map.insert(pairs.string()?, pairs.string()?).is_some() {
                return None;
            }
        }
        Some(map)
    }

    /// Next record: opcode and body.
    pub(super) fn record(&mut self) -> Option<(u8, &'a [u8])> {
        let opcode = self.u8()?;
        let length = usize::try_from(self.u64()?).ok()?;
        Some((opcode, self.bytes(length)?))
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }
}

/// Writer of fields.
pub(super) trait Put {
    fn put(&mut self, bytes: &[u8]);

    fn put_u16(&mut self, value: u16) {
        self.put(&value.to_le_bytes());
    }

    fn put_u32(&mut self, value: u32) {
        self.put(&value.to_le_bytes());
    }

    fn put_u64(&mut self, value: u64) {
        self.put(&value.to_le_bytes());
    }

    /// Appends a 32-bit length and the bytes.
    fn put_blob(&mut self, bytes: &[u8]) {
        self.put_u32(bytes.len() as u32);
        self.put(bytes);
    }

    fn put_str(&mut self, text: &str) {
        self.put_blob(text.as_bytes());
    }

    fn put_map(&mut self, map: &BTreeMap<String, String>) {
        let length: usize = map.iter().map(|(key, value)| 8 + key.len() + value.len()).sum();
        self.put_u32(length as u32);
        for (key, value) in map {
            self.put_str(key);
            self.put_str(value);
        }
    }
}

impl Put for Vec<u8> {
    fn put(&mut self, bytes: &[u8]) {
        self.extend_from_slice(bytes);
    }
}

/// Appends a record whose body `fill` writes.
pub(super) fn record(out: &mut Vec<u8>, opcode: u8, fill: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.put(&[opcode]);
    out.put_u64(0);
    fill(out);
    let length = (out.len() - start - FRAME) as u64;
    out[start + 1..start + FRAME].copy_from_slice(&length.to_le_bytes());
}
