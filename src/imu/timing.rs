//! Times of the readings put right before anybody learns from them: stamps that stand, wrap or make no sense, and readings
//! that come a little late. What lies further apart than that is left to the segmenter.

mod order;
mod read;
mod stamps;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use self::order::Order;
pub use self::read::Read;
use self::stamps::Stamps;
use super::sample::ImuId;

/// Puts the readings of a recording's IMUs into the order of their times.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Readings late by no more are sorted, ns.
    late_nanos: i64,
    /// One for each IMU on a channel.
    stamps: BTreeMap<(u16, ImuId), Stamps>,
    orders: Vec<Order>,
}

impl Timing {
    /// Sorts readings that come up to `late_s` seconds late.
    pub fn new(late_s: f64) -> Self {
        Self { late_nanos: (late_s * 1e9) as i64, ..Self::default() }
    }

    /// Takes the readings of one message; those whose turn has come go to `sink`.
    pub fn pass(&mut self, channel_id: u16, log_time: u64, readings: &[Read], sink: &mut impl FnMut(Read)) {
        let Self { late_nanos, stamps, orders } = self;
        for of_one in readings.chunk_by(|(a, ..), (b, ..)| a == b) {
            let Some(&(imu, ..)) = of_one.first() else { continue };
            if orders.len() <= imu.index() {
                orders.resize_with(imu.index() + 1, || Order::new(*late_nanos));
            }
            let Some(order) = orders.get_mut(imu.index()) else { continue };
            let stamps = stamps.entry((channel_id, imu)).or_default();
            stamps.pass(log_time, of_one, *late_nanos, &mut |reading| order.pass(reading, sink));
        }
    }

    /// Lets go of all that is held back: the recording has ended.
    pub fn finish(&mut self, sink: &mut impl FnMut(Read)) {
        let Self { stamps, orders, .. } = self;
        for (&(_, imu), stamps) in stamps {
            let Some(order) = orders.get_mut(imu.index()) else { continue };
            stamps.finish(&mut |reading| order.pass(reading, sink));
        }
        orders.iter_mut().for_each(|order| order.finish(sink));
    }

    /// What was done to the times of an IMU's readings, one line each.
    pub fn remarks(&self, imu: ImuId) -> Vec<String> {
        let stamps = self.stamps.iter().filter(|((_, own), _)| *own == imu);
        let mut remarks: Vec<_> = stamps.flat_map(|(_, stamps)| stamps.remarks()).collect();
        remarks.extend(self.orders.get(imu.index()).and_then(Order::remark));
        remarks
    }
}
