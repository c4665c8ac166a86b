//! The report as one HTML file: no script except to copy text, no network, light and dark, for screens of any width and
//! for paper.
//!
//! Each section is a module; [`plot`](super::plot) draws.

mod faces;
mod history;
mod numbers;
mod paste;
mod rests;
mod signal;

use std::fmt::Write as _;

pub(super) use super::html::escape;
use super::{Findings, Timeline, calibration, model, vector};
use crate::Stamp;
use crate::messages::foxglove::log::Level;
use crate::messages::{Segment, Triad};

/// Content of a report.
#[derive(Debug)]
pub struct Page<'a> {
    /// Name of the recording.
    pub recording: &'a str,
    /// Its IMUs.
    pub timelines: &'a [Timeline],
    /// Missing or wrong parts of the recording, one line each.
    pub notes: &'a [String],
    /// Settings that were used, as TOML.
    pub settings: &'a str,
    /// An earlier calibration to compare with.
    pub earlier: Option<&'a [Findings]>,
}

impl Page<'_> {
    /// The HTML file.
    pub fn html(&self) -> String {
        let Self { recording, timelines, .. } = self;
        let imus: String = timelines.iter().map(|timeline| self.imu(timeline)).collect();
        let notes = list("notes", self.notes);
        let plural = if timelines.len() == 1 { "IMU" } else { "IMUs" };
        let when = timelines.iter().filter_map(Timeline::span).reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
        let when = when.map(|(from, until)| format!("{}{} · ", date(from), duration(until.seconds_since(from))));
        let settings = match self.settings {
            "" => String::new(),
            settings => format!("<details><summary>Settings used</summary><pre>{}</pre></details>", escape(settings)),
        };
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
             <meta name=\"color-scheme\" content=\"light dark\"><title>{name} – Stillpoint</title><style>{css}</style></head>\n\
             <body><header><p class=\"kicker\">Stillpoint report</p><h1>{title}</h1><p class=\"dim\">{when}{n} {plural}</p>\
             <p class=\"formula\"><b>measured = bias + S · true</b>; to correct a reading, <b>true = S⁻¹ (measured − bias)</b></p></header>\n\
             <main>{notes}{imus}</main>\n<footer>{settings}<p class=\"dim\">Intervals are 95 %. Stillpoint {version}.</p></footer></body></html>\n",
            name = escape(recording),
            title = breakable(recording),
            css = include_str!("page/page.css"),
            when = when.unwrap_or_default(),
            n = timelines.len(),
            version = env!("CARGO_PKG_VERSION"),
        )
    }

    fn imu(&self, timeline: &Timeline) -> String {
        let imu = Imu::new(timeline);
        let sections = [
            summary(&imu),
            signal::acceleration(&imu),
            faces::section(&imu),
            numbers::section(&imu, self.earlier),
            paste::section(&imu, self.recording),
            rests::residuals(&imu),
            history::section(&imu),
            signal::statistic(&imu),
            rests::rejected(&imu),
            rests::near_misses(&imu),
            rests::accepted(&imu),
            log(timeline, &imu),
        ];
        format!("<article>{}</article>\n", sections.concat())
    }
}

/// One IMU's timeline with data that several sections need.
struct Imu<'a> {
    timeline: &'a Timeline,
    findings: &'a Findings,
    /// Start of its clock, and its duration in seconds.
    origin: Stamp,
    seconds: f64,
    rests: Vec<Rest<'a>>,
}

/// A rest as the sections need it.
struct Rest<'a> {
    segment: &'a Segment,
    /// Number, counted from 1.
    number: usize,
    /// Seconds since the origin.
    from: f64,
    until: f64,
    /// Index of its face in the coverage.
    face: Option<usize>,
    /// ‖a‖ − g of the mean reading, before and after correction, m/s².
    raw: Option<f64>,
    corrected: Option<f64>,
    /// Direction of the mean reading, corrected if possible.
    up: Option<nalgebra::Vector3<f64>>,
}

