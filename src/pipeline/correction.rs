//! Corrected messages: those of the sources, with true values in the place of the measured ones. When, and by which
//! calibration, is left to [`Learner`](crate::pipeline::learner::Learner) and to the [correction pass](crate::pipeline::correction_pass).

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::sources::Sources;
use crate::annotate::{Annotator, Corrections};
use crate::imu::ImuId;
use crate::record::{Block, Channel, Message, Schema, Topic};
use crate::topic::{self, Kind};

/// Writes corrected messages.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Corrector {
    /// Of what there is a corrected message.
    written: BTreeSet<String>,
}

/// The topic of the corrected messages of an IMU, whose source is that channel: as it, but for the name.
pub(crate) fn corrected_topic(imu: &str, channel: &Channel, schema: Option<&Schema>) -> Topic {
    Topic {
        name: topic::of(imu, Kind::Corrected),
        schema_name: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
        schema_encoding: schema.map(|schema| schema.encoding.clone()).unwrap_or_default(),
        schema: schema.map(|schema| schema.data.clone()).unwrap_or_default(),
        message_encoding: channel.message_encoding.clone(),
        metadata: channel.metadata.clone(),
    }
}

impl Corrector {
    /// Whether there is a corrected message of an IMU of that name.
    pub(crate) fn has_written(&self, name: &str) -> bool {
        self.written.contains(name)
    }

    /// Corrects the message that the intake has just taken, appends the blocks that were closed before it, and tells of
    /// each message that was written.
    pub(crate) fn correct<'c>(
        &mut self,
        message: &Message<'_>,
        sources: &Sources,
        by: impl Fn(ImuId) -> Option<&'c Corrections>,
        annotator: &mut Annotator,
        blocks: &mut Vec<Block>,
        mut tell: impl FnMut(&Annotator),
    ) {
        let Some(source) = sources.table.by_id(message.channel) else { return };
        let change = |imu, sensor, value| by(imu)?.correct(sensor, value);
        for (imu, data) in sources.intake.rewrite(message.channel, message.data, change) {
            let topic = || corrected_topic(imu, &source.channel, source.schema.as_ref());
            blocks.extend(annotator.push_message(&topic::of(imu, Kind::Corrected), topic, message.log_time, data));
            tell(annotator);
            if !self.written.contains(imu) {
                self.written.insert(imu.to_owned());
            }
        }
    }
}
