//! Plots as static SVG that stretches with the page, and labels as text that does not.
//!
//! A drawing is 1000 by 1000 units whatever its size on the screen. Lines keep their width, dots are lines without
//! length. No dot is lost: what lies beyond the scale is an arrow at its edge.

use std::fmt::Write as _;

use maud::{Markup, html};

/// A drawing of values over values.
pub(super) struct Plot {
    x: Scale,
    y: Scale,
    svg: Vec<Markup>,
    labels: Vec<Markup>,
}

/// Scale from values to places.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    log: bool,
}

impl Scale {
    /// Linear scale from the lowest to the highest value, with this fraction of the range as a margin on either side.
    pub(super) fn linear(low: f64, high: f64, margin: f64) -> Self {
        let (low, high) = if low < high { (low, high) } else { (low - 0.5, low + 0.5) };
        let margin = (high - low) * margin;
        Self { low: low - margin, high: high + margin, log: false }
    }

    /// Logarithmic scale of whole decades around two positive values, which are clamped to the measurable range.
    pub(super) fn decades(low: f64, high: f64) -> Self {
        let (low, high) = (low.clamp(1e-12, 1e15), high.clamp(1e-11, 1e16));
        Self { low: low.log10().floor(), high: high.log10().ceil().max(low.log10().floor() + 1.0), log: true }
    }

    /// Place of a value: 0 at the lowest, 1 at the highest, clamped just beyond.
    fn place(self, value: f64) -> f64 {
        self.whole_place(value).clamp(-0.01, 1.01)
    }

    fn whole_place(self, value: f64) -> f64 {
        let value = if self.log { value.max(1e-12).log10() } else { value };
        (value - self.low) / (self.high - self.low)
    }

    /// Round values within the scale, and their labels.
    fn ticks(self) -> Vec<(f64, String)> {
        if self.log {
            let decades = (self.low as i32)..=(self.high as i32);
            return decades.map(|n| (10_f64.powi(n), number(10_f64.powi(n), 10_f64.powi(n)))).collect();
        }
        let step = round_step(self.high - self.low, 5.0);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).take(20).map(|i| (i as f64 * step, number(i as f64 * step, step))).collect()
    }

    /// Round times within the scale, in seconds, and their labels.
    fn clock(self) -> Vec<(f64, String)> {
        const STEPS: [f64; 14] =
            [1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0, 7200.0, 14400.0];
        let range = self.high - self.low;
        if range < 4.0 {
            return self.ticks().into_iter().map(|(value, name)| (value, format!("{name} s"))).collect();
        }
        let days = 86_400.0 * (range / 86_400.0 / 5.0).ceil();
        let step = STEPS.into_iter().find(|step| range / step <= 6.0).unwrap_or(days);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        (first..=last).take(20).map(|i| (i as f64 * step, moment(i as f64 * step))).collect()
    }
}

/// Round step of at least the range divided by `parts`.
fn round_step(range: f64, parts: f64) -> f64 {
    let raw = range / parts;
    let power = 10_f64.powf(raw.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= raw).unwrap_or(raw)
}

/// Number with the decimals that its step needs.
fn number(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// Seconds as minutes or hours on a clock.
pub(super) fn moment(seconds: f64) -> String {
    let whole = seconds.round().max(0.0) as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, minutes, seconds) => format!("{minutes}:{seconds:02}"),
        (hours, minutes, 0) => format!("{hours} h {minutes:02}"),
        (hours, minutes, seconds) => format!("{hours}:{minutes:02}:{seconds:02}"),
    }
}

impl Plot {
    pub(super) fn new(x: Scale, y: Scale) -> Self {
        Self { x, y, svg: Vec::new(), labels: Vec::new() }
    }

    fn px(&self, x: f64) -> f64 {
        (self.x.place(x) * 10_000.0).round() / 10.0
    }

    fn py(&self, y: f64) -> f64 {
        ((1.0 - self.y.place(y)) * 10_000.0).round() / 10.0
    }

    /// Draws a span of x over the whole height.
    pub(super) fn band(&mut self, from: f64, until: f64, class: &str, title: &str) {
        let (left, right) = (self.px(from), self.px(until));
        let width = ((right - left).max(1.0) * 10.0).round() / 10.0;
        self.svg.push(html! {
            rect class=(class) x=(left) y="0" width=(width) height="1000" { title { (title) } }
        });
    }

    /// Start and width of a band, as fractions of the plot's width.
    pub(super) fn extent(&self, from: f64, until: f64) -> (f64, f64) {
        (self.px(from) / 1000.0, (self.px(until) - self.px(from)) / 1000.0)
    }

    /// Draws the area between two lines with the same x.
    pub(super) fn area(&mut self, points: &[(f64, f64, f64)], class: &str) {
        let (Some(first), true) = (points.first(), points.len() > 1) else {
            points.iter().for_each(|&(x, low, high)| self.whisker(x, low, high, class, ""));
            return;
        };
        let mut path = format!("M{} {}", self.px(first.0), self.py(first.2));
        for &(x, _, high) in points.iter().skip(1) {
            let _ = write!(path, "L{} {}", self.px(x), self.py(high));
        }
        for &(x, low, _) in points.iter().rev() {
            let _ = write!(path, "L{} {}", self.px(x), self.py(low));
        }
        path.push('Z');
        self.svg.push(html! { path class={ "area " (class) } d=(path) {} });
    }

    pub(super) fn line(&mut self, points: &[(f64, f64)], class: &str) {
        let mut path = String::new();
        for (i, &(x, y)) in points.iter().enumerate() {
            let _ = write!(path, "{}{} {}", if i == 0 { 'M' } else { 'L' }, self.px(x), self.py(y));
        }
        self.svg.push(html! { path class={ "line " (class) } d=(path) {} });
    }

