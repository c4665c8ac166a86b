//! Segmenter: divides the time of an IMU into rest and motion.
//!
//! The state is evaluated at each accelerometer sample, with the latest gyroscope state; secondary accelerometers do
//! not vote. Samples enter a rest one window after they arrive, so that its end can be trimmed by the window in which
//! motion was detected.

use serde::{Deserialize, Serialize};

use super::config::{Config, Detector};
use super::placement_number::Placement;
use super::rest::Rest;
use super::signal::Signal;
use super::status::{State, Status};
use super::stretch::{Stretch, Stretches};
use super::thermometer::Thermometer;
use super::time_base::Tick;
use super::triad_track::TriadTrack;
use super::triads::Triads;
use super::waiting_rests::WaitingRests;
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
    triads: Triads,
    thermometer: Thermometer,
    phase: Phase,
    state: State,
    placement: Placement,
    /// Whether the last rest ended by creep, with nothing loud since.
    sliding: bool,
    rests: WaitingRests,
    /// Whether a rest of the current stretch was kept.
    kept: bool,
    stretches: Stretches,
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

impl Segmenter {
    /// Creates the segmenter of an IMU with `secondary` secondary accelerometers.
    pub fn new(config: &Config, secondary: usize) -> Self {
        let mut config = config.clone();
        if config.detector == Detector::MovingStd {
            // The thesis' detector has one threshold, and does not wait.
            config = Config { enter: 1.0, leave: 1.0, settle_s: 0.0, min_rest_s: 0.1, ..config };
        }
        Self {
            triads: Triads::new(&config, secondary),
            thermometer: Thermometer::default(),
            phase: Phase::Moving,
            state: State::Unknown,
            placement: Placement::default(),
            sliding: false,
            rests: WaitingRests::default(),
            kept: false,
            stretches: Stretches::default(),
            config,
        }
    }

