//! Corrected messages: those of the sources, with true values in the place of the measured ones. When, and by which
//! calibration, is left to [`Learner`](super::learn::Learner) and to the second reading of a recording.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::recording::Listener;
use crate::Error;
use crate::annotate::{Annotator, Corrections};
use crate::config::Config;
use crate::imu::{ImuId, Intake};
use crate::record::{Block, Channel, Event, Message, Schema, Topic};

/// Writes corrected messages.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Corrector {
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
    /// Of what there is a corrected message.
    written: BTreeSet<String>,
}

impl Corrector {
    pub(super) fn schema(&mut self, schema: &Schema) {
        self.schemas.insert(schema.id, schema.clone());
    }

    pub(super) fn channel(&mut self, channel: &Channel) {
        self.channels.insert(channel.id, channel.clone());
    }

    /// Whether a channel has been met.
    pub(super) fn knows(&self, channel: u16) -> bool {
        self.channels.contains_key(&channel)
    }

    /// Whether there is a corrected message of an IMU of that name.
    pub(super) fn has_written(&self, name: &str) -> bool {
        self.written.contains(name)
    }

    /// Corrects the message that `intake` has just taken, and appends the blocks that were closed before it.
    pub(super) fn correct<'c>(
        &mut self,
        message: &Message<'_>,
        intake: &Intake,
        by: impl Fn(ImuId) -> Option<&'c Corrections>,
        annotator: &mut Annotator,
        blocks: &mut Vec<Block>,
    ) {
        let corrected =
            intake.rewrite(message.channel, message.data, |imu, sensor, value| by(imu)?.correct(sensor, value));
        for (source, data) in corrected {
            let name = format!("{source}/stillpoint/corrected");
            let (schemas, channels) = (&self.schemas, &self.channels);
            let topic = || topic(&name, channels.get(&message.channel), schemas);
            blocks.extend(annotator.push_message(&name, topic, message.log_time, data));
            if !self.written.contains(source) {
                self.written.insert(source.to_owned());
            }
        }
    }
}

/// The topic of corrected messages: as the channel they come from, but for its name.
fn topic(name: &str, channel: Option<&Channel>, schemas: &BTreeMap<u16, Schema>) -> Topic {
    let schema = channel.and_then(|channel| schemas.get(&channel.schema_id));
    Topic {
        name: name.to_owned(),
        schema_name: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
        schema_encoding: schema.map(|schema| schema.encoding.clone()).unwrap_or_default(),
        schema: schema.map(|schema| schema.data.clone()).unwrap_or_default(),
        message_encoding: channel.map(|channel| channel.message_encoding.clone()).unwrap_or_default(),
        metadata: channel.map(|channel| channel.metadata.clone()).unwrap_or_default(),
    }
}

/// Hears a recording again, now that its last calibration is known.
pub(super) struct SecondReading<'a, K> {
    pub(super) intake: Intake,
    pub(super) corrector: Corrector,
    pub(super) annotator: &'a mut Annotator,
    /// By IMU.
    pub(super) corrections: Vec<Option<Corrections>>,
    pub(super) keep: K,
    blocks: Vec<Block>,
}

impl<'a, K: FnMut(&Block) -> Result<(), Error>> SecondReading<'a, K> {
    pub(super) fn new(
        config: &Config,
        annotator: &'a mut Annotator,
        corrections: Vec<Option<Corrections>>,
        keep: K,
    ) -> Self {
        let intake = Intake::new(&config.imu).with_fix_topic(config.fit.fix_topic.clone());
        Self { intake, corrector: Corrector::default(), annotator, corrections, keep, blocks: Vec::new() }
    }

    /// The recording has ended.
    pub(super) fn finish(mut self) -> Result<Corrector, Error> {
        self.blocks.extend(self.annotator.finish());
        self.blocks.drain(..).try_for_each(|block| (self.keep)(&block))?;
        Ok(self.corrector)
    }
}

impl<K: FnMut(&Block) -> Result<(), Error>> Listener for SecondReading<'_, K> {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        match event {
            Event::Schema(schema) => self.corrector.schema(schema),
            Event::Channel(channel) => {
                let schema = self.corrector.schemas.get(&channel.schema_id);
                self.intake.channel(channel, schema);
                self.corrector.channel(channel);
            }
            Event::Message(message) if self.intake.wants(message.channel) => {
                self.intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
                self.intake.take_notices();
                let by = |imu: ImuId| self.corrections.get(imu.index()).and_then(Option::as_ref);
                self.corrector.correct(&message, &self.intake, by, self.annotator, &mut self.blocks);
            }
            _ => {}
        }
        self.blocks.drain(..).try_for_each(|block| (self.keep)(&block))
    }

    fn is_useless(&self, channels: &[u16]) -> bool {
        channels.iter().all(|&id| self.corrector.knows(id) && !self.intake.wants(id))
    }
}
