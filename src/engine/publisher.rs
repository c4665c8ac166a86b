//! Publisher of one IMU: turns what changed in a session into events.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::change_gate::ChangeGate;
use super::event::{Event, Message};
use super::fault::{Fault, FaultKind};
use super::rotations::Rotations;
use super::session::Session;
use super::solution::Solution;
use super::turn_verdict::{TurnsTold, View};
use super::{guidance, observations, publication};
use crate::Stamp;
use crate::fit::Parameterisation;
use crate::imu::Sensor;
use crate::messages;
use crate::messages::foxglove::log::Level;
use crate::still::State;

/// What was published of a session.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Publisher {
    gate: ChangeGate,
    turns: TurnsTold,
    /// Faults already reported.
    faults: BTreeSet<(Sensor, FaultKind)>,
    /// Texts on the declared rotations and headings that are of no use, at the end.
    unused_rotations: Vec<String>,
}

impl Publisher {
    /// Model of the accelerometer that was published last, if it was determined.
    pub(super) fn model(&self) -> Option<Parameterisation> {
        self.gate.model()
    }

    /// Texts on the rotations and headings of the configuration that are of no use, once all was published.
    pub(super) fn unused_rotations(&self) -> &[String] {
        &self.unused_rotations
    }

    /// Publishes changes: segments, then turns, coverage, calibration.
    pub(super) fn publish(
        &mut self,
        session: &mut Session,
        solution: &Solution,
        (stamp, log_time): (Stamp, u64),
        at_end: bool,
        events: &mut Vec<Event>,
    ) {
        let header = publication::header(stamp, &session.config.frame_id);
        let event = |message| Event { log_time, message };
        let mut rejected = Vec::new();
        let Session { config, fixture, history, .. } = session;
        for entry in history.entries_mut() {
            if entry.told.as_ref().is_some_and(|told| !entry.verdict.differs_from(told)) {
                continue;
            }
            entry.told = Some(entry.verdict.clone());
            let segment = publication::segment(header.clone(), entry, config, fixture);
            if !segment.accepted {
                rejected.push(guidance::rejection(&segment));
            }
            events.push(event(Message::Segment(segment)));
        }
        let session = &*session;
        let Session { config, fixture, history, segmenter, .. } = session;
        let view = View {
            turns: &session.turns,
            entries: history.entries(),
            solution,
            noise: observations::gyroscope_noise(segmenter),
            range: session.gyro_range(),
            whole_turns: config.fit.whole_turns,
            rotations: Rotations {
                declared: &config.fit.rotations,
                first: session.first.unwrap_or_default(),
                heading: session.heading_changes().filter(|_| solution.heading_doubt.is_none()),
            },
        };
        let turns = self.turns.news(&header, &view);
        events.extend(turns.into_iter().map(|turn| event(Message::Turn(turn))));
        if at_end {
            self.unused_rotations = view.unused_rotations();
            let heading = config.fit.heading.as_ref();
            let unused = heading.and_then(|heading| view.unused_headings(&session.headings, heading));
            self.unused_rotations.extend(unused);
        }
        let log = |level, text| Event::log(&config.name, (stamp, log_time), level, text);
        let never_still = guidance::never_still(segmenter, history.found(), &config.still);
        let never_still = never_still.map(|never| guidance::misread(config, solution).unwrap_or(never));
        let obstacle = never_still.or_else(|| guidance::obstacle(config, solution, history.entries(), fixture));
        let coverage = publication::coverage(header.clone(), history, (config, fixture), solution, obstacle);
        if let Some(coverage) = self.gate.coverage(coverage) {
            events.push(event(Message::Coverage(coverage)));
        }
        let calibration = publication::calibration(header, history, config, solution);
        let round = self.gate.round(history, fixture, config.fit.refit);
        let mut news = self.gate.calibration(calibration, at_end, round);
        if let Some(calibration) = &mut news {
            session.noise.describe(calibration);
        }
        if let Some(calibration) = &news {
            events.push(event(Message::Calibration(Box::new(calibration.clone()))));
        }
        for Fault { sensor, kind, text } in &solution.faults {
            if self.faults.insert((*sensor, *kind)) {
                let text = format!("{}: {text}", guidance::sensor(config, *sensor));
                events.push(log(Level::Warning, text));
            }
        }
        rejected.extend(self.unused_rotations.iter().cloned());
        for text in rejected {
            events.push(log(Level::Warning, text));
        }
        if let Some(calibration) = news {
            events.push(log(Level::Info, guidance::published(&calibration)));
        }
    }
}

/// Message on the state of rest at a stamp.
pub(super) fn stillness(session: &Session, stamp: Stamp) -> messages::Stillness {
    let status = session.segmenter.status();
    let state = match status.state {
        State::Unknown => messages::stillness::State::Unknown,
        State::Moving => messages::stillness::State::Moving,
        State::Still => messages::stillness::State::Still,
    };
    messages::Stillness {
        header: Some(publication::header(stamp, &session.config.frame_id)),
        state: state.into(),
        statistic: status.statistic,
        enter: status.enter,
        leave: status.leave,
    }
}
