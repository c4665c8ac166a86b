//! State of one triad in the segmenter: its noise statistic, its latest samples, and the sums of the open rest.

use std::collections::VecDeque;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::allan_variance::{AllanSums, Cascade};
use super::alternation::Alternation;
use super::config::{Config, Detector};
use super::noise_floor::NoiseFloor;
use super::rest::{Correlation, Sums, TriadMean};
use super::saturation::ReadingRange;
use super::signal::Signal;
use super::time_base::{Tick, TimeBase};
use super::window::Window;
use crate::Stamp;
use crate::imu::Sample;

/// Fewest samples in a window: fewer say too little about a variance.
const MIN_WINDOW: usize = 20;
/// Most samples in a window, whatever the stamps say.
const MAX_WINDOW: usize = 16_384;
/// Largest number of samples that wait until the accelerometer decides about them: two of the longest windows, and as
/// much again for a clock that runs ahead.
const MAX_RECENT: usize = 4 * MAX_WINDOW;
/// Settling time of a sensor that was put down, ns: not used for a random walk.
const SETTLING: i64 = 3_000_000_000;
/// Window of the thesis, in samples.
const THESIS_WINDOW: usize = 100;

/// State of one triad.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct TriadTrack {
    clock: TimeBase,
    window_nanos: f64,
    reference: NoiseReference,
    /// Samples in a window, once the sample period is known.
    window_size: Option<usize>,
    /// Window and floor of a triad that votes.
    quiet: Option<Quiet>,
    recent: VecDeque<(Stamp, Vector3<f64>)>,
    /// Number of readings before those.
    passed: u64,
    /// Stamps of those readings that the driver reported as clipped.
    clipped: VecDeque<Stamp>,
    open: Option<Sums>,
    /// Averages of the current stretch, and its first and last stamp: the open rest and those that it was split from.
    cascade: Cascade,
    stretch: Option<(Stamp, Stamp)>,
    /// Correlation of the noise in all rests so far.
    correlation: Correlation,
    extremes: Option<ReadingRange>,
    readings: u64,
    /// Whether several sensors take turns.
    alternation: Alternation,
    /// Sample period that the window was sized for, ns.
    sized_for: Option<i64>,
}

/// Reference for the deviation in the window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum NoiseReference {
    /// Learned floor, accepted up to this noise of one axis.
    Learned { ceiling: f64 },
    /// Fixed limit of the standard deviation of every axis, as in the thesis.
    Fixed { limit: f64 },
    /// No reference: the triad does not vote.
    None,
}

/// Window and noise floor, once the sample period is known.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Quiet {
    window: Window,
    floor: NoiseFloor,
    since_floor: usize,
}

impl TriadTrack {
    pub(super) fn new(config: &Config, reference: NoiseReference) -> Self {
        Self {
            clock: TimeBase::new(config.gap_s),
            window_nanos: config.window_s * 1e9,
            reference,
            window_size: None,
            quiet: None,
            recent: VecDeque::new(),
            passed: 0,
            clipped: VecDeque::new(),
            open: None,
            cascade: Cascade::default(),
            stretch: None,
            correlation: Correlation::UNKNOWN,
            extremes: None,
            readings: 0,
            alternation: Alternation::default(),
            sized_for: None,
        }
    }

    /// Classifies the stamp of the next sample; unless it is to be dropped, [`take`](Self::take) it next.
    pub(super) fn tick(&mut self, stamp: Stamp) -> Tick {
        self.clock.tick(stamp)
    }

    /// Takes a sample.
    pub(super) fn take(&mut self, sample: &Sample) {
        if self.recent.len() >= MAX_RECENT {
            self.recent.pop_front();
            self.passed += 1;
        }
        self.recent.push_back((sample.stamp, sample.value));
        self.alternation.push(&self.recent);
        self.readings += 1;
        match &mut self.extremes {
            Some(extremes) => extremes.push(&sample.value),
            None => self.extremes = Some(ReadingRange::of(&sample.value)),
        }
        self.size_window();
        if let Some(quiet) = &mut self.quiet {
            quiet.push(&sample.value);
        }
    }

    /// Marks the reading of a stamp as clipped.
    pub(super) fn clip(&mut self, stamp: Stamp) {
        if self.clipped.len() >= MAX_RECENT {
            self.clipped.pop_front();
        }
        self.clipped.push_back(stamp);
    }

