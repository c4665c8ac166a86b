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
mod givens;
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
mod reference;
mod refit;
mod refusal;
mod replay;
mod rest_history;
mod rest_judge;
mod rotations;
mod solution;
mod solve;
mod status;
mod temperature;
mod turn_outcome;
mod turn_verdict;
mod turning;
mod unit_probe;
mod units;
mod unused_rotations;
mod vertical_scales;
mod warmth;

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use self::axes::Stood;
use self::change_gate::ChangeGate;
use self::clock_drift::ClockDrift;
pub use self::config::{Config, Secondary};
pub use self::event::{Event, Message};
use self::fault::{Fault, FaultKind};
use self::givens::Givens;
use self::headings::{HeadingChanges, Headings};
use self::noise::Noise;
pub use self::noise::{allan_sums, axis_noise};
pub use self::past_turn::{PastTurn, turn_of};
use self::reference::Reference;
pub use self::refit::{Motion, Moved, Refitted, gravity, rest_of};
use self::rest_history::RestHistory;
use self::rest_judge::Judge;
use self::rotations::Rotations;
use self::solution::Solution;
use self::turn_verdict::{TurnsTold, View};
pub use self::unit_probe::UnitProbe;
pub use self::units::{UnitFinding, unconfirmed_unit, unit_of_gravity};
use crate::Stamp;
use crate::fit::turn_fit::TurnSeen;
use crate::fit::{EarthLocation, Fixture};
use crate::imu::{Sample, Sensor};
use crate::messages;
use crate::messages::foxglove::log::Level;
use crate::still::{AllanSums, Outcome, Rest, Segmenter, State, Status};
use crate::turns::{Explanation, History};

/// Engine that learns the calibration of one IMU.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Engine {
    config: Config,
    fixture: Fixture,
    reference: Option<Reference>,
    segmenter: Segmenter,
    history: RestHistory,
    gate: ChangeGate,
    turns: History,
    headings: Headings,
    turns_told: TurnsTold,
    /// Unit probe, until the noise floor is credible.
    probe: Option<Box<UnitProbe>>,
    noise: Noise,
    /// Faults already reported.
    reported: BTreeSet<(Sensor, FaultKind)>,
    last_stillness: Option<Stamp>,
    /// Stamp of the first sample that was judged.
    first: Option<Stamp>,
    clock: ClockDrift,
    last: Option<(Stamp, u64)>,
    /// Number of samples of each triad that are no readings.
    unread: BTreeMap<Sensor, u64>,
    /// Texts on the declared rotations and headings that are of no use, at the end.
    unused_rotations: Vec<String>,
    /// Position from the recording.
    fix: Option<EarthLocation>,
}

/// Longest time between two stillness messages, ns.
const STILLNESS_PERIOD: i64 = 1_000_000_000;

impl Engine {
    /// Creates an engine without samples.
    pub fn new(config: Config) -> Self {
        Self {
            fixture: Fixture::new(&config.fit.fixture),
            reference: config.reference.then(|| Reference::new(config.still.gap_s)),
            segmenter: Segmenter::new(&config.still, config.secondary.len()),
            history: RestHistory::default(),
            gate: ChangeGate::default(),
            turns: History::default(),
            headings: Headings::default(),
            turns_told: TurnsTold::default(),
            probe: Some(Box::new(UnitProbe::new(&config.still))),
            noise: Noise::default(),
            reported: BTreeSet::new(),
            last_stillness: None,
            first: None,
            clock: ClockDrift::default(),
            last: None,
            unread: BTreeMap::new(),
            unused_rotations: Vec::new(),
            fix: None,
            config,
        }
    }

