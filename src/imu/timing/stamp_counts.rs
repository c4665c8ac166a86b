//! Number of messages whose stamps were corrected, and the texts on them.

use serde::{Deserialize, Serialize};

use super::opening::Pace;

/// Number of messages by kind of correction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct StampCounts {
    pub(super) repeats: u64,
    pub(super) spread: u64,
    pub(super) logged: u64,
    pub(super) wraps: u64,
    /// Messages with a single wrong stamp, those of them whose log time did not serve, and how far the first is off, ns.
    wrong: u64,
    pub(super) left_out: u64,
    off: i64,
    /// Messages that came too late, and the largest lateness, ns.
    late: u64,
    latest: i64,
}

impl StampCounts {
    /// Counts a single wrong stamp that is so many nanoseconds off.
    pub(super) fn count_wrong(&mut self, off: i64) {
        if self.wrong == 0 {
            self.off = off;
        }
        self.wrong += 1;
    }

    /// Counts a message that came this late, ns.
    pub(super) fn count_late(&mut self, late: i64) {
        self.late += 1;
        self.latest = self.latest.max(late);
    }

    /// Corrections, one line each.
    pub(super) fn remarks(&self, messages: u64, pace: Option<Pace>, late_nanos: i64) -> impl Iterator<Item = String> {
        let StampCounts { repeats, spread, logged, wraps, wrong, left_out, off, late, latest } = *self;
        let share =
            |count: u64| format!("{count} of {} messages ({:.1} %)", messages, 100.0 * count as f64 / messages as f64);
        let line = |count: u64, text: &str| (count > 0).then(|| format!("{} {text}", share(count)));
        let by_log = match pace {
            Some(Pace::Thousands(power)) => Some(in_another_unit(power)),
            _ => line(logged, "have stamps that stand still or make no sense: their log time is used"),
        };
        let left_out = match left_out {
            0 => String::new(),
            count => format!(
                "; where it does not fit, {} left out",
                if count == 1 { "one is".to_owned() } else { format!("{count} are") }
            ),
        };
        let off = time(off);
        let wrong = line(
            wrong,
            &format!("with a stamp far from those around it (the first by {off}): the log time is used{left_out}"),
        );
        [
            line(repeats, "repeat a reading under its stamp, and count once"),
            line(
                spread,
                "differ under one stamp: a coarse clock, or a batch; their times are spread up to the next stamp",
            ),
            by_log,
            (wraps > 0).then(|| format!("the stamps are of 32 bits and wrapped {wraps} times: they are continued")),
            wrong,
            line(late, &too_late(latest, late_nanos)),
        ]
        .into_iter()
        .flatten()
    }
}

/// Text on stamps that run 1000 to this power times as fast as the log.
fn in_another_unit(power: i32) -> String {
    const UNITS: [&str; 4] = ["nanoseconds", "microseconds", "milliseconds", "seconds"];
    let unit = |at: i32| usize::try_from(at).ok().and_then(|at| UNITS.get(at)).copied();
    let times = format!(
        "1000{}",
        ["", " · 1000", " · 1000 · 1000"].get(power.unsigned_abs() as usize - 1).unwrap_or(&" and more")
    );
    let (pace, seem, change) = match power < 0 {
        true => ("slower", unit(-power).zip(unit(0)), "Multiply"),
        false => ("faster", unit(0).zip(unit(power)), "Divide"),
    };
    let seem = seem.map_or_else(String::new, |(read, taken)| format!(", as {read} in a field of {taken} do"));
    format!(
        "the stamps run {times} times {pace} than the log times beside them{seem}: the log times are used. {change} the stamps by \
         {times} where they are written, to have the sensor's own times"
    )
}

/// Text on readings that came later than `still.late_s` allows.
fn too_late(latest: i64, late_nanos: i64) -> String {
    let seconds = latest as f64 * 1e-9;
    // The next tenth of a second is enough, and 10 s is the most that can be set.
    let enough = ((seconds * 10.0).floor() / 10.0 + 0.1).min(10.0);
    format!(
        "came late by up to {seconds:.2} s, more than still.late_s = {} allows, and are left out: set still.late_s = {enough:.1} \
         to have them sorted in",
        (late_nanos as f64 * 1e-3).round() / 1e6
    )
}

/// Length of time in words.
fn time(nanos: i64) -> String {
    let seconds = nanos.unsigned_abs() as f64 * 1e-9;
    match seconds {
        ..172_800.0 => format!("{seconds:.1} s"),
        _ => format!("{:.0} days", seconds / 86_400.0),
    }
}
