//! Writes primitives as CDR, little-endian, version 1: what ROS 2 puts in recordings. What follows what is left to the
//! caller.

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

    /// Length with the terminator, bytes, terminator.
    pub fn string(&mut self, value: &str) {
        self.length(value.len() + 1);
        self.bytes.extend_from_slice(value.as_bytes());
        self.bytes.push(0);
    }

    /// Number of elements of a sequence that follow.
    pub fn length(&mut self, elements: usize) {
        self.u32(u32::try_from(elements).unwrap_or(u32::MAX));
    }

    /// Primitives are aligned to their own size, counted from behind the encapsulation header.
    fn aligned<const SIZE: usize>(&mut self, value: [u8; SIZE]) {
        let body = self.bytes.len() - ENCAPSULATION.len();
        self.bytes.resize(ENCAPSULATION.len() + body.next_multiple_of(SIZE), 0);
        self.bytes.extend_from_slice(&value);
    }
}
