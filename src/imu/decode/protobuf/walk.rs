//! Walk over the bytes of a protobuf message. The wanted fields are in its [`ProtobufPlan`].

use super::plan::{Bits, MAX_PARTS, ProtobufPlan, Take};
use super::wire;
use crate::imu::decode::lists::Lists;
use crate::imu::decode::malformed::Malformed;
use crate::imu::schema::layout::{Coding, Number};
use crate::imu::schema::path::Stride;

impl ProtobufPlan {
    /// Walks a message and returns the text. A missing number has its field's default, or NaN if the message or list
    /// around it is missing, too.
    pub(in crate::imu::decode) fn read<'d>(
        &self,
        data: &'d [u8],
        numbers: &mut [f64],
        lists: &mut Lists,
    ) -> Result<&'d [u8], Malformed> {
        self.walk::<false>(data, numbers, lists)
    }

    /// Finds the offsets of numbers of fixed size; NaN for all others and for missing ones.
    pub(in crate::imu::decode) fn locate(
        &self,
        data: &[u8],
        places: &mut [f64],
        none: &mut Lists,
    ) -> Result<(), Malformed> {
        self.walk::<true>(data, places, none).map(drop)
    }

    fn walk<'d, const LOCATE: bool>(
        &self,
        data: &'d [u8],
        numbers: &mut [f64],
        lists: &mut Lists,
    ) -> Result<&'d [u8], Malformed> {
        numbers.fill(f64::NAN);
        let counts = [0; MAX_PARTS];
        let mut walk = ProtobufWalk::<LOCATE> { data, at: 0, numbers, lists, text: &[], begun: 0, counts };
        walk.message(self, data.len())?;
        Ok(walk.text)
    }
}

/// State of a walk over a message, which reads or locates the wanted fields.
struct ProtobufWalk<'d, 'n, const LOCATE: bool> {
    data: &'d [u8],
    at: usize,
    numbers: &'n mut [f64],
    lists: &'n mut Lists,
    text: &'d [u8],
    /// One bit for each [`ProtobufPlan::id`] that was met.
    begun: u32,
    /// Number of elements of each list so far.
    counts: [u32; MAX_PARTS],
}

impl<const LOCATE: bool> ProtobufWalk<'_, '_, LOCATE> {
    fn message(&mut self, message: &ProtobufPlan, end: usize) -> Result<(), Malformed> {
        // A message in parts is merged: only the first part begins with the defaults.
        if self.begun & 1 << message.id == 0 {
            self.begun |= 1 << message.id;
            let value = |bits: Bits| if LOCATE { f64::NAN } else { f64::from_bits(bits.0) };
            message.absent.iter().for_each(|&(slot, bits)| self.put(slot, value(bits)));
        }
        while self.at < end {
            let (number, kind) = self.tag(end)?;
            match message.fields.iter().find(|wanted| u64::from(wanted.number) == number) {
                Some(wanted) => self.field(&wanted.take, number, kind, end)?,
                None => self.skip(number, kind, end)?,
            }
        }
        Ok(())
    }

    /// Reads a wanted field. With another wire type it counts as unknown.
    fn field(&mut self, take: &Take, field: u64, kind: u64, end: usize) -> Result<(), Malformed> {
        match take {
            Take::Number { number, coding, slots } if kind == number.wire(*coding) => {
                let value = self.number(*number, *coding, end)?;
                slots.iter().for_each(|&slot| self.put(slot, value));
            }
            Take::Numbers { list, number, coding, slots, every } if kind == number.wire(*coding) => {
                let value = self.number(*number, *coding, end)?;
                self.element(*list, slots, every, value);
            }
            Take::Numbers { list, number, coding, slots, every } if kind == wire::LEN => {
                let end = self.length(end)?;
                while self.at < end {
                    let value = self.number(*number, *coding, end)?;
                    self.element(*list, slots, every, value);
                }
            }
            Take::Text if kind == wire::LEN => {
                let end = self.length(end)?;
                self.text = self.data.get(self.at..end).unwrap_or_default();
                self.at = end;
            }
            Take::Message(inner) if kind == wire::LEN => {
                let end = self.length(end)?;
                self.message(inner, end)?;
            }
            Take::Messages { list, every: Some(every), .. } if kind == wire::LEN => {
                let end = self.length(end)?;
                let count = self.next(*list);
                self.begun &= !every.ids;
                for &list in &every.lists {
                    self.counts.get_mut(list).into_iter().for_each(|count| *count = 0);
                }
                every.slots.iter().for_each(|&(slot, _)| self.put(slot, f64::NAN));
                self.message(&every.plan, end)?;
                for &(slot, _) in every.slots.iter().filter(|(_, stride)| stride.takes(count)) {
                    self.lists.push(slot, self.numbers.get(slot).copied().unwrap_or(f64::NAN));
                }
            }
            Take::Messages { list, elements, .. } if kind == wire::LEN => {
                let end = self.length(end)?;
                let count = self.next(*list);
                match elements.iter().find(|(element, _)| *element == count) {
                    Some((_, inner)) => self.message(inner, end)?,
                    None => self.at = end,
                }
            }
            _ => self.skip(field, kind, end)?,
        }
        Ok(())
    }

    /// Index of the next element of a list.
    fn next(&mut self, list: usize) -> u32 {
        let Some(count) = self.counts.get_mut(list) else { return u32::MAX };
        *count = count.saturating_add(1);
        *count - 1
    }

