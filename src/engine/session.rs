//! Session of one IMU: what its samples have shown so far, and what that determines.

use serde::{Deserialize, Serialize};

use super::axes::{self, Stood};
use super::clock_drift::ClockDrift;
use super::config::Config;
use super::fit_inputs::FitInputs;
use super::headings::{HeadingChanges, Headings};
use super::noise::Noise;
use super::reference::Reference;
use super::rest_history::RestHistory;
use super::rest_judge::Judge;
use super::rotations::Rotations;
use super::solution::Solution;
use super::unit_probe::UnitProbe;
use super::{
    fault_detection, guidance, gyroscope_faults, heading_doubt, partial_session, replay, solve, temperature, units,
};
use crate::Stamp;
use crate::fit::turn_fit::TurnSeen;
use crate::fit::{EarthLocation, Fixture, Parameterisation};
use crate::imu::{Sample, Sensor};
use crate::still::{Outcome, Segmenter, State};
use crate::turns::{Explanation, History};

/// Everything that a solution is made of.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Session {
    pub(super) config: Config,
    pub(super) fixture: Fixture,
    pub(super) reference: Option<Reference>,
    pub(super) segmenter: Segmenter,
    pub(super) history: RestHistory,
    pub(super) turns: History,
    pub(super) headings: Headings,
    /// Unit probe, until the noise floor is credible.
    pub(super) probe: Option<Box<UnitProbe>>,
    pub(super) noise: Noise,
    /// Stamp of the first sample that was judged.
    pub(super) first: Option<Stamp>,
    pub(super) clock: ClockDrift,
    /// Position from the recording.
    pub(super) place: Option<EarthLocation>,
}

impl Session {
    /// Session without samples.
    pub(super) fn new(config: Config) -> Self {
        Self {
            fixture: Fixture::new(&config.fit.fixture),
            reference: config.reference.then(|| Reference::new(config.still.gap_s)),
            segmenter: Segmenter::new(&config.still, config.secondary.len()),
            history: RestHistory::default(),
            turns: History::default(),
            headings: Headings::default(),
            probe: Some(Box::new(UnitProbe::new(&config.still))),
            noise: Noise::default(),
            first: None,
            clock: ClockDrift::default(),
            place: None,
            config,
        }
    }

    /// Takes a reading.
    pub(super) fn push(&mut self, sensor: Sensor, sample: &Sample) -> Outcome {
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
        if let Outcome::Judged { .. } = outcome {
            if let Some((since, until)) = self.segmenter.open_rest() {
                self.turns.at_rest(since, until);
            }
            self.first.get_or_insert(sample.stamp);
            self.clock.push(sample.stamp, sample.log_time);
        }
        outcome
    }

    /// Marks the reading of a stamp as clipped.
    pub(super) fn clip(&mut self, sensor: Sensor, stamp: Stamp) {
        self.segmenter.clip(sensor, stamp);
        if sensor == Sensor::Gyroscope {
            self.turns.clip();
        }
    }

    /// Forgets the readings of a triad so far; of the primary accelerometer, all rests.
    pub(super) fn forget(&mut self, sensor: Sensor) {
        self.segmenter.forget(sensor);
        self.history.forget(sensor);
        self.turns.forget();
        if self.probe.is_some() {
            self.probe = Some(Box::new(UnitProbe::new(&self.config.still)));
        }
        if let Some(reference) = &mut self.reference {
            reference.forget(sensor);
        }
    }

    /// Ends an open rest.
    pub(super) fn finish(&mut self) {
        self.segmenter.finish();
        if let Some(probe) = &mut self.probe {
            probe.finish();
        }
    }

    /// Takes the next rest that has ended into the history. Returns whether there was one.
    pub(super) fn take_rest(&mut self) -> bool {
        let Some(rest) = self.segmenter.next_rest() else { return false };
        self.turns.rest(&rest);
        if let Some(heading) = &self.config.fit.heading {
            self.headings.rest(&rest, heading.std_deg.to_radians());
        }
        self.history.add(rest);
        true
    }

    /// Whether readings that are too loud for a rest turn out now to be in another unit.
    pub(super) fn finds_another_unit(&mut self) -> bool {
        if self.segmenter.state() != State::Unknown {
            // From here on the rests themselves are judged.
            self.probe = None;
        }
        self.probe.as_mut().is_some_and(|probe| probe.is_due()) && self.is_misread()
    }

    /// Judges every stored rest anew and fits what the accepted ones determine, with turns of other recordings between them.
    /// `kept` is the model of the accelerometer that was published last.
    pub(super) fn solve(&mut self, kept: Option<Parameterisation>, past_turns: &[TurnSeen]) -> Solution {
        let gyro_range = self.gyro_range();
        let Self {
            config, fixture, segmenter, history, turns, headings, probe, place, reference, first, clock, ..
        } = self;
        let gravity = solve::gravity(&config.fit, *place);
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
        let reference = reference.as_ref();
        let (first, reference_of_heading) = (first.unwrap_or_default(), config.fit.heading.as_ref());
        let changes = reference_of_heading.map(|heading| HeadingChanges::new(headings, heading));
        let doubt = changes.zip(reference_of_heading).and_then(|(changes, heading)| {
            heading_doubt::doubt(&changes, heading, turns, history.entries(), gyro_range)
        });
        let heading = changes.filter(|_| doubt.is_none());
        let rotations = Rotations { declared: &config.fit.rotations, first, heading };
        let inputs = FitInputs { gravity, step, kept, reference, turns, past_turns, rotations, gyro_range };
        let mut solution = solve::solve(history.entries_mut(), &judge, config, &inputs);
        if let Some(courses) = temperature::learn(history.entries(), &solution, &judge, &inputs, config) {
            let solve = |entries: &mut [_]| solve::solve(entries, &judge, config, &inputs);
            solution = temperature::at_reference(history.entries_mut(), courses, solution, solve);
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
        solution.faults.extend(gyroscope_faults::detect(segmenter, history.entries(), clock, &inputs, &solution));
        fault_detection::attribute(&mut solution.faults);
        fault_detection::veto(&mut solution);
        guidance::lay_to_unit(history.entries_mut(), &solution);
        solution.heading_doubt = doubt;
        solution.partial = partial_session::learn(history.entries(), &judge, &inputs, config, &solution);
        solution
    }

    /// Adds the noise of the finished stretches in which the IMU was at rest by the verdicts.
    pub(super) fn hear_noise(&mut self) {
        while let Some(stretch) = self.segmenter.next_stretch() {
            let mut rests = self.history.entries().iter().filter(|entry| entry.rest.placement == stretch.placement);
            if rests.any(|entry| entry.verdict.is_at_rest()) {
                self.noise.add(&stretch);
            }
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

    /// Changes of the heading from rest to rest, if the configuration has a reference.
    pub(super) fn heading_changes(&self) -> Option<HeadingChanges<'_>> {
        self.config.fit.heading.as_ref().map(|heading| HeadingChanges::new(&self.headings, heading))
    }

    /// Range of the gyroscope by the preset, rad/s.
    pub(super) fn gyro_range(&self) -> Option<f64> {
        self.config.preset.and_then(|preset| Some(preset.datasheet().gyroscope.as_ref()?.range))
    }
}
