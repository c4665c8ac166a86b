//! Copies of messages with other numbers, in the same encoding; all other bytes stay.

use super::Decoder;
use super::encoding::{Encoding, HEADER, encapsulated};
use super::json::Pick;
use super::lists::Lists;
use super::protobuf::{Missing, alone};
use crate::imu::schema::layout::Number;

/// A number to be changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::imu) struct Change {
    pub(in crate::imu) slot: usize,
    /// Index among the elements of a list that the slot is wanted of; `None` for a number that is in no list.
    pub(in crate::imu) element: Option<usize>,
    pub(in crate::imu) value: f64,
}

/// Largest number up to which all integers are exact, 2⁵³.
const MOST_EXACT: f64 = 9_007_199_254_740_992.0;

impl Decoder {
    /// Copies the message with changed numbers: pairs of slot (out of `count`) and value. All other bytes stay. `None`
    /// if the message cannot be read, or a number cannot hold its value, as an integer no fraction.
    ///
    /// In protobuf, where zeros are omitted, a missing number is appended: of a repeated field, the last value counts.
    pub fn rewrite(&self, data: &[u8], count: usize, changes: &[(usize, f64)]) -> Option<Vec<u8>> {
        let changes = changes.iter().map(|&(slot, value)| Change { slot, element: None, value });
        self.rewrite_lists(data, count, &changes.collect::<Vec<_>>())
    }

    /// The same with numbers in the elements of lists.
    pub(in crate::imu) fn rewrite_lists(&self, data: &[u8], count: usize, changes: &[Change]) -> Option<Vec<u8>> {
        let (mut places, mut lists) = (vec![f64::NAN; count], Lists::default());
        lists.clear(count);
        let big = match &self.0 {
            Encoding::Json(pick) => return rewrite_json(pick, data, count, changes),
            Encoding::Protobuf(protobuf) => {
                protobuf.locate(data, &mut places, &mut lists).ok()?;
                false
            }
            Encoding::Ros1(plan) => {
                plan.walk::<false, true>(data, 0, &mut places, &mut lists).ok()?;
                false
            }
            Encoding::Cdr { xcdr1, xcdr2, delimited } => {
                let (plan, big) = encapsulated(data, xcdr1, xcdr2, delimited).ok()?;
                match big {
                    true => plan.walk::<true, true>(data, HEADER, &mut places, &mut lists).ok()?,
                    false => plan.walk::<false, true>(data, HEADER, &mut places, &mut lists).ok()?,
                };
                big
            }
        };
        let (mut out, mut missing) = (data.to_vec(), Vec::new());
        for &Change { slot, element, value } in changes {
            let mut bytes = encoded(self.number(slot)?, value)?;
            if big {
                bytes.reverse();
            }
            let place = match element {
                None => places.get(slot),
                Some(element) => lists.column(slot).get(element),
            };
            match (place, &self.0) {
                (Some(&at), _) if at.is_finite() => {
                    let at = at as usize;
                    out.get_mut(at..at + bytes.len())?.copy_from_slice(&bytes);
                }
                (Some(_), Encoding::Protobuf(protobuf)) => match element {
                    Some(element) => missing.push(Missing { slot, element, bytes }),
                    None => {
                        let (way, _) = protobuf.way(slot).filter(|(way, _)| !way.is_empty())?;
                        out.extend(alone(&way, &bytes));
                    }
                },
                _ => return None,
            }
        }
        match &self.0 {
            Encoding::Protobuf(protobuf) if !missing.is_empty() => protobuf.grown(&out, &missing),
            _ => Some(out),
        }
    }

    /// Whether a number is an integer in the messages, so that only whole values can be written.
    pub(in crate::imu) fn is_integer(&self, slot: usize) -> bool {
        self.number(slot).is_some_and(|number| !matches!(number, Number::F32 | Number::F64))
    }

    /// Type of a number in the messages. JSON has texts, which hold any number; integers of protobuf vary in length, and
    /// are not changed.
    fn number(&self, slot: usize) -> Option<Number> {
        match &self.0 {
            Encoding::Json(_) => None,
            Encoding::Protobuf(protobuf) => protobuf.way(slot).map(|(_, number)| number),
            Encoding::Ros1(plan) => plan.number(slot),
            Encoding::Cdr { xcdr1, .. } => xcdr1.number(slot),
        }
    }
}

/// Bytes of a number, least significant first; `None` if its type cannot hold the value.
fn encoded(number: Number, value: f64) -> Option<Vec<u8>> {
    let whole = |least: f64, most: f64| {
        let fits = value.fract() == 0.0 && (least..=most).contains(&value) && value.abs() <= MOST_EXACT;
        fits.then_some(value as i64)
    };
    Some(match number {
        Number::F64 => value.to_le_bytes().to_vec(),
        Number::F32 => Some(value as f32).filter(|narrow| narrow.is_finite())?.to_le_bytes().to_vec(),
        Number::I8 => i8::try_from(whole(-128.0, 127.0)?).ok()?.to_le_bytes().to_vec(),
        Number::U8 => u8::try_from(whole(0.0, 255.0)?).ok()?.to_le_bytes().to_vec(),
        Number::I16 => i16::try_from(whole(i16::MIN.into(), i16::MAX.into())?).ok()?.to_le_bytes().to_vec(),
        Number::U16 => u16::try_from(whole(0.0, u16::MAX.into())?).ok()?.to_le_bytes().to_vec(),
        Number::I32 => i32::try_from(whole(i32::MIN.into(), i32::MAX.into())?).ok()?.to_le_bytes().to_vec(),
        Number::U32 => u32::try_from(whole(0.0, u32::MAX.into())?).ok()?.to_le_bytes().to_vec(),
        Number::I64 => whole(-MOST_EXACT, MOST_EXACT)?.to_le_bytes().to_vec(),
        Number::U64 => u64::try_from(whole(0.0, MOST_EXACT)?).ok()?.to_le_bytes().to_vec(),
        Number::Bool => return None,
    })
}

/// Rewrites a JSON message. Number texts vary in length, so they are replaced from the last to the first.
fn rewrite_json(pick: &Pick, data: &[u8], count: usize, changes: &[Change]) -> Option<Vec<u8>> {
    let places = pick.locate(data, count)?;
    let place = |change: &Change| match change.element {
        None => places.numbers.get(change.slot)?.clone(),
        Some(element) => places.lists.get(change.slot)?.get(element)?.clone(),
    };
    let mut changes: Vec<_> =
        changes.iter().map(|change| Some((place(change)?, change.value))).collect::<Option<_>>()?;
    changes.sort_by_key(|(place, _)| std::cmp::Reverse(place.start));
    let mut out = data.to_vec();
    for (place, value) in changes {
        out.splice(place, serde_json::Number::from_f64(value)?.to_string().into_bytes());
    }
    Some(out)
}
