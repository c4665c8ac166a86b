//! Segmenter: divides the time of an IMU into rest and motion.
//!
//! The state is evaluated at each accelerometer sample, with the latest gyroscope state; secondary accelerometers do
//! not vote. Samples enter a rest one window after they arrive, so that its end can be trimmed by the window in which
//! motion was detected.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::allan_variance::AllanSums;
use super::config::{Config, Detector};
use super::placement_number::{Placement, creep_limit};
use super::rest::{Rest, TriadMean};
use super::signal::Signal;
use super::status::{State, Status};
use super::thermometer::Thermometer;
use super::time_base::Tick;
use super::triad_track::{TriadTrack, Yardstick};
use crate::Stamp;
use crate::imu::{Sample, Sensor};

/// Effect of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Dropped for a repeated or backward stamp.
    Dropped,
    /// Taken, without an evaluation of the state.
    Taken,
    /// Taken, with an evaluation of the state.
    Judged {
        /// Whether the state changed.
        changed: bool,
    },
}

/// Segmenter of an IMU: takes samples, returns rests.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Segmenter {
    config: Config,
    accelerometer: TriadTrack,
    gyroscope: Option<TriadTrack>,
    secondary: Vec<TriadTrack>,
    thermometer: Thermometer,
    phase: Phase,
    state: State,
    placement: Placement,
    /// Whether the last rest ended by creep, with nothing loud since.
    sliding: bool,
    /// Rests that wait for a credible noise floor, oldest first.
    held: VecDeque<Rest>,
    ready: VecDeque<Rest>,
    /// Whether a rest of the current stretch was kept.
    kept: bool,
    stretches: VecDeque<Stretch>,
}

/// Noise of an IMU in one stretch of rest, however many rests it was split into.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Stretch {
    /// Placement of its last rest.
    pub placement: u32,
    /// Allan sums of each triad with readings.
    pub noise: Vec<(Sensor, AllanSums)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Phase {
    Moving,
    /// Quiet since this stamp.
    Settling(Stamp),
    Still,
}

/// Reason for the end of a rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Motion,
    /// The mean has wandered away.
    Creep,
    Gap,
    Split,
}

/// Largest number of rests that wait for a credible floor.
const MAX_HELD: usize = 256;
/// Largest number of stretches that wait for a credible floor.
const MAX_STRETCHES: usize = 8;
/// Shortest stretch that may show a random walk of a bias, s …
const LASTING: f64 = 45.0;
/// … and that of an accelerometer, which is put down by hand and goes on tilting for a while.
const LASTING_ON_A_TABLE: f64 = 120.0;
/// Longest silence of a gyroscope that still votes, ns.
const GYRO_SILENCE: i64 = 1_000_000_000;

impl Segmenter {
    /// Creates the segmenter of an IMU with `secondary` secondary accelerometers.
    pub fn new(config: &Config, secondary: usize) -> Self {
        let mut config = config.clone();
        if config.detector == Detector::MovingStd {
            // The thesis' detector has one threshold, and does not wait.
            config = Config { enter: 1.0, leave: 1.0, settle_s: 0.0, min_rest_s: 0.1, ..config };
        }
        Self {
            accelerometer: TriadTrack::new(&config, Yardstick::accelerometer(&config)),
            gyroscope: None,
            secondary: vec![TriadTrack::new(&config, Yardstick::None); secondary],
            thermometer: Thermometer::default(),
            phase: Phase::Moving,
            state: State::Unknown,
            placement: Placement::default(),
            sliding: false,
            held: VecDeque::new(),
            ready: VecDeque::new(),
            kept: false,
            stretches: VecDeque::new(),
            config,
        }
    }

    /// Takes a sample. Rests that it completes are returned by [`next_rest`](Self::next_rest).
    pub fn push(&mut self, sensor: Sensor, sample: &Sample) -> Outcome {
        let Some(track) = self.track(sensor) else { return Outcome::Dropped };
        let tick = track.tick(sample.stamp);
        if tick == Tick::Dropped {
            return Outcome::Dropped;
        }
        let votes = !matches!(sensor, Sensor::Secondary(_));
        if tick == Tick::Break && votes {
            self.break_off();
        }
        if let Some(track) = self.track(sensor) {
            track.take(sample);
        }
        if self.phase != Phase::Still {
            match sensor {
                Sensor::Accelerometer => self.placement.feel(sample),
                Sensor::Gyroscope => self.placement.turn(sample),
                _ => {}
            }
        }
        match sensor {
            Sensor::Accelerometer => return self.judge(sample.stamp),
            Sensor::Gyroscope => self.judge_unseen(sample.stamp),
            _ => {}
        }
        Outcome::Taken
    }

