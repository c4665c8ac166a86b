//! Wire format of protobuf: wire types, and writing of a field.

/// Wire types.
pub(super) const VARINT: u64 = 0;
pub(super) const I64: u64 = 1;
pub(super) const LEN: u64 = 2;
pub(super) const GROUP: u64 = 3;
pub(super) const END_GROUP: u64 = 4;
pub(super) const I32: u64 = 5;

/// Message with one number at the end of a path of field numbers. Appended to another message it is merged, and its
/// value counts, since it is the last.
pub(in crate::imu::decode) fn alone(way: &[u32], bytes: &[u8]) -> Vec<u8> {
    let Some((&number, outer)) = way.split_last() else { return Vec::new() };
    let mut out = Vec::new();
    varint(&mut out, u64::from(number) << 3 | if bytes.len() == 8 { I64 } else { I32 });
    out.extend_from_slice(bytes);
    for &number in outer.iter().rev() {
        let mut around = Vec::new();
        varint(&mut around, u64::from(number) << 3 | LEN);
        varint(&mut around, out.len() as u64);
        around.extend(out);
        out = around;
    }
    out
}

/// Takes a varint from the beginning of the bytes.
pub(super) fn take_varint(data: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for i in 0..10 {
        let byte = *data.split_off_first()?;
        value |= u64::from(byte & 0x7f) << (7 * i);
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

pub(super) fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