impl<'a> Imu<'a> {
    fn new(timeline: &'a Timeline) -> Self {
        let findings = &timeline.findings;
        let first = findings.rests.keys().next().map(|&nanos| Stamp::from_nanos(nanos));
        let (origin, end) = timeline.span().unwrap_or_else(|| {
            let last = findings.rests.values().map(|rest| super::nanos(&rest.end)).max().unwrap_or_default();
            (first.unwrap_or_default(), Stamp::from_nanos(last))
        });
        let accelerometer = findings.calibration.as_ref().and_then(|found| found.accelerometer.as_ref());
        let known = accelerometer.and_then(calibration);
        let gravity = findings.calibration.as_ref().map_or(9.80665, |found| found.gravity);
        let faces = findings.coverage.as_ref().map_or(&[][..], |coverage| &coverage.faces);
        let rest = |(i, segment): (usize, &'a Segment)| {
            let at = |stamp| Stamp::from_nanos(super::nanos(stamp)).seconds_since(origin);
            let mean = segment.means.iter().find(|mean| mean.sensor == "accelerometer");
            let mean = mean.and_then(|mean| mean.mean.as_ref()).map(vector);
            let corrected = mean.zip(known.as_ref()).map(|(mean, known)| known.correct(&mean));
            Rest {
                segment,
                number: i + 1,
                from: at(&segment.start),
                until: at(&segment.end),
                face: faces.iter().position(|face| face.name == segment.face),
                raw: mean.map(|mean| mean.norm() - gravity),
                corrected: corrected.map(|value| value.norm() - gravity),
                up: corrected.or(mean).and_then(|value| value.try_normalize(1e-9)),
            }
        };
        let rests = findings.rests.values().enumerate().map(rest).collect();
        Self { timeline, findings, origin, seconds: end.seconds_since(origin).max(1e-3), rests }
    }

    fn accelerometer(&self) -> Option<&'a Triad> {
        self.findings.calibration.as_ref()?.accelerometer.as_ref()
    }

    /// Every triad of the calibration.
    fn triads(&self) -> impl Iterator<Item = &'a Triad> + use<'a> {
        let found = self.findings.calibration.iter();
        found.flat_map(|found| found.accelerometer.iter().chain(&found.gyroscope).chain(&found.secondary))
    }
}

/// The verdict, the next step, and the most important numbers.
fn summary(imu: &Imu<'_>) -> String {
    let Findings { name, topic, coverage, .. } = imu.findings;
    let heading = match topic == name {
        true => breakable(name),
        false => format!("{} <small>{}</small>", breakable(name), breakable(topic)),
    };
    let badges: String = imu.triads().map(badge).collect();
    let next = &imu.findings.next_step();
    let (class, label) = if imu.findings.is_done() { ("next done", "✓") } else { ("next", "Next") };
    let why = imu.findings.reason().filter(|why| why != next);
    let why = why.map(|why| {
        format!("<p class=\"why\">No accelerometer calibration: {}.</p>", escape(&minus(why.trim_end_matches('.'))))
    });

    let (found, accepted) = (imu.rests.len(), imu.findings.accepted());
    let mut tiles = tile("Rests", &format!("{accepted} <small>of {found} accepted</small>"));
    if let Some(coverage) = coverage {
        let seen = coverage.faces.iter().filter(|face| face.placements > 0).count();
        tiles += &tile("Faces", &format!("{seen} <small>of {} seen</small>", coverage.faces.len()));
    }
    if let Some([before, after]) = imu.findings.residuals() {
        let value = format!("{before:.3} → {after:.4} <small>m/s²</small>");
        tiles += &tile("Observed: ‖a‖ − g at rest, before → after", &value);
    }
    if let Some(worst) = imu.accelerometer().and_then(|triad| triad.worst_case_error) {
        tiles += &tile(
            "Not excluded by these poses: an error of a corrected reading",
            &format!("{worst:.3} <small>m/s² (95 %)</small>"),
        );
    }
    let why = why.unwrap_or_default();
    format!(
        "<h2>{heading}</h2><p class=\"badges\">{badges}</p><p class=\"{class}\"><b>{label}</b> {}</p>{why}<div class=\"tiles\">{tiles}</div>",
        escape(&minus(&sentence(next)))
    )
}