    /// Marks the reading of a stamp as clipped, as reported by the driver; it counts in the rest that contains it.
    pub fn clip(&mut self, sensor: Sensor, stamp: Stamp) {
        if let Some(track) = self.track(sensor) {
            track.clip(stamp);
        }
    }

    /// Takes the temperature of the sensor, °C, which counts from the last reading of the accelerometer on.
    pub fn warm(&mut self, celsius: f64) {
        if let Some(stamp) = self.accelerometer.last_stamp() {
            self.thermometer.take(stamp, celsius);
        }
    }

    /// Separates the later readings of a triad from the earlier ones: ends an open rest.
    pub fn cut(&mut self, sensor: Sensor) {
        self.break_off();
        if sensor == Sensor::Accelerometer {
            self.placement.forget();
        }
    }

    /// Removes the readings of a triad from the rests that wait for a credible floor.
    pub fn forget(&mut self, sensor: Sensor) {
        self.held = self.held.drain(..).filter_map(|rest| rest.without(sensor)).collect();
    }

    /// Next finished rest, oldest first.
    pub fn next_rest(&mut self) -> Option<Rest> {
        self.ready.pop_front()
    }

    /// Noise of the next stretch of rest, once the floor is credible.
    pub fn next_stretch(&mut self) -> Option<Stretch> {
        self.is_credible().then(|| self.stretches.pop_front())?
    }

    /// Closes an open rest at the end of the recording.
    pub fn finish(&mut self) {
        if self.phase == Phase::Still {
            self.end_rest(End::Gap);
        }
    }

    /// Current state of rest.
    pub fn state(&self) -> State {
        self.state
    }

    /// First and last stamp of the open rest, as far as they are final.
    pub fn open_rest(&self) -> Option<(Stamp, Stamp)> {
        self.accelerometer.open_bounds().filter(|_| self.phase == Phase::Still)
    }

    /// Current state, with the statistic and thresholds behind it.
    pub fn status(&self) -> Status {
        Status {
            state: self.state,
            statistic: self.statistic().unwrap_or(f64::NAN),
            enter: self.config.enter,
            leave: self.config.leave,
            accel_floor: self.accelerometer.level(),
            gyro_floor: self.gyroscope.as_ref().and_then(TriadTrack::level),
        }
    }

    /// Samples dropped for a repeated or backward stamp, over all triads.
    pub fn dropped(&self) -> u64 {
        self.tracks().map(|track| track.clock().dropped()).sum()
    }

    /// Number of breaks of the time base, over all triads.
    pub fn breaks(&self) -> u64 {
        self.tracks().map(|track| track.clock().breaks()).sum()
    }

    /// Time for which the sensor must be held still for a rest that enters the fit, in whole seconds: a window is taken
    /// off its end, and half of one off the beginning of a first rest, with which the noise floor falls.
    pub fn hold_s(&self) -> u32 {
        /// Least time that people are told, s.
        const LEAST: f64 = 2.0;
        /// Share of a second that a hand is late.
        const LATE: f64 = 0.1;
        let Config { window_s, settle_s, min_fit_s, .. } = self.config;
        let window = self.window_span().map_or(window_s, |span| span as f64 * 1e-9);
        let period = self.accelerometer.clock().period().map_or(0.0, |period| period as f64 * 1e-9);
        let needed = 1.5 * window + min_fit_s.max(settle_s) + 2.0 * period + LATE;
        libm::ceil(needed.max(LEAST)) as u32
    }

    /// Smallest step between two readings of one axis of the primary accelerometer, m/s².
    pub fn accel_step(&self) -> Option<f64> {
        self.accelerometer.step()
    }

    /// Properties of the stream of a triad; `None` before its first sample.
    pub fn signal(&self, sensor: Sensor) -> Option<Signal> {
        match sensor {
            Sensor::Accelerometer => self.accelerometer.signal(),
            Sensor::Gyroscope => self.gyroscope.as_ref()?.signal(),
            Sensor::Secondary(i) => self.secondary.get(i)?.signal(),
            Sensor::Reference(_) => None,
        }
    }

    fn track(&mut self, sensor: Sensor) -> Option<&mut TriadTrack> {
        let config = &self.config;
        match sensor {
            Sensor::Accelerometer => Some(&mut self.accelerometer),
            Sensor::Gyroscope => {
                Some(self.gyroscope.get_or_insert_with(|| TriadTrack::new(config, Yardstick::gyroscope(config))))
            }
            Sensor::Secondary(i) => self.secondary.get_mut(i),
            Sensor::Reference(_) => None,
        }
    }

    /// Ends a rest in which the gyroscope moves while the accelerometer is silent, as one is that reads NaN in motion.
    fn judge_unseen(&mut self, now: Stamp) {
        let leave = self.config.leave;
        let is_loud = |track: &TriadTrack| track.statistic().is_some_and(|statistic| statistic > leave);
        if self.phase == Phase::Still
            && self.accelerometer.clock().is_overdue(now)
            && self.gyroscope.as_ref().is_some_and(is_loud)
        {
            self.end_rest(End::Motion);
            self.phase = Phase::Moving;
        }
    }

