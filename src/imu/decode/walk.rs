//! Execution of a [`Plan`] on the bytes of a message, without building values and without allocation.

use super::lists::Lists;
use super::malformed::Malformed;
use super::plan::{Gets, Plan, Step};
use crate::imu::schema::layout::Number;

/// Bytes per character of a `wstring`, by writer: Fast DDS and Cyclone DDS under ROS 2 write 4 and count characters;
/// Fast CDR by itself writes 2 and counts characters; Cyclone DDS in XCDR2 writes 2 and counts bytes.
const WIDTHS: [usize; 3] = [4, 2, 1];

/// Most bytes after the last field: payloads may be padded to words.
const PADDING: usize = 3;

impl Plan {
    /// Walks `data` from byte `origin` on, from which alignment counts. Returns the text, without its terminator. With
    /// `LOCATE`, `numbers` receives the offsets of the numbers instead of their values. Numbers in every element of a list
    /// go into `lists`.
    pub(super) fn walk<'d, const BIG: bool, const LOCATE: bool>(
        &self,
        data: &'d [u8],
        origin: usize,
        numbers: &mut [f64],
        lists: &mut Lists,
    ) -> Result<&'d [u8], Malformed> {
        let body = data.get(origin..).unwrap_or_default();
        if !self.wide {
            return Ok(self.walk_with::<BIG, LOCATE>(body, origin, numbers, lists, 1)?.text);
        }
        // Use the width with which the message ends closest to the end of the payload.
        let mut best: Option<Fit> = None;
        for width in WIDTHS {
            let Ok(walk) = self.walk_with::<BIG, LOCATE>(body, origin, numbers, lists, width) else { continue };
            let fit = walk.fit();
            match &best {
                _ if fit.padding > PADDING => {}
                Some(best) if fit.padding > best.padding => {}
                Some(best) if fit.padding == best.padding && fit.digest != best.digest => {
                    return Err(Malformed::WideText);
                }
                _ => best = Some(fit),
            }
        }
        let width = best.as_ref().map_or(WIDTHS[0], |fit| fit.width);
        let walk = self.walk_with::<BIG, LOCATE>(body, origin, numbers, lists, width)?;
        if best.is_some() { Ok(walk.text) } else { Err(Malformed::WideText) }
    }

    #[inline]
    fn walk_with<'p, 'd, 'n, const BIG: bool, const LOCATE: bool>(
        &'p self,
        body: &'d [u8],
        origin: usize,
        numbers: &'n mut [f64],
        lists: &'n mut Lists,
        wide: usize,
    ) -> Result<PlanWalk<'p, 'd, 'n, BIG, LOCATE>, Malformed> {
        if self.wide {
            lists.restart();
        }
        let mut walk = PlanWalk::<BIG, LOCATE> { plan: self, origin, body, at: 0, wide, numbers, lists, text: &[] };
        walk.steps(&self.steps)?;
        Ok(walk)
    }
}

/// Fit of a `wstring` width to a payload.
struct Fit {
    width: usize,
    /// Number of bytes left over.
    padding: usize,
    /// Digest of the values read.
    digest: u32,
}

struct PlanWalk<'p, 'd, 'n, const BIG: bool, const LOCATE: bool> {
    plan: &'p Plan,
    origin: usize,
    body: &'d [u8],
    at: usize,
    /// Bytes per character of a `wstring`.
    wide: usize,
    numbers: &'n mut [f64],
    lists: &'n mut Lists,
    text: &'d [u8],
}

impl<'d, const BIG: bool, const LOCATE: bool> PlanWalk<'_, 'd, '_, BIG, LOCATE> {
    fn fit(&self) -> Fit {
        let mut digest = crc32fast::Hasher::new();
        self.numbers.iter().for_each(|number| digest.update(&number.to_le_bytes()));
        digest.update(self.text);
        Fit { width: self.wide, padding: self.body.len() - self.at, digest: digest.finalize() }
    }

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
                Step::WideText => {
                    let len = self.word()? as usize;
                    self.take(1, len.saturating_mul(self.wide))?;
                }
                Step::Numbers { size, align, least, gets } => {
                    let count = self.count(*least as u32)?;
                    if count > 0 {
                        let span = self.take(*align, count as usize * size)?;
                        self.read(span, *gets);
                    }
                }
                Step::Delimited { body } => {
                    let len = self.word()? as usize;
                    let start = self.at;
                    self.take(1, len)?;
                    let (end, whole) = (self.at, self.body);
                    self.at = start;
                    self.body = whole.get(..end).unwrap_or_default();
                    self.steps(body)?;
                    // Later versions of the type may have more fields.
                    (self.at, self.body) = (end, whole);
                }
                Step::Array { count, body } => self.repeat(*count, body)?,
                Step::Sequence { least, head, body } => {
                    let count = self.count(*least)?;
                    self.steps(head)?;
                    self.repeat(count - least, body)?;
                }
                Step::Every { count, body, slots } => {
                    let count = count.map_or_else(|| self.count(0), Ok)?;
                    for i in 0..count {
                        self.steps(body)?;
                        for &(slot, _) in slots.iter().filter(|(_, stride)| stride.takes(i)) {
                            self.lists.push(slot, self.numbers.get(slot).copied().unwrap_or(f64::NAN));
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Repeats a body. Every element takes at least a byte, so an absurd count stops at the end of the payload.
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
            let value = match LOCATE {
                true => Some((self.origin + self.at - span.len() + get.at) as f64),
                false => span.get(get.at..).and_then(|bytes| get.number.read::<BIG>(bytes)),
            };
            if let (Some(slot), Some(value)) = (self.numbers.get_mut(get.slot), value) {
                *slot = value;
            }
        }
    }
}

impl Number {
    /// Number at the beginning of `bytes`. Integers beyond 2⁵³ are rounded.
    #[inline]
    pub(super) fn read<const BIG: bool>(self, bytes: &[u8]) -> Option<f64> {
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