    fn element(&mut self, list: usize, slots: &[(u32, usize)], every: &[(usize, Stride)], value: f64) {
        let count = self.next(list);
        slots.iter().filter(|(element, _)| *element == count).for_each(|&(_, slot)| self.put(slot, value));
        every.iter().filter(|(_, stride)| stride.takes(count)).for_each(|&(slot, _)| self.lists.push(slot, value));
    }

    #[inline]
    fn put(&mut self, slot: usize, value: f64) {
        if let Some(number) = self.numbers.get_mut(slot) {
            *number = value;
        }
    }

    fn number(&mut self, number: Number, coding: Coding, end: usize) -> Result<f64, Malformed> {
        let start = self.at;
        let read = match coding {
            Coding::Varint => Ok(number.cast(self.varint(end)?)),
            Coding::Zigzag => {
                let bits = self.varint(end)?;
                Ok(number.cast(bits >> 1 ^ (bits & 1).wrapping_neg()))
            }
            Coding::Fixed => Ok(number.read::<false>(self.bytes(number.size(), end)?).unwrap_or(f64::NAN)),
        };
        match (LOCATE, coding) {
            (false, _) => read,
            (true, Coding::Fixed) => read.map(|_| start as f64),
            (true, _) => read.map(|_| f64::NAN),
        }
    }

    fn skip(&mut self, field: u64, kind: u64, end: usize) -> Result<(), Malformed> {
        match kind {
            wire::GROUP => self.group(field, end),
            _ => self.value(kind, end),
        }
    }

    /// Skips a group and those inside it. Its end carries its field number, so the inner numbers need not be
    /// remembered.
    fn group(&mut self, field: u64, end: usize) -> Result<(), Malformed> {
        let mut depth = 1_usize;
        loop {
            let start = self.at;
            let (number, kind) = self.tag(end)?;
            match kind {
                wire::GROUP => depth += 1,
                wire::END_GROUP if depth > 1 => depth -= 1,
                wire::END_GROUP if number == field => return Ok(()),
                wire::END_GROUP => {
                    return Err(Malformed::Protobuf { offset: start, what: "a group that ends as another" });
                }
                _ => self.value(kind, end)?,
            }
        }
    }

    fn value(&mut self, kind: u64, end: usize) -> Result<(), Malformed> {
        match kind {
            wire::VARINT => self.varint(end).map(drop),
            wire::I64 => self.bytes(8, end).map(drop),
            wire::LEN => {
                self.at = self.length(end)?;
                Ok(())
            }
            wire::I32 => self.bytes(4, end).map(drop),
            wire::END_GROUP => {
                Err(Malformed::Protobuf { offset: self.at, what: "the end of a group that never began" })
            }
            _ => Err(Malformed::Protobuf { offset: self.at, what: "an unknown wire type" }),
        }
    }

    /// Field number and wire type.
    #[inline]
    fn tag(&mut self, end: usize) -> Result<(u64, u64), Malformed> {
        let start = self.at;
        let tag = self.varint(end)?;
        match tag >> 3 {
            1..0x2000_0000 => Ok((tag >> 3, tag & 7)),
            _ => Err(Malformed::Protobuf { offset: start, what: "an impossible field number" }),
        }
    }

    /// Reads a length and returns the offset of the end of the bytes that follow.
    #[inline]
    fn length(&mut self, end: usize) -> Result<usize, Malformed> {
        let len = usize::try_from(self.varint(end)?).unwrap_or(usize::MAX);
        match self.at.checked_add(len).filter(|&inner| inner <= end) {
            Some(inner) => Ok(inner),
            None => Err(Malformed::Truncated { offset: self.at, wanted: len, len: self.data.len() }),
        }
    }

    #[inline]
    fn bytes(&mut self, len: usize, end: usize) -> Result<&[u8], Malformed> {
        let truncated = Malformed::Truncated { offset: self.at, wanted: len, len: self.data.len() };
        let inner = self.at.checked_add(len).filter(|&inner| inner <= end).ok_or(truncated)?;
        let bytes = self.data.get(self.at..inner).ok_or(truncated)?;
        self.at = inner;
        Ok(bytes)
    }

    #[inline]
    fn varint(&mut self, end: usize) -> Result<u64, Malformed> {
        let mut value = 0;
        for (i, &byte) in self.data.get(self.at..end).unwrap_or_default().iter().take(10).enumerate() {
            value |= u64::from(byte & 0x7f) << (7 * i);
            if byte < 0x80 {
                self.at += i + 1;
                return Ok(value);
            }
        }
        Err(match end - self.at.min(end) {
            0..10 => Malformed::Truncated { offset: end, wanted: 1, len: self.data.len() },
            _ => Malformed::Protobuf { offset: self.at, what: "a number of more than ten bytes" },
        })
    }
}

impl Number {
    /// Wire type of a single number.
    #[inline]
    fn wire(self, coding: Coding) -> u64 {
        match (coding, self.size()) {
            (Coding::Varint | Coding::Zigzag, _) => wire::VARINT,
            (Coding::Fixed, 8) => wire::I64,
            (Coding::Fixed, _) => wire::I32,
        }
    }

    /// Value of a varint's bits. Smaller types are truncated, as parsers do.
    #[inline]
    fn cast(self, bits: u64) -> f64 {
        match self {
            Self::Bool => f64::from(bits != 0),
            Self::I32 => (bits as i32).into(),
            Self::U32 => (bits as u32).into(),
            Self::I64 => bits as i64 as f64,
            _ => bits as f64,
        }
    }
}
