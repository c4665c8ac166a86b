//! Events of an engine as annotations, and lines in the recording's log.

use super::Learner;
use super::notes::uncorrected;
use crate::Stamp;
use crate::annotate::{Annotator, Corrected, Corrections, is_only_partial};
use crate::engine::{self, Message};
use crate::messages::foxglove::Log;
use crate::messages::foxglove::log::Level;
use crate::pipeline::events::{Notice, Notify};
use crate::printable;
use crate::record::{Annotation, Topic};

impl Learner {
    /// Writes the events of an IMU as annotations.
    pub(super) fn publish(&mut self, imu: usize, notify: Notify<'_>) {
        let name = self.sources.intake.imus().get(imu).map_or("", |imu| &imu.name);
        let mut left = None;
        for event in self.events.drain(..) {
            self.blocks.extend(self.annotator.push(name, &event));
            tell_of(&self.annotator, name, &event, notify);
            let Some(learning) = self.imus.get_mut(imu) else { continue };
            learning.findings.note(&event);
            if let Message::Calibration(calibration) = &event.message
                && self.config.output.corrected == Corrected::Causal
                && (learning.corrections.is_some() || !is_only_partial(calibration))
            {
                let first = learning.corrections.is_none();
                let corrections = learning.corrections.insert(Corrections::of(calibration));
                left = left.or_else(|| uncorrected(name, corrections).filter(|_| first));
            }
        }
        if let Some(text) = left {
            self.log(Level::Info, text, notify);
        }
    }

    /// Writes a line to the recording's log.
    pub(super) fn log(&mut self, level: Level, message: String, notify: Notify<'_>) {
        let timestamp = Some(Stamp::from_log_time(self.log_time).into());
        let message = printable(&message).into_owned();
        let log = Log { timestamp, level: level.into(), message, name: "stillpoint".to_owned(), ..Log::default() };
        let event = engine::Event { log_time: self.log_time, message: Message::Log(log) };
        self.blocks.extend(self.annotator.push("", &event));
        tell_of(&self.annotator, "", &event, notify);
    }
}

/// Reports the annotation that was added last.
fn tell_of(annotator: &Annotator, imu: &str, event: &engine::Event, notify: Notify<'_>) {
    if let Some((topic, annotation)) = last_of(annotator) {
        notify(Notice::Annotation { imu, topic, annotation, event });
    }
}

/// The annotation that was added last, and its topic.
pub(super) fn last_of(annotator: &Annotator) -> Option<(&Topic, &Annotation)> {
    let annotation = annotator.open().last()?;
    Some((annotator.topics().get(annotation.topic)?, annotation))
}
