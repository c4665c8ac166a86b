//! The report as one HTML file: no script except to copy text, no network, light and dark, for screens of any width and
//! for paper.
//!
//! Each section is a module; [`plot`](super::plot) draws. Markup is made by `maud`, which escapes what is put into it.

mod account;
mod course;
mod elements;
mod faces;
mod history;
mod imu;
mod log;
mod numbers;
mod paste;
mod residuals;
mod rests;
mod signal;
mod summary;
mod temperature;

use maud::{Markup, PreEscaped, html};

use self::elements::{breakable, notes};
use self::imu::Imu;
use super::calendar::{date, duration};
use super::{Earlier, Findings, Timeline, cross_terms};
use crate::printable;

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
        visible(&self.document().into_string())
    }

    fn document(&self) -> Markup {
        const DOCTYPE: &str = "<!doctype html>\n";
        const STYLE: &str = include_str!("page/page.css");
        html! {
            (PreEscaped(DOCTYPE))
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.recording) " – Stillpoint" }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    (self.header())
                    main {
                        @if let Some(notes) = notes(self.notes) { (notes) }
                        @for timeline in self.timelines { (self.imu(timeline)) }
                    }
                    footer {
                        @if !self.settings.is_empty() {
                            details { summary { "Settings used" } pre { (self.settings) } }
                        }
                        p.dim { "Intervals are 95 %. Stillpoint " (env!("CARGO_PKG_VERSION")) "." }
                    }
                }
            }
        }
    }

    fn header(&self) -> Markup {
        let spans = self.timelines.iter().filter_map(Timeline::span);
        let when = spans.reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
        let count = self.timelines.len();
        html! {
            header {
                p.kicker { "Stillpoint report" }
                h1 { (breakable(self.recording)) }
                p.dim {
                    @if let Some((from, until)) = when { @if let Some(date) = date(from) { (date) " · " }
                        (duration(until.seconds_since(from))) " · " }
                    (count) @if count == 1 { " IMU" } @else { " IMUs" }
                }
                p.formula {
                    b { "measured = bias + S · true" } "; to correct a reading, "
                    b { "true = S⁻¹ (measured − bias)" }
                    @if self.timelines.iter().any(|timeline| timeline.findings.triads().any(|triad| !cross_terms(triad).is_empty())) {
                        "; what a triad makes of the other sensor's quantity (its rows below S) is taken off with the bias"
                    }
                }
            }
        }
    }

    fn imu(&self, timeline: &Timeline) -> Markup {
        let imu = Imu::new(timeline);
        let recorded = self.timelines.iter().map(|timeline| &timeline.findings);
        let earlier = self.earlier.map(|earlier| Earlier::new(earlier, recorded));
        // Of many recordings there are no readings, and no one command.
        let is_one = timeline.course.is_none();
        let Self { recording, timelines, settings, .. } = *self;
        let source = is_one.then_some(paste::Source { recording, settings, timelines });
        let sections = [
            Some(summary::section(&imu)),
            course::course(&imu),
            is_one.then(|| signal::acceleration(&imu)).flatten(),
            faces::section(&imu),
            Some(numbers::section(&imu, earlier.as_ref())),
            earlier.as_ref().map(|earlier| account::section(&imu, earlier)),
            paste::section(&imu, source),
            residuals::at_rest(&imu),
            residuals::of_turns(&imu),
            temperature::section(&imu),
            history::section(&imu),
            signal::statistic(&imu),
            rests::rejected(&imu),
            rests::near_misses(&imu),
            rests::accepted(&imu),
            log::section(&imu),
        ];
        html! { article { @for section in sections.iter().flatten() { (section) } } }
    }
}

/// A document whose hidden characters are escaped. They only come from outside: markup has none but line breaks.
fn visible(document: &str) -> String {
    document.split('\n').map(printable).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_cannot_break_out_of_its_text() {
        let hostile = "/imu<script>\"&\u{1b}";
        let page =
            Page { recording: hostile, timelines: &[], notes: &[hostile.into()], settings: hostile, earlier: None };
        let html = page.html();
        let escaped = "imu&lt;script&gt;&quot;&amp;\\u{1b}";
        assert_eq!((html.matches(escaped).count(), html.matches('\u{1b}').count()), (4, 0), "{html}");
    }
}
