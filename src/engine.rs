//! Samples in, events out: the rests found and the calibration they determine.
//!
//! One [`Engine`] an IMU. It reads no file and no clock, keeps constant memory, and says the same for the same samples,
//! whoever feeds it.
//!
//! ```
//! use stillpoint::engine::{Config, Engine, Message};
//! use stillpoint::imu::{Sample, Sensor};
//! use stillpoint::Stamp;
//!
//! let mut engine = Engine::new(Config::default());
//! let mut events = Vec::new();
//! for i in 0..1000_i64 {
//!     // A sensor on a table at 100 Hz, +Z up, with a little noise.
//!     let noise = [0.01, -0.02, 0.03, -0.01, 0.02][i as usize % 5];
//!     let stamp = Stamp::from_nanos(i * 10_000_000);
//!     let value = [noise, 0.1 - noise, 9.81 + noise].into();
//!     engine.push(Sensor::Accelerometer, &Sample { stamp, log_time: stamp.nanos() as u64, value }, &mut events);
//! }
//! engine.finish(&mut events);
//!
//! let segment = events.iter().find_map(|event| match &event.message {
//!     Message::Segment(segment) => Some(segment),
//!     _ => None,
//! });
//! assert_eq!(segment.map(|segment| segment.face.as_str()), Some("+Z"));
//! ```

mod attempt;
mod book;
mod drift;
mod judge;
mod observe;
mod outlier;
mod preset;
mod publish;
mod publisher;
mod reference;
mod solve;
mod suspicion;
mod turn;
mod words;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use self::book::Book;
use self::judge::Judge;
use self::publisher::Publisher;
use self::reference::Reference;
use self::solve::{Known, Solution};
use self::suspicion::{Cause, Suspicion};
use self::turn::Turns;
use crate::Stamp;
use crate::fit::{self, Fixture, Place};
use crate::imu::{Preset, Sample, SecondaryModel, Sensor};
use crate::messages;
use crate::messages::foxglove::log::Level;
use crate::still::{self, Outcome, Segmenter, State, Status};

/// Something that was learned, and when it was known.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Log time of the sample that caused it.
    pub log_time: u64,
    /// What was learned.
    pub message: Message,
}

/// What an [`Event`] says.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// The state of rest changed, or a second has passed.
    Stillness(messages::Stillness),
    /// A rest ended, or the verdict on an earlier one changed.
    Segment(messages::Segment),
    /// A turn between two rests ended, or the verdict on an earlier one changed.
    Turn(messages::Turn),
    /// Sums of the noise at rest.
    Noise(messages::Noise),
    /// The faces seen, and the next step.
    Coverage(messages::Coverage),
    /// A refit was published.
    Calibration(Box<messages::Calibration>),
    /// A warning or decision for people.
    Log(messages::foxglove::Log),
}

/// What an engine is to know of its IMU.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// What the IMU is called in log messages, its output name for instance.
    pub name: String,
    /// Frame of the messages.
    pub frame_id: String,
    /// Topic of the accelerometer.
    pub accelerometer: String,
    /// Topic of the gyroscope.
    pub gyroscope: String,
    /// The secondary accelerometers.
    pub secondary: Vec<Secondary>,
    /// Which sensor it is, if that is known; [`Config::of`] sets it with what its datasheet says.
    pub preset: Option<Preset>,
    /// Whether a reference tells what there was to read.
    pub reference: bool,
    /// How rests are found.
    pub still: still::Config,
    /// How a calibration is fitted.
    pub fit: fit::Config,
}

/// A further accelerometer that moves with the IMU.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Secondary {
    /// What it is called in the annotations.
    pub name: String,
    /// Its topic.
    pub topic: String,
    /// Which sensor it is, if that is known.
    pub preset: Option<Preset>,
    /// Which measurement model.
    pub model: SecondaryModel,
}

/// Learns the calibration of one IMU.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Engine {
    config: Config,
    fixture: Fixture,
    reference: Option<Reference>,
    segmenter: Segmenter,
    book: Book,
    publisher: Publisher,
    turns: Turns,
    /// What has been said to be suspicious.
    suspected: BTreeSet<(Sensor, Cause)>,
    last_stillness: Option<Stamp>,
    last: Option<(Stamp, u64)>,
    /// Where the recording says that it is made.
    fix: Option<Place>,
}

