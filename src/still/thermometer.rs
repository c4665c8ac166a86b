//! Thermometer of an IMU: the mean temperature of each rest.
//!
//! A temperature counts from the moment at which it is recorded, by the accelerometer's clock: it changes over seconds,
//! and the clocks of sensors and of their thermometers need not agree.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Longest time for which a temperature stands for what comes after it, s.
const HOLDS: f64 = 60.0;

/// Largest number of temperatures that wait until the accelerometer decides about them, as of samples.
const MOST: usize = 65_536;

/// Latest temperatures, °C, and the sums of the open rest.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Thermometer {
    /// Temperatures that may still enter a rest.
    recent: VecDeque<(Stamp, f64)>,
    /// Last temperature that no longer can.
    last: Option<(Stamp, f64)>,
    open: Option<OpenRest>,
}

/// Open rest.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct OpenRest {
    start: Stamp,
    /// Temperature before it.
    before: Option<(Stamp, f64)>,
    mean: f64,
    count: u64,
}

impl Thermometer {
    /// Takes a temperature that is recorded after the reading with this stamp. Of several the last one counts.
    pub(super) fn take(&mut self, stamp: Stamp, celsius: f64) {
        match self.recent.back_mut() {
            Some(last) if last.0 == stamp => last.1 = celsius,
            _ => {
                if self.recent.len() == MOST {
                    self.recent.pop_front();
                }
                self.recent.push_back((stamp, celsius));
            }
        }
    }

    /// Opens a rest at `start`.
    pub(super) fn open(&mut self, start: Stamp) {
        self.open = Some(OpenRest { start, before: self.last, mean: 0.0, count: 0 });
    }

    /// Moves the temperatures up to `until` into the open rest.
    pub(super) fn commit(&mut self, until: Stamp) {
        while let Some((stamp, celsius)) = self.recent.front().copied().filter(|(stamp, _)| *stamp <= until) {
            self.recent.pop_front();
            self.last = Some((stamp, celsius));
            let Some(open) = &mut self.open else { continue };
            if stamp < open.start {
                open.before = self.last;
            } else {
                open.count += 1;
                open.mean += (celsius - open.mean) / open.count as f64;
            }
        }
    }

    /// Ends the open rest. Its mean temperature, or the one shortly before it; `None` if there is neither.
    pub(super) fn close(&mut self) -> Option<f64> {
        let OpenRest { start, before, mean, count } = self.open.take()?;
        let held = before.filter(|(stamp, _)| start.seconds_since(*stamp).abs() <= HOLDS);
        if count > 0 { Some(mean) } else { held.map(|(_, celsius)| celsius) }
    }

    /// Starts anew after a break of the time base. A temperature that was just recorded still holds.
    pub(super) fn forget(&mut self) {
        self.last = self.recent.back().copied().or(self.last);
        self.recent.clear();
        self.open = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: i64) -> Stamp {
        Stamp::from_nanos(seconds * 1_000_000_000)
    }

    #[test]
    fn a_rest_has_the_mean_of_its_own_temperatures_or_the_one_shortly_before() {
        let mut thermometer = Thermometer::default();
        (0..10).for_each(|s| thermometer.take(at(s), 20.0 + s as f64));
        thermometer.commit(at(2));
        thermometer.open(at(4));
        thermometer.commit(at(6));
        assert_eq!(thermometer.close(), Some(25.0));
        thermometer.commit(at(9));
        for (start, found) in [(20, Some(29.0)), (68, Some(29.0)), (70, None), (-60, None)] {
            thermometer.open(at(start));
            assert_eq!(thermometer.close(), found, "{start}");
        }
    }

    #[test]
    fn without_a_temperature_there_is_none() {
        let mut thermometer = Thermometer::default();
        thermometer.open(at(0));
        thermometer.commit(at(9));
        assert_eq!(thermometer.close(), None);
    }

    #[test]
    fn temperatures_without_readings_between_them_take_no_memory() {
        let mut thermometer = Thermometer::default();
        (0..1000).for_each(|i| thermometer.take(at(1), f64::from(i)));
        assert_eq!(thermometer.recent.len(), 1);
        thermometer.open(at(0));
        thermometer.commit(at(1));
        assert_eq!(thermometer.close(), Some(999.0));
    }
}
