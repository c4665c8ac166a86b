//! Timelines of a recording's IMUs, for a report: from its annotations if it has some, otherwise from a learner.

use super::annotations;
use super::damages::Damages;
use super::learner::Learner;
use super::no_imu::why_no_imu;
use super::sources::Sources;
use crate::annotate;
use crate::config::Config;
use crate::engine;
use crate::imu::{ImuId, Reading, Sample, Sensor};
use crate::record::{Event, Message};
use crate::report::{Findings, Timeline};
use crate::topic;

/// Collects timelines from the events of a scan.
pub(crate) struct Timelines {
    pub(crate) imus: Vec<Timeline>,
    /// Missing inputs and problems, one line each.
    pub(crate) notes: Vec<String>,
    pub(crate) damages: Damages,
    /// Index of the split that is scanned.
    split: usize,
    sources: Sources,
    /// Whether the annotations in the recording are used, and nothing is learned.
    annotated: bool,
    samples: Vec<(ImuId, Sensor, Sample)>,
}

impl Timelines {
    /// Timelines of a recording whose annotations are used if it is `annotated`.
    pub(crate) fn new(config: &Config, annotated: bool) -> Self {
        let sources = Sources::new(config);
        Self {
            imus: Vec::new(),
            notes: Vec::new(),
            damages: Damages::default(),
            split: 0,
            sources,
            annotated,
            samples: Vec::new(),
        }
    }

    /// Processes an event of the scan.
    pub(crate) fn take(&mut self, event: &Event<'_>) {
        self.sources.take(event);
        match event {
            Event::Message(message) => {
                if let Some(message) = self.sources.wanted(*message) {
                    self.source(&message);
                } else if self.annotated
                    && let Some((imu, event)) = annotations::read(&self.sources.table, message)
                {
                    let imu = imu.to_owned();
                    self.annotation(&imu, &event);
                }
            }
            Event::Damage(damage) => {
                self.damages.add(self.split, damage.clone());
            }
            _ => {}
        }
    }

    /// Prepares for another split, if one follows.
    pub(crate) fn begin_split(&mut self) {
        self.split += 1;
        self.sources.begin_split();
    }

    /// Adds the new annotations of a learner.
    pub(crate) fn learned(&mut self, learner: &mut Learner) {
        let blocks: Vec<_> = learner.take_blocks().collect();
        for annotation in blocks.iter().flat_map(|block| &block.annotations) {
            let Some(on) = learner.topics().get(annotation.topic) else { continue };
            let Ok(message) = annotate::read(&on.schema_name, &on.message_encoding, &annotation.data) else { continue };
            let event = engine::Event { log_time: annotation.log_time, message };
            self.annotation(topic::imu_of(&on.name).unwrap_or_default(), &event);
        }
    }

    /// Reasons why there is no IMU.
    pub(crate) fn why_no_imu(&self) -> String {
        why_no_imu(&self.sources, &self.sources.intake.obstacles())
    }

    /// Timelines, notes, and number of damages.
    pub(crate) fn finish(self) -> (Vec<Timeline>, Vec<String>, u64) {
        let Self { imus, notes, damages, sources, annotated, .. } = self;
        let mut lines = damages.lines();
        lines.extend(notes);
        // A learner tells the same.
        let faults = annotated.then(|| sources.intake.faults()).into_iter().flatten();
        lines.extend(faults.map(|fault| fault.to_string()));
        (imus, lines, damages.count())
    }

    fn annotation(&mut self, imu: &str, event: &engine::Event) {
        // The log is shared by all IMUs; each line names its own.
        if let engine::Message::Log(log) = &event.message {
            let named: Vec<_> = self.imus.iter_mut().filter(|timeline| timeline.findings.name == log.name).collect();
            match named.is_empty() {
                true => self.imus.first_mut().into_iter().for_each(|timeline| timeline.note(event)),
                false => named.into_iter().for_each(|timeline| timeline.note(event)),
            }
            return;
        }
        self.timeline(imu).note(event);
    }

    fn source(&mut self, message: &Message<'_>) {
        let Self { sources, samples, .. } = self;
        sources.intake.message(message.channel, message.log_time, message.data, &mut |imu, sensor, reading| {
            if let Reading::Sample(sample) = reading {
                samples.push((imu, sensor, sample));
            }
        });
        for (imu, sensor, sample) in std::mem::take(&mut self.samples) {
            let Some(imu) = self.sources.intake.imus().get(imu.index()) else { continue };
            let (name, topic) = (imu.name.clone(), imu.topic.clone());
            let timeline = self.timeline(&name);
            if timeline.findings.topic != topic {
                timeline.findings.topic = topic;
            }
            timeline.sample(sensor, &sample);
        }
    }

    fn timeline(&mut self, name: &str) -> &mut Timeline {
        let known = self.imus.iter().position(|timeline| timeline.findings.name == name).unwrap_or_else(|| {
            self.imus.push(Timeline::new(Findings::new(name, name)));
            self.imus.len() - 1
        });
        &mut self.imus[known]
    }
}