    /// Takes a sample, and appends the events that it causes to `events`. One that is no reading, as NaN, is left out.
    pub fn push(&mut self, sensor: Sensor, sample: &Sample, events: &mut Vec<Event>) {
        if !Sample::is_reading(&sample.value) {
            *self.unread.entry(sensor).or_default() += 1;
            return;
        }
        if let Some(reference) = &mut self.reference {
            reference.push(sensor, sample);
        }
        let outcome = self.segmenter.push(sensor, sample);
        match sensor {
            _ if outcome == Outcome::Dropped => {}
            Sensor::Gyroscope => self.turns.push(sample),
            Sensor::Accelerometer => self.turns.feel(sample),
            Sensor::Secondary(_) | Sensor::Reference(_) => {}
        }
        if let Some(probe) = &mut self.probe {
            probe.push(sensor, sample);
        }
        let Outcome::Judged { changed } = outcome else { return };
        if let Some((since, until)) = self.segmenter.open_rest() {
            self.turns.at_rest(since, until);
        }
        self.first.get_or_insert(sample.stamp);
        self.clock.push(sample.stamp, sample.log_time);
        self.last = Some((sample.stamp, sample.log_time));
        // A clock that was set back counts as due.
        let due = self.last_stillness.is_none_or(|last| !(0..STILLNESS_PERIOD).contains(&sample.stamp.since(last)));
        if changed || due {
            self.last_stillness = Some(sample.stamp);
            let stillness = self.stillness(sample.stamp);
            events.push(Event { log_time: sample.log_time, message: Message::Stillness(stillness) });
        }
        self.learn(sample.stamp, sample.log_time, false, events);
        if self.segmenter.state() != State::Unknown {
            // From here on the rests themselves are judged.
            self.probe = None;
        } else if self.probe.as_mut().is_some_and(|probe| probe.is_due()) && self.is_misread() {
            let solution = self.solve();
            self.publish(&solution, sample.stamp, sample.log_time, false, events);
        }
    }

    /// Marks the reading of a stamp as clipped, as reported by the driver. The rest that contains it is rejected as
    /// saturated; in motion it has no effect. To be called before or soon after the reading itself is pushed.
    pub fn clipped(&mut self, sensor: Sensor, stamp: Stamp) {
        self.segmenter.clip(sensor, stamp);
        if sensor == Sensor::Gyroscope {
            self.turns.clip();
        }
    }

    /// Takes the temperature of the sensor, °C. It counts from the last sample of the accelerometer on, until the next
    /// one is taken: rests have its mean.
    pub fn warm(&mut self, celsius: f64) {
        self.segmenter.warm(celsius);
    }

    /// Takes a heading of the reference, rad, counterclockwise seen from above; whole turns may be counted or not. Those of a
    /// rest count that come before it is found to have ended.
    pub fn heading(&mut self, stamp: Stamp, angle: f64) {
        if self.config.fit.heading.is_some() && angle.is_finite() {
            self.headings.push(stamp, angle);
        }
    }

    /// Begins a new round, when the driver changes the calibration that it applies to a triad, from the sample with
    /// this stamp on. To be called before that sample is pushed. An open rest ends, and the readings of the triad so
    /// far no longer count; for the primary accelerometer, no earlier rest does.
    pub fn begin_round(&mut self, sensor: Sensor, stamp: Stamp, log_time: u64, events: &mut Vec<Event>) {
        self.segmenter.cut(sensor);
        self.learn(stamp, log_time, false, events);
        self.segmenter.forget(sensor);
        self.history.forget(sensor);
        self.turns.forget();
        if self.probe.is_some() {
            self.probe = Some(Box::new(UnitProbe::new(&self.config.still)));
        }
        if let Some(reference) = &mut self.reference {
            reference.forget(sensor);
        }
        let text = guidance::new_round(&self.config, sensor);
        events.push(self.log(stamp, log_time, Level::Warning, text));
        let solution = self.solve();
        self.publish(&solution, stamp, log_time, false, events);
    }

    /// Sets the position of the recording: later fits use its gravity and Earth's rotation, unless the configuration
    /// has a value.
    pub fn locate(&mut self, place: EarthLocation) {
        self.fix = Some(place);
    }

    /// Sets the topic of the gyroscope once it is known.
    pub fn gyroscope_on(&mut self, topic: &str) {
        topic.clone_into(&mut self.config.gyroscope);
    }

