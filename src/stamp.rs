use std::fmt;

use serde::{Deserialize, Serialize};

/// A point in time, in nanoseconds on the recording's own clock (mostly the Unix epoch).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Stamp(i64);

impl Stamp {
    /// Stamp of this number of nanoseconds.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// Stamp of an MCAP log time; saturates beyond the year 2262.
    pub fn from_log_time(log_time: u64) -> Self {
        Self(i64::try_from(log_time).unwrap_or(i64::MAX))
    }

    /// Nanoseconds since the epoch.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// Nanoseconds from `earlier` to `self`, negative if `self` comes first; saturates.
    pub const fn since(self, earlier: Self) -> i64 {
        self.0.saturating_sub(earlier.0)
    }

    /// Seconds from `earlier` to `self`.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        self.since(earlier) as f64 * 1e-9
    }

    /// Stamp this number of nanoseconds later; saturates.
    pub const fn plus_nanos(self, nanos: i64) -> Self {
        Self(self.0.saturating_add(nanos))
    }
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, nanos) = (self.0.div_euclid(1_000_000_000), self.0.rem_euclid(1_000_000_000));
        write!(f, "{seconds}.{nanos:09}")
    }
}

impl From<Stamp> for prost_types::Timestamp {
    fn from(stamp: Stamp) -> Self {
        Self { seconds: stamp.0.div_euclid(1_000_000_000), nanos: stamp.0.rem_euclid(1_000_000_000) as i32 }
    }
}
