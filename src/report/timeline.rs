//! Timeline of one IMU during a recording, the data of a report, in memory that does not grow with the samples.

use super::{Course, Envelope, Findings};
use crate::Stamp;
use crate::engine::{Event, Message};
use crate::imu::{Sample, Sensor};
use crate::messages::foxglove::log::Level;
use crate::messages::stillness::State;
use crate::messages::{Calibration, Stillness};

/// Most logged lines that are kept.
const LINES: usize = 200;

/// One IMU's timeline.
#[derive(Clone, Debug, Default)]
pub struct Timeline {
    /// The last state of all findings.
    pub findings: Findings,
    /// Course of the parameters, if the findings are those of many recordings; there are no readings then.
    pub course: Option<Course>,
    /// Readings of the accelerometer, m/s²; empty beside a sidecar.
    pub acceleration: Envelope<3>,
    /// Readings of the gyroscope, rad/s.
    pub rate: Envelope<3>,
    /// Readings of the secondary accelerometers in their order, m/s².
    pub secondary: Vec<Envelope<3>>,
    /// The statistic that decides on rest.
    pub statistic: Envelope<1>,
    /// Thresholds of the statistic: enter, leave.
    pub thresholds: Option<[f64; 2]>,
    /// Whether the state of the IMU was ever known, at rest or moving.
    pub was_judged: bool,
    /// Every published calibration, in order.
    pub revisions: Vec<Calibration>,
    /// Warnings and decisions: log time in nanoseconds, level, text.
    pub log: Vec<(u64, Level, String)>,
    /// Number of logged lines that were not kept.
    pub unlogged: u64,
}

impl Timeline {
    /// Timeline without events.
    pub fn new(findings: Findings) -> Self {
        Self { findings, ..Self::default() }
    }

    /// Takes an event.
    pub fn note(&mut self, event: &Event) {
        match &event.message {
            Message::Stillness(stillness) => self.stillness(stillness),
            Message::Calibration(calibration) => self.revisions.push((**calibration).clone()),
            Message::Log(log) if self.log.len() < LINES => {
                self.log.push((event.log_time, log.level(), log.message.clone()));
            }
            Message::Log(_) => self.unlogged += 1,
            _ => {}
        }
        self.findings.note(event);
    }

    /// Takes a sample.
    pub fn sample(&mut self, sensor: Sensor, sample: &Sample) {
        let outline = match sensor {
            Sensor::Accelerometer => &mut self.acceleration,
            Sensor::Gyroscope => &mut self.rate,
            Sensor::Secondary(index) => {
                self.secondary.resize_with(self.secondary.len().max(index + 1), Envelope::default);
                let Some(outline) = self.secondary.get_mut(index) else { return };
                outline
            }
            Sensor::Reference(_) => return,
        };
        outline.push(sample.stamp, sample.value.into());
        self.findings.near_misses.sample(sensor, sample);
    }

    /// First and last known stamp.
    pub fn span(&self) -> Option<(Stamp, Stamp)> {
        let spans = [self.acceleration.span(), self.statistic.span()];
        let known = spans.into_iter().flatten();
        known.reduce(|(from, until), (a, b)| (from.min(a), until.max(b)))
    }

    fn stillness(&mut self, stillness: &Stillness) {
        self.was_judged |= stillness.state() != State::Unknown;
        self.thresholds = Some([stillness.enter, stillness.leave]);
        let header = stillness.header.clone().unwrap_or_default();
        self.statistic.push(Stamp::from_nanos(super::nanos(&header.stamp)), [stillness.statistic]);
    }
}