fn badge(triad: &Triad) -> String {
    let status = triad.status().as_str_name();
    let model = model(triad.model()).map(|model| format!(" {model}")).unwrap_or_default();
    let class = status.to_lowercase();
    format!("<span class=\"badge {class}\">{}<b>{status}</b>{model}</span> ", escape(&triad.sensor))
}

fn tile(name: &str, value: &str) -> String {
    format!("<div class=\"tile\"><span>{name}</span><strong>{value}</strong></div>")
}

fn log(timeline: &Timeline, imu: &Imu<'_>) -> String {
    if timeline.log.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    for (at, level, text) in &timeline.log {
        let at = Stamp::from_log_time(*at).seconds_since(imu.origin);
        let class = if *level >= Level::Warning { "warning" } else { "info" };
        let _ = write!(
            rows,
            "<tr class=\"{class}\"><td class=\"n\">{}</td><td>{}</td></tr>",
            super::plot::moment(at),
            escape(text)
        );
    }
    if timeline.unlogged > 0 {
        let _ = write!(rows, "<tr><td></td><td>… and {} more</td></tr>", timeline.unlogged);
    }
    format!("<details><summary>Log</summary><div class=\"scroll\"><table class=\"log\">{rows}</table></div></details>")
}

fn list(class: &str, lines: &[String]) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let items: String = lines.iter().map(|line| format!("<li>{}</li>", escape(line))).collect();
    format!("<ul class=\"{class}\">{items}</ul>")
}

/// A section under its heading; nothing if it is empty.
fn section(heading: &str, content: &str) -> String {
    if content.is_empty() { String::new() } else { format!("<section><h3>{heading}</h3>{content}</section>") }
}

/// A name that breaks only between its parts.
fn breakable(name: &str) -> String {
    escape(name).replace('/', "/<wbr>").replace('_', "_<wbr>")
}

/// Text with a capital at its beginning and a full stop at its end.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}.", letters.as_str().trim_end_matches('.'))
}

/// Text with minus signs that no line breaks behind.
fn minus(text: &str) -> String {
    text.replace(" -", " \u{2212}")
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.0} s"),
        s if s < 600.0 => format!("{} min {:.0} s", (s / 60.0).floor(), s % 60.0),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Date of the Gregorian calendar and time in UTC; empty for clocks that do not count from 1970. Days to dates by
/// Hinnant's `civil_from_days`, in years that begin in March.
fn date(stamp: Stamp) -> String {
    const YEAR_2000: i64 = 946_684_800;
    let seconds = stamp.nanos().div_euclid(1_000_000_000);
    if seconds < YEAR_2000 {
        return String::new();
    }
    let days = seconds / 86_400 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = era * 400 + year + i64::from(month <= 2);
    format!("{year}-{month:02}-{day:02} {:02}:{:02} UTC · ", seconds / 3600 % 24, seconds / 60 % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let day = |seconds: i64| date(Stamp::from_nanos(seconds * 1_000_000_000));
        assert_eq!(day(1_700_000_000), "2023-11-14 22:13 UTC · ");
        assert_eq!(day(951_782_400), "2000-02-29 00:00 UTC · ");
        assert_eq!(day(4_107_542_399), "2100-02-28 23:59 UTC · ");
        assert_eq!(day(4_107_542_400), "2100-03-01 00:00 UTC · ");
        assert_eq!(day(5), "");
    }

    #[test]
    fn a_recording_cannot_break_out_of_its_text() {
        assert_eq!(
            escape("/imu<script>\"&'\u{1b}"),
            "&lt;script&gt;&quot;&amp;&#39;\\u{1b}".replace("&lt;s", "/imu&lt;s")
        );
        assert_eq!(sentence("turn it."), "Turn it.");
    }
}