    /// Texts on the rotations and headings of the configuration that are of no use, and why, once [finished](Self::finish).
    pub fn unused_rotations(&self) -> &[String] {
        &self.unused_rotations
    }

    /// Current state of rest, with the statistic and thresholds behind it.
    pub fn status(&self) -> Status {
        self.segmenter.status()
    }

    /// Closes an open rest at the end of the recording, publishes what remains, and reports what was wrong with the
    /// stream.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        let Some((stamp, log_time)) = self.last else { return };
        self.segmenter.finish();
        if let Some(probe) = &mut self.probe {
            probe.finish();
        }
        self.learn(stamp, log_time, true, events);
        for (sensor, count) in &self.unread {
            let text = guidance::unread(guidance::sensor(&self.config, *sensor), *count);
            events.push(self.log(stamp, log_time, Level::Warning, text));
        }
        for (level, text) in guidance::closing(&self.segmenter, self.history.found(), &self.config.still) {
            events.push(self.log(stamp, log_time, level, text));
        }
    }

    /// Processes the rests that have ended.
    fn learn(&mut self, stamp: Stamp, log_time: u64, at_end: bool, events: &mut Vec<Event>) {
        let mut solved = None;
        while let Some(rest) = self.segmenter.next_rest() {
            self.turns.rest(&rest);
            if let Some(heading) = &self.config.fit.heading {
                self.headings.rest(&rest, heading.std_deg.to_radians());
            }
            self.history.add(rest);
            let solution = self.solve();
            self.hear_noise();
            self.publish(&solution, stamp, log_time, false, events);
            solved = (!self.history.shrink()).then_some(solution);
        }
        if at_end {
            // The noise floor may have settled since the last rest.
            let solution = solved.unwrap_or_else(|| self.solve());
            self.hear_noise();
            self.publish(&solution, stamp, log_time, true, events);
            let header = publication::header(stamp, &self.config.frame_id);
            let noise = self.noise.message(header, &self.config);
            events.extend(noise.map(|noise| Event { log_time, message: Message::Noise(noise) }));
        }
    }

    /// Adds the noise of the finished stretches in which the IMU was at rest by the verdicts.
    fn hear_noise(&mut self) {
        while let Some(stretch) = self.segmenter.next_stretch() {
            let mut rests = self.history.entries().iter().filter(|entry| entry.rest.placement == stretch.placement);
            if rests.any(|entry| entry.verdict.is_at_rest()) {
                self.noise.add(&stretch);
            }
        }
    }

    /// Judges every stored rest anew and fits what the accepted ones determine.
    fn solve(&mut self) -> Solution {
        self.solve_with(&[])
    }

    /// Solves with turns of other recordings, between the stored rests.
    fn solve_with(&mut self, past_turns: &[TurnSeen]) -> Solution {
        let gyro_range = self.gyro_range();
        let Self { config, fixture, segmenter, history, gate, turns, headings, probe, fix, reference, first, .. } =
            self;
        let clock = &self.clock;
        let gravity = solve::gravity(&config.fit, *fix);
        // The step follows from the stream; if it never rests on neighbouring values, from the datasheet.
        let promised = config.preset.map(|preset| preset.datasheet().accelerometer.step);
        let step = segmenter.accel_step().or(promised);
        let accel_unit = config.accel_unit.unwrap_or_default();
        let judge = Judge {
            still: &config.still,
            fit: &config.fit,
            fixture,
            segmenter,
            gravity: gravity.value,
            accel_unit,
            rate_unit_is_set: config.gyro_unit.is_some(),
        };
        let (kept, reference) = (gate.shape(), reference.as_ref());
        let (first, reference_of_heading) = (first.unwrap_or_default(), config.fit.heading.as_ref());
        let changes = reference_of_heading.map(|heading| HeadingChanges::new(headings, heading));
        let doubt = changes.zip(reference_of_heading).and_then(|(changes, heading)| {
            heading_doubt::doubt(&changes, heading, turns, history.entries(), gyro_range)
        });
        let heading = changes.filter(|_| doubt.is_none());
        let rotations = Rotations { declared: &config.fit.rotations, first, heading };
        let givens = Givens { gravity, step, kept, reference, turns, past_turns, rotations, gyro_range };
        let mut solution = solve::solve(history.entries_mut(), &judge, config, &givens);
        if let Some(warmth) = temperature::learn(history.entries(), &solution, &judge, &givens, config) {
            let solve = |entries: &mut [_]| solve::solve(entries, &judge, config, &givens);
            solution = temperature::at_reference(history.entries_mut(), warmth, solution, solve);
        }
        let unit = config.gyro_unit.unwrap_or_default();
        solution.turned = match probe {
            _ if !past_turns.is_empty() => axes::explanation_of_past(past_turns, history.entries()),
            Some(probe) => probe.explanation(unit),
            None => {
                let stood: Vec<_> = history.entries().iter().filter_map(Stood::of).collect();
                axes::explanation(turns, &stood, unit)
            }
        };
        solution.unit_confirmed = config.gyro_unit.is_some() || solution.turned == Explanation::Agrees;
        let force = probe.as_ref().and_then(|probe| probe.force(accel_unit.factor()));
        let force = force.map(|(gravity, scale)| units::not_metres(gravity, scale));
        solution.faults = fault_detection::detect(segmenter, history.entries(), config, force, &solution);
        solution.faults.extend(replay::detect(history.entries()));
        solution.faults.extend(gyroscope_faults::detect(segmenter, history.entries(), clock, &givens, &solution));
        fault_detection::attribute(&mut solution.faults);
        fault_detection::veto(&mut solution);
        guidance::lay_to_unit(history.entries_mut(), &solution);
        solution.heading_doubt = doubt;
        solution.partial = partial_session::learn(history.entries(), &judge, &givens, config, &solution);
        solution
    }

    /// Range of the gyroscope by the preset, rad/s.
    fn gyro_range(&self) -> Option<f64> {
        self.config.preset.and_then(|preset| Some(preset.datasheet().gyroscope.as_ref()?.range))
    }

    /// Publishes changes: segments, then turns, coverage, calibration.
    fn publish(&mut self, solution: &Solution, stamp: Stamp, log_time: u64, at_end: bool, events: &mut Vec<Event>) {
        let header = publication::header(stamp, &self.config.frame_id);
        let event = |message| Event { log_time, message };
        let mut rejected = Vec::new();
        for entry in self.history.entries_mut() {
            if entry.told.as_ref().is_some_and(|told| !entry.verdict.differs_from(told)) {
                continue;
            }
            entry.told = Some(entry.verdict.clone());
            let segment = publication::segment(header.clone(), entry, &self.config, &self.fixture);
            if !segment.accepted {
                rejected.push(guidance::rejection(&segment));
            }
            events.push(event(Message::Segment(segment)));
        }
        let noise = observations::gyroscope_noise(&self.segmenter);
        let (entries, range) = (self.history.entries(), self.gyro_range());
        let whole_turns = self.config.fit.whole_turns;
        let heading = self.config.fit.heading.as_ref();
        let changes = heading.map(|heading| HeadingChanges::new(&self.headings, heading));
        let rotations = Rotations {
            declared: &self.config.fit.rotations,
            first: self.first.unwrap_or_default(),
            heading: changes.filter(|_| solution.heading_doubt.is_none()),
        };
        let view = View { turns: &self.turns, entries, solution, noise, range, whole_turns, rotations };
        let turns = self.turns_told.news(&header, &view);
        events.extend(turns.into_iter().map(|turn| event(Message::Turn(turn))));
        if at_end {
            self.unused_rotations = view.unused_rotations();
            let unused = heading.and_then(|heading| view.unused_headings(&self.headings, heading));
            self.unused_rotations.extend(unused);
        }
        let never_still = guidance::never_still(&self.segmenter, self.history.found(), &self.config.still);
        let never_still = never_still.map(|never| guidance::misread(&self.config, solution).unwrap_or(never));
        let obstacle =
            never_still.or_else(|| guidance::obstacle(&self.config, solution, self.history.entries(), &self.fixture));
        let coverage =
            publication::coverage(header.clone(), &self.history, (&self.config, &self.fixture), solution, obstacle);
        if let Some(coverage) = self.gate.coverage(coverage) {
            events.push(event(Message::Coverage(coverage)));
        }
        let calibration = publication::calibration(header, &self.history, &self.config, solution);
        let round = self.gate.round(&self.history, &self.fixture, self.config.fit.refit);
        let mut news = self.gate.calibration(calibration, at_end, round);
        if let Some(calibration) = &mut news {
            self.noise.describe(calibration);
        }
        if let Some(calibration) = &news {
            events.push(event(Message::Calibration(Box::new(calibration.clone()))));
        }
        for Fault { sensor, kind, text } in &solution.faults {
            if self.reported.insert((*sensor, *kind)) {
                let text = format!("{}: {text}", guidance::sensor(&self.config, *sensor));
                events.push(self.log(stamp, log_time, Level::Warning, text));
            }
        }
        rejected.extend(self.unused_rotations.iter().cloned());
        for text in rejected {
            events.push(self.log(stamp, log_time, Level::Warning, text));
        }
        if let Some(calibration) = news {
            events.push(self.log(stamp, log_time, Level::Info, guidance::published(&calibration)));
        }
    }

    /// Whether readings too loud for a rest turned out to be in another unit.
    fn is_misread(&self) -> bool {
        let unit = self.config.gyro_unit.unwrap_or_default();
        let factor = self.config.accel_unit.unwrap_or_default().factor();
        self.probe.as_ref().is_some_and(|probe| {
            probe.force(factor).is_some() || matches!(probe.explanation(unit), Explanation::Otherwise { .. })
        })
    }

    fn stillness(&self, stamp: Stamp) -> messages::Stillness {
        let status = self.segmenter.status();
        let state = match status.state {
            State::Unknown => messages::stillness::State::Unknown,
            State::Moving => messages::stillness::State::Moving,
            State::Still => messages::stillness::State::Still,
        };
        messages::Stillness {
            header: Some(publication::header(stamp, &self.config.frame_id)),
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

/// Judges and fits rests as if one engine had found them all, and the turns between them, whose rests are given by
/// their indices. Placements are distinguished by their numbers.
pub fn refit(
    rests: impl IntoIterator<Item = Rest>,
    turns: &[TurnSeen],
    noise: BTreeMap<Sensor, AllanSums>,
    motion: &Motion,
    config: Config,
) -> Refitted {
    let mut engine = Engine::new(config);
    engine.noise = Noise::of(noise);
    rests.into_iter().for_each(|rest| engine.history.add(rest));
    let mut solution = engine.solve_with(turns);
    let moved = motion.replace(&mut solution);
    if let Some(warmth) = &mut solution.warmth {
        // A bias that is that of a time is not that of a temperature.
        warmth.give_up(moved.map(|moved| moved.is_some()));
    }
    let Engine { config, fixture, history, .. } = &engine;
    let stamp = history.entries().iter().map(|entry| entry.rest.end).max().unwrap_or_default();
    let header = publication::header(stamp, &config.frame_id);
    let segment = |entry| publication::segment(header.clone(), entry, config, fixture);
    let segments = history.entries().iter().map(segment).collect();
    let obstacle = guidance::obstacle(config, &solution, history.entries(), fixture);
    let coverage = publication::coverage(header.clone(), history, (config, fixture), &solution, obstacle);
    let mut calibration = publication::calibration(header, history, config, &solution);
    for (moved, triad) in moved.into_iter().zip([&mut calibration.accelerometer, &mut calibration.gyroscope]) {
        if let (Some(moved), Some(triad)) = (moved, triad) {
            triad.notes.push(moved.note.clone());
        }
    }
    let round = engine.gate.round(&engine.history, &engine.fixture, engine.config.fit.refit);
    let mut calibration = engine.gate.calibration(calibration, true, round);
    if let Some(calibration) = &mut calibration {
        engine.noise.describe(calibration);
    }
    Refitted { segments, coverage, calibration }
}