    /// Draws a horizontal line with its name at the right.
    pub(super) fn rule(&mut self, y: f64, class: &str, name: &str) {
        let y = self.py(y);
        self.svg.push(html! { path class={ "rule " (class) } d={ "M0 " (y) "H1000" } {} });
        if !name.is_empty() {
            let top = y / 10.0;
            self.labels.push(html! { span class={ "rule-name " (class) } style={ "top:" (top) "%" } { (name) } });
        }
    }

    /// Draws a dot; one above or below the scale is an arrow at that edge.
    pub(super) fn dot(&mut self, x: f64, y: f64, class: &str, title: &str) {
        let beyond = match self.y.whole_place(y) {
            place if place > 1.0 => Some(("above", "▲")),
            place if place < 0.0 => Some(("below", "▼")),
            _ => None,
        };
        if let Some((edge, arrow)) = beyond {
            let left = format!("left:{:.2}%", self.px(x) / 10.0);
            self.labels.push(html! {
                span class={ "beyond " (edge) " " (class) } style=(left) title=(title) { (arrow) }
            });
            return;
        }
        let (x, y) = (self.px(x), self.py(y));
        self.svg.push(html! { path class={ "dot " (class) } d={ "M" (x) " " (y) "h0" } { title { (title) } } });
    }

    pub(super) fn whisker(&mut self, x: f64, low: f64, high: f64, class: &str, title: &str) {
        let (x, low, high) = (self.px(x), self.py(low), self.py(high));
        self.svg.push(html! {
            path class={ "whisker " (class) } d={ "M" (x) " " (low) "V" (high) } { title { (title) } }
        });
    }

    /// Writes text at the top, centred at a fraction of the width.
    pub(super) fn tag(&mut self, at: f64, class: &str, text: &str) {
        let left = format!("left:{:.2}%", at * 100.0);
        self.labels.push(html! { span class={ "tag " (class) } style=(left) { (text) } });
    }

    /// The figure, with round values along y, and a clock or `names` along x.
    pub(super) fn figure(self, size: &str, caption: &str, x: Along<'_>) -> Markup {
        let on_canvas = |(at, _): &(f64, String)| (0.0..=1000.0).contains(at);
        let ys = self.y.ticks().into_iter().map(|(value, name)| (self.py(value), name));
        let ys: Vec<_> = ys.filter(on_canvas).collect();
        let (ticks, axis) = match x {
            Along::Clock => (self.x.clock(), "time since the first reading, min:s"),
            Along::Names(names, unit) => (names.to_vec(), unit),
            Along::Values(unit) => (self.x.ticks(), unit),
        };
        let xs = ticks.into_iter().map(|(value, name)| (self.px(value), name));
        let xs: Vec<_> = xs.filter(on_canvas).collect();
        html! {
            figure class={ "plot " (size) } {
                figcaption { (caption) }
                div.ys { @for (top, name) in &ys { span style={ "top:" (top / 10.0) "%" } { (name) } } }
                div.canvas {
                    svg viewBox="0 0 1000 1000" preserveAspectRatio="none" role="img" aria-label=(caption) {
                        @for (top, _) in &ys { path.grid d={ "M0 " (top) "H1000" } {} }
                        @for (left, _) in &xs { path.grid d={ "M" (left) " 0V1000" } {} }
                        @for mark in &self.svg { (mark) }
                    }
                    @for label in &self.labels { (label) }
                }
                div.xs {
                    @for (left, name) in &xs { span style={ "left:" (left / 10.0) "%" } { (name) } }
                    em { (axis) }
                }
            }
        }
    }
}

/// Labels of the x axis.
pub(super) enum Along<'a> {
    /// Seconds as minutes and hours.
    Clock,
    /// Values with their names, which are names of this.
    Names(&'a [(f64, String)], &'a str),
    /// Round values in this unit.
    Values(&'a str),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let names = |scale: Scale| scale.ticks().into_iter().map(|(_, name)| name).collect::<Vec<_>>();
        assert_eq!(names(Scale::linear(-11.0, 12.0, 0.0)), ["-10", "-5", "0", "5", "10"]);
        assert_eq!(names(Scale::linear(0.0, 0.05, 0.0)), ["0.00", "0.01", "0.02", "0.03", "0.04", "0.05"]);
        assert_eq!(names(Scale::decades(0.5, 300.0)), ["0.1", "1", "10", "100", "1000"]);
        for range in [1e-9, 0.003, 7.0, 86_400.0, 3e7] {
            for ticks in [Scale::linear(0.0, range, 0.02).ticks(), Scale::linear(0.0, range, 0.0).clock()] {
                assert!((2..=8).contains(&ticks.len()), "{range}: {ticks:?}");
            }
        }
    }

    #[test]
    fn a_dot_beyond_the_scale_is_an_arrow_at_its_edge() {
        let mut plot = Plot::new(Scale::linear(0.0, 10.0, 0.0), Scale::linear(-1.0, 1.0, 0.0));
        for (x, y) in [(1.0, 1.0), (2.0, 5.0), (3.0, -1.5)] {
            plot.dot(x, y, "f1", &format!("at {y}"));
        }
        let html = plot.figure("", "caption", Along::Clock).into_string();
        assert_eq!(
            (html.matches("▲").count(), html.matches("▼").count(), html.matches("class=\"dot").count()),
            (1, 1, 1)
        );
        assert!(html.contains(r#"<span class="beyond above f1" style="left:20.00%" title="at 5">▲</span>"#), "{html}");
    }

    #[test]
    fn moments_read_as_on_a_clock() {
        assert_eq!([5.0, 65.0, 3600.0, 5405.0].map(moment), ["0:05", "1:05", "1 h 00", "1:30:05"]);
    }
}
