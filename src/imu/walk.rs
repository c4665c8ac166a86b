//! Taking the steps of a [`Plan`] through the bytes of a message, without building values and without allocation.

use super::layout::Number;
use super::plan::{Gets, Plan, Step};

/// Why the bytes of a message are not what its schema says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The payload ends too early.
    #[error("the payload ends after {len} bytes, {wanted} more are expected at byte {offset}")]
    Truncated {
        /// Where the bytes are expected, from the start of the payload.
        offset: usize,
        /// How many.
        wanted: usize,
        /// Length of the payload.
        len: usize,
    },
    /// A way of writing CDR that is not read.
    #[error("the CDR encapsulation 0x{0:04x} is not read (plain CDR and XCDR2 are)")]
    Encapsulation(u16),
    /// A list is too short.
    #[error("a list has {found} elements, at least {wanted} are expected")]
    Short {
        /// How many the configuration asks for.
        wanted: u32,
        /// How many there are.
        found: u32,
    },
}

impl Plan {
    /// Walks `data` from byte `origin` on, from which alignment counts; the text found, without its terminator.
    pub(super) fn walk<'d, const BIG: bool>(
        &self,
        data: &'d [u8],
        origin: usize,
        numbers: &mut [f64],
    ) -> Result<&'d [u8], Malformed> {
        let body = data.get(origin..).unwrap_or_default();
        let mut walk = Walk::<BIG> { plan: self, origin, body, at: 0, numbers, text: &[] };
        walk.steps(&self.steps)?;
        Ok(walk.text)
    }
}

struct Walk<'p, 'd, 'n, const BIG: bool> {
    plan: &'p Plan,
    origin: usize,
    body: &'d [u8],
    at: usize,
    numbers: &'n mut [f64],
    text: &'d [u8],
}

impl<'d, const BIG: bool> Walk<'_, 'd, '_, BIG> {
    fn steps(&mut self, steps: &[Step]) -> Result<(), Malformed> {
        for step in steps {
            match step {
                Step::Span { align, len, gets } => {
                    let span = self.take(*align, *len)?;
                    self.read(span, *gets);
                }
                Step::Text { wanted } => {
                    let len = self.word()?;
                    let text = self.take(1, len as usize)?;
                    if *wanted {
                        self.text = text.strip_suffix(&[0]).unwrap_or(text);
                    }
                }
                Step::Numbers { size, align, least, gets } => {
                    let count = self.count(*least as u32)?;
                    if count > 0 {
                        let span = self.take(*align, count as usize * size)?;
                        self.read(span, *gets);
                    }
                }
                Step::Array { count, body } => self.repeat(*count, body)?,
                Step::Sequence { least, head, body } => {
                    let count = self.count(*least)?;
                    self.steps(head)?;
                    self.repeat(count - least, body)?;
                }
            }
        }
        Ok(())
    }

    /// Every element takes at least a byte, so that an absurd count ends at the end of the payload.
    fn repeat(&mut self, count: u32, body: &[Step]) -> Result<(), Malformed> {
        if !body.is_empty() {
            for _ in 0..count {
                self.steps(body)?;
            }
        }
        Ok(())
    }

    fn count(&mut self, wanted: u32) -> Result<u32, Malformed> {
        let found = self.word()?;
        if found < wanted { Err(Malformed::Short { wanted, found }) } else { Ok(found) }
    }

    fn word(&mut self) -> Result<u32, Malformed> {
        let bytes = self.take(self.plan.word, 4)?;
        Ok(unsigned::<BIG, 4>(bytes).unwrap_or_default() as u32)
    }

    #[inline]
    fn take(&mut self, align: usize, len: usize) -> Result<&'d [u8], Malformed> {
        let start = self.at.next_multiple_of(align);
        let end = start.saturating_add(len);
        let len = || self.origin + self.body.len();
        let truncated = || Malformed::Truncated { offset: self.origin + start, wanted: end - start, len: len() };
        let taken = self.body.get(start..end).ok_or_else(truncated)?;
        self.at = end;
        Ok(taken)
    }

    #[inline]
    fn read(&mut self, span: &[u8], gets: Gets) {
        for get in self.plan.gets.get(gets.from..gets.to).unwrap_or_default() {
            let value = span.get(get.at..).and_then(|bytes| get.number.read::<BIG>(bytes));
            if let (Some(slot), Some(value)) = (self.numbers.get_mut(get.slot), value) {
                *slot = value;
            }
        }
    }
}

impl Number {
    /// The number that `bytes` begin with. Integers beyond 2⁵³ are rounded.
    #[inline]
    fn read<const BIG: bool>(self, bytes: &[u8]) -> Option<f64> {
        Some(match self {
            Self::F64 => f64::from_bits(unsigned::<BIG, 8>(bytes)?),
            Self::F32 => f32::from_bits(unsigned::<BIG, 4>(bytes)? as u32).into(),
            Self::U64 => unsigned::<BIG, 8>(bytes)? as f64,
            Self::I64 => unsigned::<BIG, 8>(bytes)? as i64 as f64,
            Self::U32 => unsigned::<BIG, 4>(bytes)? as f64,
            Self::I32 => (unsigned::<BIG, 4>(bytes)? as i32).into(),
            Self::U16 => unsigned::<BIG, 2>(bytes)? as f64,
            Self::I16 => (unsigned::<BIG, 2>(bytes)? as i16).into(),
            Self::U8 | Self::Bool => unsigned::<BIG, 1>(bytes)? as f64,
            Self::I8 => (unsigned::<BIG, 1>(bytes)? as i8).into(),
        })
    }
}

#[inline]
fn unsigned<const BIG: bool, const N: usize>(bytes: &[u8]) -> Option<u64> {
    let bytes: [u8; N] = *bytes.first_chunk()?;
    let mut wide = [0; 8];
    if BIG {
        wide.get_mut(8 - N..)?.copy_from_slice(&bytes);
        Some(u64::from_be_bytes(wide))
    } else {
        wide.get_mut(..N)?.copy_from_slice(&bytes);
        Some(u64::from_le_bytes(wide))
    }
}
