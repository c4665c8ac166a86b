//! Correction of the readings' times before they are used: stamps that stand still, wrap, stray or are in another unit,
//! and readings that arrive a little late. Larger gaps and delays end a rest (see
//! [`Segmenter`](crate::still::Segmenter)).

mod log_interval;
mod opening;
mod order;
mod read;
mod stamp_counts;
mod stamps;
mod strays;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use self::order::Order;
pub use self::read::Read;
use self::stamps::Stamps;
use super::sample::{ImuId, Reading};

/// Sorts the readings of a recording's IMUs by time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Largest delay of readings that are sorted in, ns.
    late_nanos: i64,
    /// Stamps by channel and IMU.
    stamps: BTreeMap<(u16, ImuId), Stamps>,
    orders: Vec<Order>,
}

impl Timing {
    /// Sorter of readings that arrive up to `late_s` seconds late.
    pub fn new(late_s: f64) -> Self {
        Self { late_nanos: (late_s * 1e9) as i64, ..Self::default() }
    }

    /// Adds the readings of one message, and passes those whose turn has come to `sink`. A sensor's second reading in it
    /// counts as that of another message.
    pub fn pass(&mut self, channel_id: u16, log_time: u64, readings: &[Read], sink: &mut impl FnMut(Read)) {
        let Self { late_nanos, stamps, orders } = self;
        for of_one in readings.chunk_by(|(a, ..), (b, ..)| a == b) {
            let Some(&(imu, ..)) = of_one.first() else { continue };
            if orders.len() <= imu.index() {
                orders.resize_with(imu.index() + 1, || Order::new(*late_nanos));
            }
            let Some(order) = orders.get_mut(imu.index()) else { continue };
            let stamps = stamps.entry((channel_id, imu)).or_default();
            let mut rest = of_one;
            while !rest.is_empty() {
                let (at_once, later) = rest.split_at(at_once(rest));
                stamps.pass(log_time, at_once, *late_nanos, &mut |reading| order.pass(reading, sink));
                rest = later;
            }
        }
    }

    /// Releases all held readings at the end of the recording.
    pub fn finish(&mut self, sink: &mut impl FnMut(Read)) {
        let Self { stamps, orders, late_nanos } = self;
        // Short channels were held from beginning to end: their readings are of the same time.
        let mut left: Vec<Read> = Vec::new();
        stamps.values_mut().for_each(|stamps| stamps.finish(*late_nanos, &mut |read| left.push(read)));
        if stamps.len() > 1 {
            left.sort_by_key(|(.., reading)| reading.stamp());
        }
        for read in left {
            let order = orders.get_mut(read.0.index());
            order.into_iter().for_each(|order| order.pass(read, sink));
        }
        orders.iter_mut().for_each(|order| order.finish(sink));
    }

    /// Corrections to the times of an IMU's readings, one line each.
    pub fn remarks(&self, imu: ImuId) -> Vec<String> {
        let stamps = self.stamps.iter().filter(|((_, own), _)| *own == imu);
        let mut remarks: Vec<_> = stamps.flat_map(|(_, stamps)| stamps.remarks(self.late_nanos)).collect();
        remarks.extend(self.orders.get(imu.index()).and_then(Order::remark));
        remarks
    }
}

/// Number of leading readings up to the second one of a sensor.
fn at_once(readings: &[Read]) -> usize {
    let is_second = |i: &usize| {
        let Some((before, [(_, sensor, _), ..])) = readings.split_at_checked(*i) else { return false };
        before.iter().any(|(_, own, reading)| own == sensor && matches!(reading, Reading::Sample(_)))
    };
    (1..readings.len()).find(is_second).unwrap_or(readings.len())
}
