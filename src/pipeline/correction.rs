//! Corrected messages: those of the sources, with true values in the place of the measured ones. When, and by which
//! calibration, is left to [`Learner`](crate::pipeline::learner::Learner) and to the [correction pass](crate::pipeline::correction_pass).

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::annotate::{Annotator, Corrections};
use crate::imu::{ImuId, Intake};
use crate::record::{Block, Channel, Message, Schema, Topic};

/// Writes corrected messages.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Corrector {
    /// Topics of corrected messages by the channel they come from: as that, but for the name.
    topics: BTreeMap<u16, Topic>,
    /// Of what there is a corrected message.
    written: BTreeSet<String>,
}

impl Corrector {
    /// A channel, with its id in the recording.
    pub(crate) fn channel(&mut self, channel: &Channel, schema: Option<&Schema>) {
        let topic = Topic {
            name: String::new(),
            schema_name: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
            schema_encoding: schema.map(|schema| schema.encoding.clone()).unwrap_or_default(),
            schema: schema.map(|schema| schema.data.clone()).unwrap_or_default(),
            message_encoding: channel.message_encoding.clone(),
            metadata: channel.metadata.clone(),
        };
        self.topics.insert(channel.id, topic);
    }

    /// The topic of the corrected messages of a source, which they come from by that channel.
    pub(crate) fn topic(&self, channel: u16, source: &str) -> Option<Topic> {
        Some(Topic { name: format!("{source}/stillpoint/corrected"), ..self.topics.get(&channel)?.clone() })
    }

    /// Whether there is a corrected message of an IMU of that name.
    pub(crate) fn has_written(&self, name: &str) -> bool {
        self.written.contains(name)
    }

    /// Corrects the message that `intake` has just taken, appends the blocks that were closed before it, and tells of
    /// each message that was written.
    pub(crate) fn correct<'c>(
        &mut self,
        message: &Message<'_>,
        intake: &Intake,
        by: impl Fn(ImuId) -> Option<&'c Corrections>,
        annotator: &mut Annotator,
        blocks: &mut Vec<Block>,
        mut tell: impl FnMut(&Annotator),
    ) {
        let Some(like) = self.topics.get(&message.channel) else { return };
        let corrected =
            intake.rewrite(message.channel, message.data, |imu, sensor, value| by(imu)?.correct(sensor, value));
        for (source, data) in corrected {
            let name = format!("{source}/stillpoint/corrected");
            let topic = || Topic { name: name.clone(), ..like.clone() };
            blocks.extend(annotator.push_message(&name, topic, message.log_time, data));
            tell(annotator);
            if !self.written.contains(source) {
                self.written.insert(source.to_owned());
            }
        }
    }
}
