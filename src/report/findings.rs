//! What the annotations of a recording come to, IMU by IMU: the last word on everything.
//!
//! The same whether the annotations were just learned or read back. Saying it is left to the commands.

use std::collections::BTreeMap;

use crate::engine::{Event, Message};
use crate::messages::triad::Status;
use crate::messages::{Calibration, Coverage, Noise, Segment, Turn};

/// What is known of one IMU.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// What its annotation topics begin with.
    pub name: String,
    /// Topic of its accelerometer.
    pub topic: String,
    /// Type of the messages on it; empty where it is not known, as beside a sidecar.
    pub source_type: String,
    /// The rests by start, in nanoseconds; each with the last verdict.
    pub rests: BTreeMap<i64, Segment>,
    /// The turns between them by start, in nanoseconds; each with the last verdict.
    pub turns: BTreeMap<i64, Turn>,
    /// Sums of the noise at rest.
    pub noise: Option<Noise>,
    /// The faces seen, and the next step.
    pub coverage: Option<Coverage>,
    /// The calibration, if one was published.
    pub calibration: Option<Calibration>,
}

impl Findings {
    /// Nothing yet.
    pub fn new(name: &str, topic: &str) -> Self {
        Self { name: name.to_owned(), topic: topic.to_owned(), ..Self::default() }
    }

    /// Takes in an event; later ones count.
    pub fn note(&mut self, event: &Event) {
        match &event.message {
            Message::Segment(segment) => {
                self.rests.insert(super::nanos(&segment.start), segment.clone());
            }
            Message::Turn(turn) => {
                self.turns.insert(super::nanos(&turn.start), turn.clone());
            }
            Message::Noise(noise) => self.noise = Some(noise.clone()),
            Message::Coverage(coverage) => self.coverage = Some(coverage.clone()),
            Message::Calibration(calibration) => self.calibration = Some((**calibration).clone()),
            Message::Stillness(_) | Message::Log(_) => {}
        }
    }

    /// Number of rests that entered the fit.
    pub fn accepted(&self) -> usize {
        self.rests.values().filter(|rest| rest.accepted).count()
    }

    /// Rests that did not, in order of time.
    pub fn rejected(&self) -> impl Iterator<Item = &Segment> {
        self.rests.values().filter(|rest| !rest.accepted)
    }

    /// Whether the accelerometer was calibrated.
    pub fn is_calibrated(&self) -> bool {
        let accelerometer = self.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
        accelerometer.is_some_and(|triad| triad.status() != Status::Undetermined)
    }

    /// Why the accelerometer was not calibrated, if it was not.
    pub fn reason(&self) -> Option<&str> {
        if self.is_calibrated() {
            return None;
        }
        let accelerometer = self.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
        let note = accelerometer.and_then(|triad| triad.notes.first()).map(String::as_str);
        note.or_else(|| self.coverage.as_ref().map(|coverage| coverage.next_step.as_str()))
            .or(Some("no rest was found"))
    }
}