    fn judge(&mut self, now: Stamp) -> Outcome {
        let statistic = self.statistic();
        let quiet = statistic.is_some_and(|statistic| statistic < self.config.enter);
        let loud = statistic.is_some_and(|statistic| statistic > self.config.leave);
        if loud && self.phase != Phase::Still {
            self.placement.moved();
            self.sliding = false;
        }
        self.phase = match self.phase {
            Phase::Moving if quiet => {
                let start = self.window_start().unwrap_or(now);
                self.tracks_mut().for_each(|track| track.open(start));
                self.thermometer.open(start);
                Phase::Settling(now)
            }
            Phase::Settling(_) if !quiet => {
                self.tracks_mut().for_each(|track| {
                    track.close();
                });
                self.thermometer.close();
                Phase::Moving
            }
            Phase::Settling(since) if now.seconds_since(since) >= self.config.settle_s => Phase::Still,
            Phase::Still if loud || self.is_outdated() => {
                self.end_rest(End::Motion);
                Phase::Moving
            }
            Phase::Still if self.creeps() => {
                self.end_rest(End::Creep);
                Phase::Moving
            }
            phase => phase,
        };
        self.commit(now);
        if !self.is_credible() {
            return self.judged(State::Unknown);
        }
        self.release();
        self.judged(if self.phase == Phase::Still { State::Still } else { State::Moving })
    }

    fn judged(&mut self, state: State) -> Outcome {
        let changed = state != self.state;
        self.state = state;
        Outcome::Judged { changed }
    }

    /// Commits samples that are one window old, and so safe from trimming: they enter the open rest, or are dropped.
    fn commit(&mut self, now: Stamp) {
        let Some(span) = self.window_span() else { return };
        // While moving, a start may still be dated back by a window, on every triad's clock.
        let keep = if self.phase == Phase::Moving { span.saturating_mul(2) } else { span };
        let until = now.plus_nanos(keep.saturating_neg());
        self.tracks_mut().for_each(|track| track.commit(until));
        self.thermometer.commit(until);
        let bounds = self.accelerometer.open_bounds();
        let full = bounds.is_some_and(|(start, end)| end.seconds_since(start) >= self.config.max_duration_s);
        if self.phase == Phase::Still && full {
            self.end_rest(End::Split);
            let start = until.plus_nanos(1);
            self.tracks_mut().for_each(|track| track.go_on(start));
            self.thermometer.open(start);
        }
    }

    fn end_rest(&mut self, end: End) {
        if end == End::Gap {
            // Nothing moved before the accelerometer's readings ended, so nothing is trimmed. What others read after
            // them is of no rest: the sensor may have moved unseen.
            let end = self.accelerometer.last_stamp().unwrap_or(Stamp::from_nanos(i64::MAX));
            self.tracks_mut().for_each(|track| track.commit(end));
            self.thermometer.commit(end);
        }
        let span = self.accelerometer.open_bounds();
        let accelerometer = self.accelerometer.close();
        let gyroscope = self.gyroscope.as_mut().and_then(TriadTrack::close);
        let secondary: Vec<_> = self.secondary.iter_mut().map(TriadTrack::close).collect();
        let temperature = self.thermometer.close();
        if let (Some(accelerometer), Some((start, stop))) = (accelerometer, span)
            && stop.seconds_since(start) >= self.config.min_rest_s
        {
            let placement = self.placement.place(&accelerometer, gyroscope.as_ref(), self.config.max_creep);
            let crept = self.sliding;
            self.keep(Rest { start, end: stop, placement, crept, accelerometer, gyroscope, secondary, temperature });
            self.kept = true;
        }
        if end != End::Split && std::mem::take(&mut self.kept) {
            self.end_stretch();
        }
        if matches!(end, End::Motion | End::Creep) {
            self.placement.moved();
        }
        self.sliding = end == End::Creep || self.sliding && end == End::Split;
    }

    /// Stores the noise of the rests since the last motion.
    fn end_stretch(&mut self) {
        let primary = self.accelerometer.stretch(LASTING_ON_A_TABLE).map(|sums| (Sensor::Accelerometer, sums));
        let gyroscope = self.gyroscope.as_ref().and_then(|track| track.stretch(LASTING));
        let secondary = self
            .secondary
            .iter()
            .enumerate()
            .filter_map(|(index, track)| Some((Sensor::Secondary(index), track.stretch(LASTING_ON_A_TABLE)?)));
        let noise =
            primary.into_iter().chain(gyroscope.map(|sums| (Sensor::Gyroscope, sums))).chain(secondary).collect();
        if self.stretches.len() == MAX_STRETCHES {
            self.stretches.pop_front();
        }
        self.stretches.push_back(Stretch { placement: self.placement.number(), noise });
    }