/// Nanoseconds between two stillness messages while nothing changes.
const STILLNESS_PERIOD: i64 = 1_000_000_000;

impl Engine {
    /// An engine that has seen nothing.
    pub fn new(config: Config) -> Self {
        Self {
            fixture: Fixture::new(&config.fit.fixture),
            reference: config.reference.then(|| Reference::new(config.still.gap_s)),
            segmenter: Segmenter::new(&config.still, config.secondary.len()),
            book: Book::default(),
            publisher: Publisher::default(),
            turns: Turns::default(),
            suspected: BTreeSet::new(),
            last_stillness: None,
            last: None,
            fix: None,
            config,
        }
    }

    /// Takes a sample; what it taught is appended to `events`.
    pub fn push(&mut self, sensor: Sensor, sample: &Sample, events: &mut Vec<Event>) {
        if let Some(reference) = &mut self.reference {
            reference.push(sensor, sample);
        }
        let outcome = self.segmenter.push(sensor, sample);
        if sensor == Sensor::Gyroscope && outcome != Outcome::Dropped {
            self.turns.push(sample);
        }
        let Outcome::Judged { changed } = outcome else { return };
        if changed && self.segmenter.state() == State::Still {
            self.turns.arrive(sample.stamp);
        }
        self.last = Some((sample.stamp, sample.log_time));
        // A clock that was set back counts as a second passed.
        let due = self.last_stillness.is_none_or(|last| !(0..STILLNESS_PERIOD).contains(&sample.stamp.since(last)));
        if changed || due {
            self.last_stillness = Some(sample.stamp);
            let stillness = self.stillness(sample.stamp);
            events.push(Event { log_time: sample.log_time, message: Message::Stillness(stillness) });
        }
        self.learn(sample.stamp, sample.log_time, false, events);
    }

    /// The driver says that the reading of this stamp was clipped. The rest that it falls into is rejected as saturated;
    /// in motion it means nothing. To be said before or after the reading itself, but not much later.
    pub fn clipped(&mut self, sensor: Sensor, stamp: Stamp) {
        self.segmenter.clip(sensor, stamp);
    }

    /// The driver has changed the calibration that it applies to a triad by itself, from the sample with this stamp on:
    /// to be said before that sample is pushed. An open rest ends, and what the triad read so far no longer counts; of
    /// the primary accelerometer, no earlier rest does.
    pub fn begin_round(&mut self, sensor: Sensor, stamp: Stamp, log_time: u64, events: &mut Vec<Event>) {
        self.segmenter.cut(sensor);
        self.learn(stamp, log_time, false, events);
        self.segmenter.forget(sensor);
        self.book.forget(sensor);
        if let Some(reference) = &mut self.reference {
            reference.forget(sensor);
        }
        let text = words::new_round(&self.config, sensor);
        events.push(self.log(stamp, log_time, Level::Warning, text));
        let solution = self.solve();
        self.publish(&solution, stamp, log_time, false, events);
    }

    /// Learns where the recording is made: what is fitted from now on uses the gravity and the Earth's rotation there,
    /// unless the configuration knows better.
    pub fn locate(&mut self, place: Place) {
        self.fix = Some(place);
    }

    /// The gyroscope turned out to be on this topic.
    pub fn gyroscope_on(&mut self, topic: &str) {
        topic.clone_into(&mut self.config.gyroscope);
    }

    /// Whether the IMU rests, and what that is judged by.
    pub fn status(&self) -> Status {
        self.segmenter.status()
    }