    /// Takes a sample. Rests that it completes are returned by [`next_rest`](Self::next_rest).
    pub fn push(&mut self, sensor: Sensor, sample: &Sample) -> Outcome {
        let Some(track) = self.triads.of(sensor, &self.config) else { return Outcome::Dropped };
        let tick = track.tick(sample.stamp);
        if tick == Tick::Dropped {
            return Outcome::Dropped;
        }
        let votes = !matches!(sensor, Sensor::Secondary(_));
        if tick == Tick::Break && votes {
            self.break_off();
        }
        if let Some(track) = self.triads.of(sensor, &self.config) {
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
        if let Some(track) = self.triads.of(sensor, &self.config) {
            track.clip(stamp);
        }
    }

    /// Takes the temperature of the sensor, °C, which counts from the last reading of the accelerometer on.
    pub fn warm(&mut self, celsius: f64) {
        if let Some(stamp) = self.triads.accelerometer.last_stamp() {
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
        self.rests.forget(sensor);
    }

    /// Next finished rest, oldest first.
    pub fn next_rest(&mut self) -> Option<Rest> {
        self.rests.next()
    }

    /// Noise of the next stretch of rest, once the floor is credible.
    pub fn next_stretch(&mut self) -> Option<Stretch> {
        self.triads.are_credible().then(|| self.stretches.next())?
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
        self.triads.accelerometer.open_bounds().filter(|_| self.phase == Phase::Still)
    }

    /// Current state, with the statistic and thresholds behind it.
    pub fn status(&self) -> Status {
        Status {
            state: self.state,
            statistic: self.triads.statistic().unwrap_or(f64::NAN),
            enter: self.config.enter,
            leave: self.config.leave,
            accel_floor: self.triads.accelerometer.level(),
            gyro_floor: self.triads.gyroscope.as_ref().and_then(TriadTrack::level),
        }
    }

    /// Samples dropped for a repeated or backward stamp, over all triads.
    pub fn dropped(&self) -> u64 {
        self.triads.iter().map(|track| track.clock().dropped()).sum()
    }

    /// Number of breaks of the time base, over all triads.
    pub fn breaks(&self) -> u64 {
        self.triads.iter().map(|track| track.clock().breaks()).sum()
    }

    /// Time for which the sensor must be held still for a rest that enters the fit, in whole seconds: a window is taken
    /// off its end, and half of one off the beginning of a first rest, with which the noise floor falls.
    pub fn hold_s(&self) -> u32 {
        /// Least time that people are told, s.
        const LEAST: f64 = 2.0;
        /// Share of a second that a hand is late.
        const LATE: f64 = 0.1;
        let Config { window_s, settle_s, min_fit_s, .. } = self.config;
        let window = self.triads.window_span().map_or(window_s, |span| span as f64 * 1e-9);
        let period = self.triads.accelerometer.clock().period().map_or(0.0, |period| period as f64 * 1e-9);
        let needed = 1.5 * window + min_fit_s.max(settle_s) + 2.0 * period + LATE;
        libm::ceil(needed.max(LEAST)) as u32
    }

    /// Smallest step between two readings of one axis of the primary accelerometer, m/s².
    pub fn accel_step(&self) -> Option<f64> {
        self.triads.accelerometer.step()
    }

    /// Properties of the stream of a triad; `None` before its first sample.
    pub fn signal(&self, sensor: Sensor) -> Option<Signal> {
        self.triads.get(sensor)?.signal()
    }

    /// Ends a rest in which the gyroscope moves while the accelerometer is silent, as one is that reads NaN in motion.
    fn judge_unseen(&mut self, now: Stamp) {
        let Triads { accelerometer, gyroscope, .. } = &self.triads;
        let is_loud = |track: &TriadTrack| track.statistic().is_some_and(|statistic| statistic > self.config.leave);
        if self.phase == Phase::Still
            && accelerometer.clock().is_overdue(now)
            && gyroscope.as_ref().is_some_and(is_loud)
        {
            self.end_rest(End::Motion);
            self.phase = Phase::Moving;
        }
    }

    fn judge(&mut self, now: Stamp) -> Outcome {
        let statistic = self.triads.statistic();
        let quiet = statistic.is_some_and(|statistic| statistic < self.config.enter);
        let loud = statistic.is_some_and(|statistic| statistic > self.config.leave);
        if loud && self.phase != Phase::Still {
            self.placement.moved();
            self.sliding = false;
        }
        self.phase = match self.phase {
            Phase::Moving if quiet => {
                let start = self.triads.window_start().unwrap_or(now);
                self.triads.iter_mut().for_each(|track| track.open(start));
                self.thermometer.open(start);
                Phase::Settling(now)
            }
            Phase::Settling(_) if !quiet => {
                self.triads.iter_mut().for_each(|track| {
                    track.close();
                });
                self.thermometer.close();
                Phase::Moving
            }
            Phase::Settling(since) if now.seconds_since(since) >= self.config.settle_s => Phase::Still,
            Phase::Still if loud || self.triads.are_outdated(self.config.enter) => {
                self.end_rest(End::Motion);
                Phase::Moving
            }
            Phase::Still if self.triads.creep(&self.config) => {
                self.end_rest(End::Creep);
                Phase::Moving
            }
            phase => phase,
        };
        self.commit(now);
        if !self.triads.are_credible() {
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
        let Some(span) = self.triads.window_span() else { return };
        // While moving, a start may still be dated back by a window, on every triad's clock.
        let keep = if self.phase == Phase::Moving { span.saturating_mul(2) } else { span };
        let until = now.plus_nanos(keep.saturating_neg());
        self.triads.iter_mut().for_each(|track| track.commit(until));
        self.thermometer.commit(until);
        let bounds = self.triads.accelerometer.open_bounds();
        let full = bounds.is_some_and(|(start, end)| end.seconds_since(start) >= self.config.max_duration_s);
        if self.phase == Phase::Still && full {
            self.end_rest(End::Split);
            let start = until.plus_nanos(1);
            self.triads.iter_mut().for_each(|track| track.go_on(start));
            self.thermometer.open(start);
        }
    }

    fn end_rest(&mut self, end: End) {
        if end == End::Gap {
            // Nothing moved before the accelerometer's readings ended, so nothing is trimmed. What others read after
            // them is of no rest: the sensor may have moved unseen.
            let end = self.triads.accelerometer.last_stamp().unwrap_or(Stamp::from_nanos(i64::MAX));
            self.triads.iter_mut().for_each(|track| track.commit(end));
            self.thermometer.commit(end);
        }
        let span = self.triads.accelerometer.open_bounds();
        let accelerometer = self.triads.accelerometer.close();
        let gyroscope = self.triads.gyroscope.as_mut().and_then(TriadTrack::close);
        let secondary: Vec<_> = self.triads.secondary.iter_mut().map(TriadTrack::close).collect();
        let temperature = self.thermometer.close();
        if let (Some(accelerometer), Some((start, stop))) = (accelerometer, span)
            && stop.seconds_since(start) >= self.config.min_rest_s
        {
            let placement = self.placement.place(&accelerometer, gyroscope.as_ref(), self.config.max_creep);
            let crept = self.sliding;
            self.rests.keep(Rest {
                start,
                end: stop,
                placement,
                crept,
                accelerometer,
                gyroscope,
                secondary,
                temperature,
            });
            self.release();
            self.kept = true;
        }
        if end != End::Split && std::mem::take(&mut self.kept) {
            self.stretches.end(self.placement.number(), &self.triads);
        }
        if matches!(end, End::Motion | End::Creep) {
            self.placement.moved();
        }
        self.sliding = end == End::Creep || self.sliding && end == End::Split;
    }

    /// Whether a rest is still one by the current floor.
    pub fn is_quiet(&self, rest: &Rest) -> bool {
        self.triads.are_quiet(rest, self.config.enter)
    }

    /// Deviations of accelerometer and gyroscope during a rest, relative to their current floors.
    pub fn loudness(&self, rest: &Rest) -> (f64, f64) {
        self.triads.loudness(rest)
    }

    /// Releases the rests that waited for a credible floor, if they are rests by it.
    fn release(&mut self) {
        if self.triads.are_credible() {
            self.rests.release(|rest| self.triads.are_quiet(rest, self.config.enter));
        }
    }

    /// Separates the time before a break of the time base from the time after it.
    fn break_off(&mut self) {
        if self.phase == Phase::Still {
            self.end_rest(End::Gap);
        }
        self.triads.iter_mut().for_each(|track| {
            track.close();
            track.forget();
        });
        self.thermometer.forget();
        self.phase = Phase::Moving;
    }
}
