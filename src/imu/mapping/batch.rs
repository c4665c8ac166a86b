//! Batch: several readings of a sensor in one message, in the elements of its lists.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::imu::decode::Decoder;
use crate::imu::decode::lists::Lists;
use crate::imu::decode::malformed::Malformed;
use crate::imu::schema::layout::Place;

/// Readings of one message, each at the same place of every list.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Batch {
    /// Indices of the numbers that are in every element of a list.
    listed: Vec<usize>,
    /// Index of the number of readings, if not all elements are used.
    count: Option<usize>,
    /// Index of the microseconds from one reading to the next, if the message's stamp is that of the last one.
    period: Option<usize>,
    /// Number of readings of the last message.
    readings: usize,
    #[serde(skip)]
    lists: Lists,
}

impl Batch {
    /// Batch of the numbers in every element of a list; `None` without any.
    pub(in crate::imu) fn of(numbers: &[Place], count: Option<usize>, period: Option<usize>) -> Option<Self> {
        let listed = numbers.iter().enumerate().filter(|(_, place)| place.is_listed()).map(|(slot, _)| slot);
        let listed: Vec<_> = listed.collect();
        (!listed.is_empty()).then(|| Self { listed, count, period, ..Self::default() })
    }

    /// Decodes a message, and returns the text in it.
    pub(in crate::imu) fn read<'d>(
        &mut self,
        decoder: &Decoder,
        data: &'d [u8],
        numbers: &mut [f64],
    ) -> Result<Cow<'d, [u8]>, Malformed> {
        self.readings = 0;
        self.lists.clear(numbers.len());
        let text = decoder.read_lists(data, numbers, &mut self.lists)?;
        let mut lengths = self.listed.iter().map(|&slot| self.lists.column(slot).len());
        let held = lengths.next().unwrap_or_default();
        if let Some(other) = lengths.find(|&other| other != held) {
            return Err(Malformed::Uneven { one: held, other });
        }
        self.readings = match self.count.and_then(|at| numbers.get(at)) {
            Some(&claimed) if claimed > held as f64 => {
                return Err(Malformed::Claims { claimed: claimed as u64, held });
            }
            // Negative and missing numbers become 0.
            Some(&claimed) => claimed as usize,
            None => held,
        };
        Ok(text)
    }

    /// Whether a number is in several elements of a list.
    pub(in crate::imu) fn is_listed(&self, slot: usize) -> bool {
        self.listed.contains(&slot)
    }

    /// Number of readings of the last message.
    pub(in crate::imu) fn readings(&self) -> usize {
        self.readings
    }

    /// Puts the numbers of one reading among the others.
    pub(in crate::imu) fn load(&self, reading: usize, numbers: &mut [f64]) {
        for &slot in &self.listed {
            if let (Some(number), Some(&value)) = (numbers.get_mut(slot), self.lists.column(slot).get(reading)) {
                *number = value;
            }
        }
    }

    /// Time of a reading in a message of this stamp. Without a period all have that of the message, and are spread up to
    /// the next one later.
    pub(in crate::imu) fn time(&self, reading: usize, stamp: Stamp, numbers: &[f64]) -> Stamp {
        let Some(micros) = self.period.and_then(|at| numbers.get(at)).filter(|&&micros| micros > 0.0) else {
            return stamp;
        };
        let later = self.readings.saturating_sub(reading + 1);
        Stamp::from_nanos(stamp.nanos().saturating_sub((micros * 1e3 * later as f64) as i64))
    }
}
