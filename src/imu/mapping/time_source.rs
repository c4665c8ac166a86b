//! Source of a message's time: its stamp, or its log time.

use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::imu::decode::Decoder;
use crate::imu::schema::layout::{Layout, Place};
use crate::imu::schema::path::FieldPath;

/// Time source of a channel. The choice is made by its first message, and stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::imu) struct TimeSource {
    unit: Option<Unit>,
    choice: Option<Choice>,
}

/// Unit of the stamp in the first numbers of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Unit {
    /// Seconds, then nanoseconds.
    Seconds,
    Micros,
    /// One number, in so many nanoseconds.
    Nanos(u32),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Choice {
    Stamp,
    LogTime,
}

/// Fields of a message that hold its stamp and its `frame_id`.
pub(in crate::imu) struct StampFields {
    pub(in crate::imu) clock: TimeSource,
    pub(in crate::imu) numbers: Vec<Place>,
    pub(in crate::imu) frame: Option<Place>,
}

impl TimeSource {
    /// Stamp in `numbers`, or the log time if the stamp of the first message was 0.
    pub(in crate::imu) fn read(&mut self, numbers: &[f64], log_time: u64) -> Stamp {
        let stamp = match (self.unit, numbers) {
            // Whole numbers; a missing number (NaN) becomes 0.
            (Some(Unit::Seconds), &[seconds, nanos, ..]) => {
                (seconds as i64).saturating_mul(1_000_000_000).saturating_add(nanos as i64)
            }
            (Some(Unit::Micros), &[micros, ..]) => (micros as i64).saturating_mul(1000),
            (Some(Unit::Nanos(unit)), &[number, ..]) => (number * f64::from(unit)) as i64,
            _ => 0,
        };
        let choice = *self.choice.get_or_insert(if stamp == 0 { Choice::LogTime } else { Choice::Stamp });
        match choice {
            Choice::Stamp => Stamp::from_nanos(stamp),
            Choice::LogTime => Stamp::from_log_time(log_time),
        }
    }
}

/// Stamp in the header of the message itself, where viewers look for it; `None` if there is none, or it is 0.
pub fn header_stamp(layout: &Layout, data: &[u8]) -> Option<Stamp> {
    let StampFields { mut clock, numbers: places, .. } =
        StampFields::of(layout, &FieldPath::default().join("header"), "stamp")?;
    let mut numbers = vec![0.0; places.len()];
    Decoder::new(layout, &places, None).ok()?.read(data, &mut numbers).ok()?;
    Some(clock.read(&numbers, 0)).filter(|stamp| stamp.nanos() != 0)
}

impl StampFields {
    /// Fields of the message that holds the vector, or of the nearest message around it. Each element of a list may have
    /// its own stamp, even inside the vector; their frame is that of the message around the list.
    pub(in crate::imu) fn nearest(layout: &Layout, vector: &FieldPath) -> Self {
        let mut around = Some(if vector.is_listed() { vector.clone() } else { vector.parent().unwrap_or_default() });
        let mut own = None;
        while let Some(message) = around {
            if vector.is_listed() && own.is_none() {
                own = Self::in_list(layout, &message);
            }
            if !message.is_listed()
                && let Some(found) = Self::at(layout, &message)
            {
                return match own {
                    Some(own) => Self { frame: found.frame, ..own },
                    None => found,
                };
            }
            around = message.parent();
        }
        if let Some(own) = own {
            return own;
        }
        Self { clock: TimeSource { unit: None, choice: None }, numbers: Vec::new(), frame: None }
    }

    /// Fields of a stamp in microseconds, without a frame.
    pub(in crate::imu) fn micros(place: Place) -> Self {
        Self { clock: TimeSource { unit: Some(Unit::Micros), choice: None }, numbers: vec![place], frame: None }
    }

    /// Fields of a `std_msgs/Header`, of a message with the same fields, or of a time by itself.
    fn at(layout: &Layout, message: &FieldPath) -> Option<Self> {
        let header = message.join("header");
        let places = [(&header, "stamp"), (message, "stamp"), (message, "timestamp"), (message, "time")];
        places.into_iter().find_map(|(around, name)| Self::of(layout, around, name))
    }

    /// Stamp of an element of a list, in the message around it or beside its list.
    fn in_list(layout: &Layout, message: &FieldPath) -> Option<Self> {
        const UNITS: [(&str, u32); 4] = [("_ns", 1), ("_us", 1000), ("_ms", 1_000_000), ("_s", 1_000_000_000)];
        let is_listed = message.is_listed();
        let found = is_listed.then(|| {
            let report = message.join("report");
            let special = [message, &report].into_iter().find_map(|around| Self::of(layout, around, "ts"));
            Self::at(layout, message).or(special)
        });
        let number = |stem: &str| {
            UNITS.iter().find_map(|(suffix, nanos)| {
                let path = message.join(&format!("{stem}{suffix}"));
                let place = layout.find_number(&if is_listed { path } else { path.every() })?;
                let clock = TimeSource { unit: Some(Unit::Nanos(*nanos)), choice: None };
                Some(Self { clock, numbers: vec![place], frame: None })
            })
        };
        found.flatten().or_else(|| ["timestamp", "stamp", "time", "ts", "t"].into_iter().find_map(number))
    }

    fn of(layout: &Layout, around: &FieldPath, name: &str) -> Option<Self> {
        let stamp = around.join(name);
        let names = [("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec"), ("seconds", "nanos")];
        let numbers = names.iter().find_map(|(seconds, nanos)| {
            Some(vec![layout.find_number(&stamp.join(seconds))?, layout.find_number(&stamp.join(nanos))?])
        });
        let clock = TimeSource { unit: Some(Unit::Seconds), choice: None };
        Some(Self { clock, numbers: numbers?, frame: layout.find_text(&around.join("frame_id")) })
    }
}