    fn keep(&mut self, rest: Rest) {
        if self.held.len() == MAX_HELD {
            self.held.pop_front();
        }
        self.held.push_back(rest);
        if self.is_credible() {
            self.release();
        }
    }

    /// Releases the rests that waited for a credible floor, if they are rests by it.
    fn release(&mut self) {
        while let Some(rest) = self.held.pop_front() {
            if self.is_quiet(&rest) {
                self.ready.push_back(rest);
            }
        }
    }

    /// Whether a rest is still one by the current floor.
    pub fn is_quiet(&self, rest: &Rest) -> bool {
        let (accelerometer, gyroscope) = self.loudness(rest);
        accelerometer <= self.config.enter && gyroscope <= self.config.enter
    }

    /// Deviations of accelerometer and gyroscope during a rest, relative to their current floors.
    pub fn loudness(&self, rest: &Rest) -> (f64, f64) {
        let over = |mean: &TriadMean, track: Option<&TriadTrack>| {
            let floor = track.filter(|track| track.is_learned()).and_then(TriadTrack::level);
            floor.map_or(0.0, |floor| mean.deviation() / floor)
        };
        let gyroscope = rest.gyroscope.as_ref().map_or(0.0, |mean| over(mean, self.gyroscope.as_ref()));
        (over(&rest.accelerometer, Some(&self.accelerometer)), gyroscope)
    }

    /// Separates the time before a break of the time base from the time after it.
    fn break_off(&mut self) {
        if self.phase == Phase::Still {
            self.end_rest(End::Gap);
        }
        self.tracks_mut().for_each(|track| {
            track.close();
            track.forget();
        });
        self.thermometer.forget();
        self.phase = Phase::Moving;
    }

    /// Whether the accelerometer's mean has moved away from that of the rest: a slow slide has little variance.
    fn creeps(&self) -> bool {
        let (Some(now), Some((mean, count))) = (self.accelerometer.window_mean(), self.accelerometer.open_mean())
        else {
            return false;
        };
        let (window, count) = (self.accelerometer.window_size() as f64, count as f64);
        let off = (now - mean).norm();
        // A mean of few samples says little: right after a split there is only one.
        if count < window || off <= self.config.max_creep || self.config.detector != Detector::Adaptive {
            return false;
        }
        let noise = self.accelerometer.level().unwrap_or(0.0) * (1.0 / window + 1.0 / count).sqrt();
        off > creep_limit(self.config.max_creep, noise)
    }

    /// Whether the floor has fallen since the rest began, so that its beginning was motion.
    fn is_outdated(&self) -> bool {
        let outdated = |track: &TriadTrack| track.is_outdated(self.config.enter);
        outdated(&self.accelerometer) || self.gyroscope.as_ref().is_some_and(outdated)
    }

    fn statistic(&self) -> Option<f64> {
        let accelerometer = self.accelerometer.statistic()?;
        match self.voting_gyroscope() {
            None => Some(accelerometer),
            Some(gyroscope) => gyroscope.statistic().map(|gyroscope| gyroscope.max(accelerometer)),
        }
    }

    /// Longest time covered by a voting triad's window, ns: motion that far back shows in it.
    fn window_span(&self) -> Option<i64> {
        let gyroscope = self.voting_gyroscope().and_then(TriadTrack::window_span);
        self.accelerometer.window_span().map(|span| span.max(gyroscope.unwrap_or(0)))
    }

    /// Stamp since which every voting triad's window is quiet.
    fn window_start(&self) -> Option<Stamp> {
        let gyroscope = self.voting_gyroscope().and_then(TriadTrack::window_start);
        self.accelerometer.window_start().max(gyroscope)
    }

    fn is_credible(&self) -> bool {
        self.accelerometer.is_credible() && self.voting_gyroscope().is_none_or(TriadTrack::is_credible)
    }

    fn voting_gyroscope(&self) -> Option<&TriadTrack> {
        let now = self.accelerometer.last_stamp()?;
        self.gyroscope
            .as_ref()
            .filter(|gyroscope| gyroscope.last_stamp().is_some_and(|last| now.since(last) < GYRO_SILENCE))
    }

    fn tracks(&self) -> impl Iterator<Item = &TriadTrack> {
        std::iter::once(&self.accelerometer).chain(&self.gyroscope).chain(&self.secondary)
    }

    fn tracks_mut(&mut self) -> impl Iterator<Item = &mut TriadTrack> {
        std::iter::once(&mut self.accelerometer).chain(&mut self.gyroscope).chain(&mut self.secondary)
    }
}
