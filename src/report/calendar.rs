//! Dates and durations.

use crate::Stamp;

/// Duration in the unit that suits it.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.0} s"),
        s if s < 600.0 => format!("{} min {:.0} s", (s / 60.0).floor(), s % 60.0),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Day of a stamp; for clocks that do not count from 1970, in days since their beginning.
pub fn day(stamp: Stamp) -> String {
    match date(stamp) {
        Some(date) => date.chars().take_while(|letter| *letter != ' ').collect(),
        None => format!("day {:.1}", stamp.nanos() as f64 * 1e-9 / 86_400.0),
    }
}

/// Day and time of a stamp, to the second; for clocks that do not count from 1970, in seconds.
pub fn moment(stamp: Stamp) -> String {
    let seconds = stamp.nanos().div_euclid(1_000_000_000);
    match date(stamp) {
        Some(_) => {
            format!("{} {:02}:{:02}:{:02} UTC", day(stamp), seconds / 3600 % 24, seconds / 60 % 60, seconds % 60)
        }
        None => format!("{:.1} s", stamp.nanos() as f64 * 1e-9),
    }
}

/// Date of the Gregorian calendar and time in UTC; `None` for clocks that do not count from 1970. Days to dates by
/// Hinnant's `civil_from_days`, in years that begin in March.
pub(crate) fn date(stamp: Stamp) -> Option<String> {
    const YEAR_2000: i64 = 946_684_800;
    let seconds = stamp.nanos().div_euclid(1_000_000_000);
    if seconds < YEAR_2000 {
        return None;
    }
    let days = seconds / 86_400 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = era * 400 + year + i64::from(month <= 2);
    Some(format!("{year}-{month:02}-{day:02} {:02}:{:02} UTC", seconds / 3600 % 24, seconds / 60 % 60))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let day = |seconds: i64| date(Stamp::from_nanos(seconds * 1_000_000_000)).unwrap_or_default();
        assert_eq!(day(1_700_000_000), "2023-11-14 22:13 UTC");
        assert_eq!(day(951_782_400), "2000-02-29 00:00 UTC");
        assert_eq!(day(4_107_542_399), "2100-02-28 23:59 UTC");
        assert_eq!(day(4_107_542_400), "2100-03-01 00:00 UTC");
        assert_eq!(day(5), "");
        assert_eq!(super::day(Stamp::from_nanos(951_782_400_000_000_000)), "2000-02-29");
        assert_eq!(super::day(Stamp::from_nanos(129_600_000_000_000)), "day 1.5");
        assert_eq!(moment(Stamp::from_nanos(1_700_000_003_900_000_000)), "2023-11-14 22:13:23 UTC");
        assert_eq!(moment(Stamp::from_nanos(12_340_000_000)), "12.3 s");
    }
}