    /// Starts anew after a break of the time base, of this triad or of one that it is judged with.
    pub(super) fn forget(&mut self) {
        self.passed += self.recent.len() as u64;
        self.recent.clear();
        self.clipped.clear();
        if let Some(quiet) = &mut self.quiet {
            quiet.window.clear();
        }
    }

    /// Deviation relative to the reference; `None` while either is unknown.
    pub(super) fn statistic(&self) -> Option<f64> {
        let quiet = self.quiet.as_ref().filter(|quiet| quiet.window.is_full())?;
        let variance = quiet.window.variance();
        if variance.sum() == 0.0 {
            // Zero, whatever the reference will be.
            return Some(0.0);
        }
        match self.reference {
            // A level above the ceiling is not accepted, so nothing is quiet relative to it.
            NoiseReference::Learned { ceiling } => {
                quiet.floor.level().map(|level| variance.sum().sqrt() / level.min(ceiling * 3_f64.sqrt()))
            }
            NoiseReference::Fixed { limit } => Some(variance.max().sqrt() / limit),
            NoiseReference::None => None,
        }
    }

    /// Noise floor: √(Σ variance of the axes) at rest.
    pub(super) fn level(&self) -> Option<f64> {
        match self.reference {
            NoiseReference::Fixed { limit } => Some(limit * 3_f64.sqrt()),
            _ => self.quiet.as_ref()?.floor.level(),
        }
    }

    /// Whether the floor can be the noise of a sensor at rest.
    pub(super) fn is_credible(&self) -> bool {
        match self.reference {
            NoiseReference::Learned { ceiling } => self.quiet.as_ref().is_some_and(|quiet| {
                quiet.floor.is_settled() && quiet.floor.level().is_some_and(|level| level <= ceiling * 3_f64.sqrt())
            }),
            NoiseReference::Fixed { .. } | NoiseReference::None => true,
        }
    }

    /// Whether the floor is learned, and may still change.
    pub(super) fn is_learned(&self) -> bool {
        matches!(self.reference, NoiseReference::Learned { .. })
    }

    pub(super) fn window_mean(&self) -> Option<Vector3<f64>> {
        self.quiet.as_ref().map(|quiet| quiet.window.mean())
    }

    pub(super) fn window_size(&self) -> usize {
        self.window_size.unwrap_or(MIN_WINDOW)
    }

    /// Time that a window covers, ns; `None` before the sample period is known.
    pub(super) fn window_span(&self) -> Option<i64> {
        Some(self.clock.period()?.saturating_mul(self.window_size() as i64))
    }

    /// Stamp of the oldest sample in the window.
    pub(super) fn window_start(&self) -> Option<Stamp> {
        let oldest = self.recent.len().saturating_sub(self.window_size());
        self.recent.get(oldest).map(|(stamp, _)| *stamp)
    }

    pub(super) fn last_stamp(&self) -> Option<Stamp> {
        self.recent.back().map(|(stamp, _)| *stamp)
    }

    pub(super) fn step(&self) -> Option<f64> {
        self.quiet.as_ref()?.floor.step()
    }

    /// Properties of its stream; `None` before the first sample.
    pub(super) fn signal(&self) -> Option<Signal> {
        Some(Signal {
            range: self.extremes?,
            step: self.step(),
            noise: self.level().map(|level| level / 3_f64.sqrt()),
            readings: self.readings,
            sensors: self.alternation.sensors(self.readings).unwrap_or(1),
            apart: self.alternation.apart(),
            repeated: self.quiet.as_ref().map_or(0, |quiet| quiet.floor.repeated()),
        })
    }

    pub(super) fn clock(&self) -> &TimeBase {
        &self.clock
    }

    /// Opens a rest at `start`, and a stretch with it.
    pub(super) fn open(&mut self, start: Stamp) {
        let settling = self.clock.period().map_or(0, |period| SETTLING / period.max(1));
        self.cascade.begin(settling.unsigned_abs());
        self.stretch = None;
        self.go_on(start);
    }

    /// Opens a rest at `start`, in the same stretch as the last one.
    pub(super) fn go_on(&mut self, start: Stamp) {
        self.open = Some(Sums::new(start, self.window_size()));
    }

    /// Allan sums of the stretch so far; from `lasting` seconds on it is a long one.
    pub(super) fn stretch(&self, lasting: f64) -> Option<AllanSums> {
        let (first, last) = self.stretch?;
        self.cascade.end(last.seconds_since(first), lasting)
    }

