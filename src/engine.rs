//! Engine of one IMU: takes samples, returns events on the rests found and the calibration they determine.
//!
//! An [`Engine`] reads no file and no clock, keeps constant memory, and returns the same events for the same samples,
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

mod advice;
mod axes;
mod change_gate;
mod clock_drift;
mod config;
mod declaration;
mod drift;
mod event;
mod fault;
mod fault_detection;
mod fit_inputs;
mod guidance;
mod gyroscope_faults;
mod heading_doubt;
mod headings;
mod model_trial;
mod next_step;
mod noise;
mod observations;
mod outliers;
mod partial;
mod partial_session;
mod past_turn;
mod preset;
mod publication;
mod publisher;
mod reference;
mod refit;
mod refusal;
mod replay;
mod rest_history;
mod rest_judge;
mod rotations;
mod session;
mod solution;
mod solve;
mod status;
mod temperature;
mod temperature_courses;
mod turn_outcome;
mod turn_trial;
mod turn_verdict;
mod unit_probe;
mod units;
mod unused_rotations;
mod vertical_scales;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use self::config::{Config, Secondary};
pub use self::event::{Event, Message};
pub use self::noise::{allan_sums, axis_noise};
pub use self::past_turn::{PastTurn, turn_of};
use self::publisher::Publisher;
pub use self::refit::{Motion, Moved, Refitted, gravity, refit, rest_of};
use self::session::Session;
pub use self::unit_probe::UnitProbe;
pub use self::units::{UnitFinding, unconfirmed_unit, unit_of_gravity};
use crate::Stamp;
use crate::fit::EarthLocation;
use crate::imu::{Sample, Sensor};
use crate::messages::foxglove::log::Level;
use crate::still::{Outcome, Status};

/// Engine that learns the calibration of one IMU.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Engine {
    session: Session,
    publisher: Publisher,
    last_stillness: Option<Stamp>,
    /// Stamp and log time of the last sample that was judged.
    last: Option<(Stamp, u64)>,
    /// Number of samples of each triad that are no readings.
    unread: BTreeMap<Sensor, u64>,
}

/// Longest time between two stillness messages, ns.
const STILLNESS_PERIOD: i64 = 1_000_000_000;

impl Engine {
    /// Creates an engine without samples.
    pub fn new(config: Config) -> Self {
        Self {
            session: Session::new(config),
            publisher: Publisher::default(),
            last_stillness: None,
            last: None,
            unread: BTreeMap::new(),
        }
    }

    /// Takes a sample, and appends the events that it causes to `events`. One that is no reading, as NaN, is left out.
    pub fn push(&mut self, sensor: Sensor, sample: &Sample, events: &mut Vec<Event>) {
        if !Sample::is_reading(&sample.value) {
            *self.unread.entry(sensor).or_default() += 1;
            return;
        }
        let Outcome::Judged { changed } = self.session.push(sensor, sample) else { return };
        self.last = Some((sample.stamp, sample.log_time));
        // A clock that was set back counts as due.
        let due = self.last_stillness.is_none_or(|last| !(0..STILLNESS_PERIOD).contains(&sample.stamp.since(last)));
        if changed || due {
            self.last_stillness = Some(sample.stamp);
            let stillness = publisher::stillness(&self.session, sample.stamp);
            events.push(Event { log_time: sample.log_time, message: Message::Stillness(stillness) });
        }
        self.learn(sample.stamp, sample.log_time, false, events);
        if self.session.finds_another_unit() {
            self.publish(sample.stamp, sample.log_time, events);
        }
    }

    /// Marks the reading of a stamp as clipped, as reported by the driver. The rest that contains it is rejected as
    /// saturated; in motion it has no effect. To be called before or soon after the reading itself is pushed.
    pub fn clipped(&mut self, sensor: Sensor, stamp: Stamp) {
        self.session.clip(sensor, stamp);
    }