    /// The recording has ended: closes an open rest, publishes what is left to publish, and says what was wrong with the stream.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        let Some((stamp, log_time)) = self.last else { return };
        self.segmenter.finish();
        self.learn(stamp, log_time, true, events);
        for (level, text) in words::closing(&self.segmenter, self.book.found(), &self.config.still) {
            events.push(self.log(stamp, log_time, level, text));
        }
    }

    /// Takes in the rests that have ended.
    fn learn(&mut self, stamp: Stamp, log_time: u64, at_end: bool, events: &mut Vec<Event>) {
        while let Some(rest) = self.segmenter.next_rest() {
            self.turns.rest(&rest);
            self.book.add(rest);
            let solution = self.solve();
            self.publish(&solution, stamp, log_time, false, events);
            self.book.shrink();
        }
        if at_end {
            // The noise floor may have settled since the last rest.
            let solution = self.solve();
            self.publish(&solution, stamp, log_time, true, events);
        }
    }

    /// Judges every remembered rest anew and fits what the good ones determine.
    fn solve(&mut self) -> Solution {
        let Self { config, fixture, segmenter, book, publisher, turns, fix, reference, .. } = self;
        let gravity = solve::gravity(&config.fit, *fix);
        // The stream tells its step; of one that never rests on neighbouring values the datasheet does.
        let promised = config.preset.map(|preset| preset.datasheet().accelerometer.step);
        let step = segmenter.accel_step().or(promised);
        let judge = Judge { still: &config.still, fit: &config.fit, fixture, segmenter, gravity: gravity.value };
        let known = Known { gravity, step, kept: publisher.shape(), reference: reference.as_ref() };
        let mut solution = solve::solve(book.entries_mut(), &judge, config, &known);
        solution.suspicions = suspicion::examine(segmenter, book.entries(), turns, config.preset, &solution);
        suspicion::veto(&mut solution);
        solution
    }

    /// Says what has changed: segments, then coverage, then calibration.
    fn publish(&mut self, solution: &Solution, stamp: Stamp, log_time: u64, at_end: bool, events: &mut Vec<Event>) {
        let header = publish::header(stamp, &self.config.frame_id);
        let event = |message| Event { log_time, message };
        let mut rejected = Vec::new();
        for entry in self.book.entries_mut() {
            if entry.told.as_ref().is_some_and(|told| !entry.verdict.differs_from(told)) {
                continue;
            }
            entry.told = Some(entry.verdict.clone());
            let segment = publish::segment(header.clone(), entry, &self.config, &self.fixture);
            if !segment.accepted {
                rejected.push(words::rejection(&segment));
            }
            events.push(event(Message::Segment(segment)));
        }
        let never_still = words::never_still(&self.segmenter, self.book.found(), &self.config.still);
        let obstacle = never_still.or_else(|| words::obstacle(solution, self.book.entries()));
        let coverage = publish::coverage(header.clone(), &self.book, &self.fixture, solution, obstacle);
        if let Some(coverage) = self.publisher.coverage(coverage) {
            events.push(event(Message::Coverage(coverage)));
        }
        let calibration = publish::calibration(header, &self.book, &self.config, solution);
        let round = self.publisher.round(&self.book, &self.fixture, self.config.fit.refit);
        let news = self.publisher.calibration(calibration, at_end, round);
        if let Some(calibration) = &news {
            events.push(event(Message::Calibration(Box::new(calibration.clone()))));
        }
        for Suspicion { sensor, cause, text } in &solution.suspicions {
            if self.suspected.insert((*sensor, *cause)) {
                let text = format!("{}: {text}", words::sensor(&self.config, *sensor));
                events.push(self.log(stamp, log_time, Level::Warning, text));
            }
        }
        for text in rejected {
            events.push(self.log(stamp, log_time, Level::Warning, text));
        }
        if let Some(calibration) = news {
            events.push(self.log(stamp, log_time, Level::Info, words::published(&calibration)));
        }
    }

    fn stillness(&self, stamp: Stamp) -> messages::Stillness {
        let status = self.segmenter.status();
        let state = match status.state {
            State::Unknown => messages::stillness::State::Unknown,
            State::Moving => messages::stillness::State::Moving,
            State::Still => messages::stillness::State::Still,
        };
        messages::Stillness {
            header: Some(publish::header(stamp, &self.config.frame_id)),
            state: state.into(),
            statistic: status.statistic,
            enter: status.enter,
            leave: status.leave,
        }
    }

    fn log(&self, stamp: Stamp, log_time: u64, level: Level, message: String) -> Event {
        let log = messages::foxglove::Log {
            timestamp: Some(stamp.into()),
            level: level.into(),
            message,
            name: self.config.name.clone(),
            ..Default::default()
        };
        Event { log_time, message: Message::Log(log) }
    }
}
