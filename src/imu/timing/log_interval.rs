//! Intervals between log times.

/// Nanoseconds from log time `log` to `log_time`.
pub(super) fn since(log_time: u64, log: u64) -> i64 {
    i64::try_from(i128::from(log_time) - i128::from(log)).unwrap_or(i64::MAX)
}
