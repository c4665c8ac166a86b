//! Messages corrected by an earlier calibration, until the recording's own is published. They are shown but not
//! written: what is written is a function of the recording.

use std::collections::BTreeMap;

use crate::annotate::{Corrections, is_only_partial};
use crate::config::Config;
use crate::imu::ImuId;
use crate::messages::Calibration;
use crate::pipeline::correction::{corrected, corrected_topic};
use crate::pipeline::sources::Sources;
use crate::record::{Annotation, Channel, Event, Message, Schema, Topic};
use crate::report::{Earlier, Findings};

/// Corrections for the messages of one recording.
pub(super) struct PreviousCalibration {
    calibrations: Vec<Findings>,
    sources: Sources,
    /// Corrections by output name of the IMU; `None` for an IMU without one, or whose corrected messages are written.
    by: BTreeMap<String, Option<Corrections>>,
    are_written: bool,
    /// Name of the IMU whose counterpart goes by another one, while it is the only IMU.
    alone: Option<String>,
}

impl PreviousCalibration {
    pub(super) fn new(calibrations: Vec<Findings>, config: &Config) -> Self {
        Self {
            calibrations,
            sources: Sources::new(config),
            by: BTreeMap::new(),
            are_written: config.output.corrected == crate::annotate::Corrected::Causal,
            alone: None,
        }
    }

    pub(super) fn channel(&mut self, channel: &Channel, schema: Option<&Schema>) {
        if let Some(schema) = schema {
            self.sources.take(&Event::Schema(schema));
        }
        self.sources.take(&Event::Channel(channel));
    }

    /// Corrected forms of a message, one for each IMU that it belongs to.
    pub(super) fn correct(&mut self, message: &Message<'_>) -> Vec<(Topic, Annotation)> {
        self.sources.intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
        self.sources.intake.take_notices();
        let imus = self.sources.intake.imus();
        if imus.len() > 1
            && let Some(alone) = self.alone.take()
        {
            // It stood for an IMU of another name while that was the only one.
            self.by.insert(alone, None);
        }
        for imu in imus {
            if !self.by.contains_key(&imu.name) {
                let recorded = imus.iter().map(|imu| (imu.name.as_str(), imu.topic.as_str()));
                let then = Earlier::among(&self.calibrations, recorded).of(&imu.name, &imu.topic).ok();
                self.alone = then.as_ref().and_then(|then| then.note.as_ref()).map(|_| imu.name.clone());
                let corrections = then.and_then(|then| then.findings.calibration.as_ref()).map(Corrections::of);
                self.by.insert(imu.name.clone(), corrections);
            }
        }
        let by = |id: ImuId| self.by.get(&self.sources.intake.imus().get(id.index())?.name)?.as_ref();
        let rewritten = corrected(&self.sources.intake, message, by);
        let annotation = |data| Annotation { topic: 0, sequence: 0, log_time: message.log_time, data };
        let Some(source) = self.sources.table.by_id(message.channel) else { return Vec::new() };
        let topic = |imu| corrected_topic(imu, source.channel, source.schema);
        rewritten.into_iter().map(|(imu, data)| (topic(imu), annotation(data))).collect()
    }

    /// Switches to the recording's own calibration, unless that corrects nothing yet.
    pub(super) fn calibrated(&mut self, imu: &str, calibration: &Calibration) {
        if is_only_partial(calibration) {
            return;
        }
        self.alone.take_if(|alone| alone == imu);
        let own = (!self.are_written).then(|| Corrections::of(calibration));
        self.by.insert(imu.to_owned(), own);
    }
}