    /// Moves the latest samples up to `until` into the open rest, if there is one; otherwise drops them.
    pub(super) fn commit(&mut self, until: Stamp) {
        while let Some((stamp, value)) = self.recent.front().copied().filter(|(stamp, _)| *stamp <= until) {
            self.recent.pop_front();
            self.passed += 1;
            if let Some(sums) = self.open.as_mut().filter(|sums| stamp >= sums.start()) {
                sums.push_numbered(self.passed, stamp, &value);
                self.cascade.push(&value);
                self.stretch = Some((self.stretch.map_or(stamp, |(first, _)| first), stamp));
            }
        }
        while let Some(stamp) = self.clipped.front().copied().filter(|stamp| *stamp <= until) {
            self.clipped.pop_front();
            if let Some(sums) = self.open.as_mut().filter(|sums| stamp >= sums.start()) {
                sums.clip();
            }
        }
    }

    /// Whether the open rest is more than `enter` times as noisy as the current floor.
    pub(super) fn is_outdated(&self, enter: f64) -> bool {
        let variance = self.open.as_ref().map_or(0.0, Sums::variance);
        self.is_learned() && self.level().is_some_and(|level| variance > (enter * level).powi(2))
    }

    /// Mean of the open rest so far, and its number of samples.
    pub(super) fn open_mean(&self) -> Option<(Vector3<f64>, u64)> {
        self.open.as_ref()?.mean()
    }

    /// First and last stamp in the open rest.
    pub(super) fn open_bounds(&self) -> Option<(Stamp, Stamp)> {
        self.open.as_ref()?.bounds()
    }

    /// Ends the open rest.
    pub(super) fn close(&mut self) -> Option<TriadMean> {
        let sums = self.open.take()?;
        let mean = sums.finish(self.correlation);
        self.alternation.rest(sums.phases(), sums.variance());
        self.correlation = self.correlation.and(sums.correlation());
        mean
    }

    /// Sizes the window when the sample period becomes known or changes.
    fn size_window(&mut self) {
        let Some(period) = self.clock.period().filter(|_| self.clock.period() != self.sized_for) else { return };
        self.sized_for = Some(period);
        let size = match self.reference {
            NoiseReference::Fixed { .. } => THESIS_WINDOW,
            _ => (libm::ceil(self.window_nanos / period.max(1) as f64) as usize).clamp(MIN_WINDOW, MAX_WINDOW),
        };
        if self.window_size.is_some_and(|present| size.abs_diff(present) * 4 <= present) {
            return;
        }
        self.window_size = Some(size);
        self.quiet = self.reference.ceiling().map(|ceiling| Quiet {
            window: Window::new(size),
            floor: NoiseFloor::new(size, ceiling * 3_f64.sqrt()),
            since_floor: 0,
        });
    }
}

impl Quiet {
    fn push(&mut self, value: &Vector3<f64>) {
        self.floor.sample(value);
        self.window.push(value);
        self.since_floor += 1;
        if self.window.is_full() && 2 * self.since_floor >= self.window.size() {
            self.since_floor = 0;
            self.floor.window(self.window.variance().sum().sqrt());
        }
    }
}

impl NoiseReference {
    /// NoiseReference of an accelerometer that votes.
    pub(super) fn accelerometer(config: &Config) -> Self {
        match config.detector {
            Detector::Adaptive => Self::Learned { ceiling: config.accel_ceiling },
            Detector::MovingStd => Self::Fixed { limit: 0.15 },
        }
    }

    /// Noise of one axis above which nothing is rest; `None` if the triad does not vote.
    fn ceiling(self) -> Option<f64> {
        match self {
            Self::Learned { ceiling } => Some(ceiling),
            Self::Fixed { limit } => Some(limit),
            Self::None => None,
        }
    }

    /// NoiseReference of a gyroscope.
    pub(super) fn gyroscope(config: &Config) -> Self {
        match config.detector {
            Detector::Adaptive => Self::Learned { ceiling: config.gyro_ceiling },
            Detector::MovingStd => Self::Fixed { limit: 0.15_f64.to_radians() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_a_nanosecond_apart_and_nobody_to_commit_them_stay_within_bounds() {
        let mut track = TriadTrack::new(&Config::default(), NoiseReference::Learned { ceiling: 0.15 });
        for nanos in 0..100_000 {
            let sample = Sample { stamp: Stamp::from_nanos(nanos), log_time: 0, value: Vector3::zeros() };
            track.tick(sample.stamp);
            track.take(&sample);
        }
        assert_eq!(track.window_size(), MAX_WINDOW);
        assert_eq!(track.recent.len(), MAX_RECENT);
        assert!(track.quiet.unwrap().window.is_full());
    }
}