    /// Takes the temperature of the sensor, °C. It counts from the last sample of the accelerometer on, until the next
    /// one is taken: rests have its mean.
    pub fn warm(&mut self, celsius: f64) {
        self.session.segmenter.warm(celsius);
    }

    /// Takes a heading of the reference, rad, counterclockwise seen from above; whole turns may be counted or not. Those of a
    /// rest count that come before it is found to have ended.
    pub fn heading(&mut self, stamp: Stamp, angle: f64) {
        if self.session.config.fit.heading.is_some() && angle.is_finite() {
            self.session.headings.push(stamp, angle);
        }
    }

    /// Begins a new round, when the driver changes the calibration that it applies to a triad, from the sample with
    /// this stamp on. To be called before that sample is pushed. An open rest ends, and the readings of the triad so
    /// far no longer count; for the primary accelerometer, no earlier rest does.
    pub fn begin_round(&mut self, sensor: Sensor, stamp: Stamp, log_time: u64, events: &mut Vec<Event>) {
        self.session.segmenter.cut(sensor);
        self.learn(stamp, log_time, false, events);
        self.session.forget(sensor);
        let text = guidance::new_round(&self.session.config, sensor);
        events.push(Event::log(&self.session.config.name, (stamp, log_time), Level::Warning, text));
        self.publish(stamp, log_time, events);
    }

    /// Sets the position of the recording: later fits use its gravity and Earth's rotation, unless the configuration
    /// has a value.
    pub fn locate(&mut self, place: EarthLocation) {
        self.session.place = Some(place);
    }

    /// Sets the topic of the gyroscope once it is known.
    pub fn gyroscope_on(&mut self, topic: &str) {
        topic.clone_into(&mut self.session.config.gyroscope);
    }

    /// Texts on the rotations and headings of the configuration that are of no use, and why, once [finished](Self::finish).
    pub fn unused_rotations(&self) -> &[String] {
        self.publisher.unused_rotations()
    }

    /// Current state of rest, with the statistic and thresholds behind it.
    pub fn status(&self) -> Status {
        self.session.segmenter.status()
    }

    /// Closes an open rest at the end of the recording, publishes what remains, and reports what was wrong with the
    /// stream.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        let Some((stamp, log_time)) = self.last else { return };
        self.session.finish();
        self.learn(stamp, log_time, true, events);
        let Session { config, segmenter, history, .. } = &self.session;
        let unread = self
            .unread
            .iter()
            .map(|(sensor, count)| (Level::Warning, guidance::unread(guidance::sensor(config, *sensor), *count)));
        for (level, text) in unread.chain(guidance::closing(segmenter, history.found(), &config.still)) {
            events.push(Event::log(&config.name, (stamp, log_time), level, text));
        }
    }

    /// Processes the rests that have ended.
    fn learn(&mut self, stamp: Stamp, log_time: u64, at_end: bool, events: &mut Vec<Event>) {
        let at = (stamp, log_time);
        let mut solved = None;
        while self.session.take_rest() {
            let solution = self.session.solve(self.publisher.model(), &[]);
            self.session.hear_noise();
            self.publisher.publish(&mut self.session, &solution, at, false, events);
            solved = (!self.session.history.shrink()).then_some(solution);
        }
        if at_end {
            // The noise floor may have settled since the last rest.
            let solution = solved.unwrap_or_else(|| self.session.solve(self.publisher.model(), &[]));
            self.session.hear_noise();
            self.publisher.publish(&mut self.session, &solution, at, true, events);
            let Session { config, noise, .. } = &self.session;
            let noise = noise.message(publication::header(stamp, &config.frame_id), config);
            events.extend(noise.map(|noise| Event { log_time, message: Message::Noise(noise) }));
        }
    }

    /// Solves, and publishes changes.
    fn publish(&mut self, stamp: Stamp, log_time: u64, events: &mut Vec<Event>) {
        let solution = self.session.solve(self.publisher.model(), &[]);
        self.publisher.publish(&mut self.session, &solution, (stamp, log_time), false, events);
    }
}
