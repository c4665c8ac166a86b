//! Primitives of CDR, little-endian, version 1, as in ROS 2 recordings.

use prost_types::Timestamp;

/// A CDR stream under construction.
pub struct Writer {
    bytes: Vec<u8>,
}

/// Representation identifier `CDR_LE` and options (DDS-XTypes 1.3, section 7.4.3.4.2).
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

impl Writer {
    pub fn new() -> Self {
        Self { bytes: ENCAPSULATION.to_vec() }
    }

    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }

    pub fn bool(&mut self, value: bool) {
        self.u8(value.into());
    }

    pub fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub fn i32(&mut self, value: i32) {
        self.aligned(value.to_le_bytes());
    }

    pub fn u32(&mut self, value: u32) {
        self.aligned(value.to_le_bytes());
    }

    pub fn u64(&mut self, value: u64) {
        self.aligned(value.to_le_bytes());
    }

    pub fn f64(&mut self, value: f64) {
        self.aligned(value.to_le_bytes());
    }

    /// Appends a `builtin_interfaces/Time`, which ends in the year 2038.
    pub fn time(&mut self, time: Timestamp) {
        self.i32(time.seconds.clamp(i32::MIN.into(), i32::MAX.into()) as i32);
        self.u32(time.nanos.max(0) as u32);
    }

    /// Appends the length with the terminator, the bytes, and the terminator.
    pub fn string(&mut self, value: &str) {
        self.length(value.len() + 1);
        self.bytes.extend_from_slice(value.as_bytes());
        self.bytes.push(0);
    }

    /// Appends the number of elements of a sequence.
    pub fn length(&mut self, elements: usize) {
        self.u32(u32::try_from(elements).unwrap_or(u32::MAX));
    }

    /// Appends a primitive, aligned to its own size, counted from the end of the encapsulation header.
    fn aligned<const SIZE: usize>(&mut self, value: [u8; SIZE]) {
        let body = self.bytes.len() - ENCAPSULATION.len();
        self.bytes.resize(ENCAPSULATION.len() + body.next_multiple_of(SIZE), 0);
        self.bytes.extend_from_slice(&value);
    }
}

/// A CDR stream being read. Errors describe the problem and its place.
pub struct Reader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let body = bytes.strip_prefix(&ENCAPSULATION).ok_or("does not begin as little-endian CDR")?;
        Ok(Self { body, at: 0 })
    }

    pub fn u8(&mut self) -> Result<u8, String> {
        self.aligned().map(u8::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, String> {
        self.aligned().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, String> {
        self.aligned().map(u64::from_le_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, String> {
        self.aligned().map(f64::from_le_bytes)
    }

    pub fn time(&mut self) -> Result<Timestamp, String> {
        let seconds = self.aligned().map(i32::from_le_bytes)?.into();
        let nanos = i32::try_from(self.u32()?).map_err(|_| self.complaint("a time"))?;
        Ok(Timestamp { seconds, nanos })
    }

    pub fn string(&mut self) -> Result<&'a str, String> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        let text = bytes.strip_suffix(&[0]).ok_or_else(|| self.complaint("a string's end"))?;
        std::str::from_utf8(text).map_err(|_| self.complaint("UTF-8 text"))
    }

    fn aligned<const SIZE: usize>(&mut self) -> Result<[u8; SIZE], String> {
        self.at = self.at.next_multiple_of(SIZE);
        let value = self.body.get(self.at..).and_then(|rest| rest.first_chunk::<SIZE>());
        let value = *value.ok_or_else(|| self.complaint("more"))?;
        self.at += SIZE;
        Ok(value)
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], String> {
        let rest: &'a [u8] = self.body.get(self.at..).unwrap_or_default();
        let taken = rest.get(..length).ok_or_else(|| self.complaint("more"))?;
        self.at += length;
        Ok(taken)
    }

    fn complaint(&self, wanted: &str) -> String {
        format!("lacks {wanted} at byte {}", ENCAPSULATION.len() + self.at)
    }
}
