//! Corrected messages: those of the sources, with true values in the place of the measured ones. When, and by which
//! calibration, is left to [`Learner`](super::learn::Learner) and to the second reading of a recording.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::recording::{Listener, Recording, Watch};
use super::roster::Roster;
use crate::Error;
use crate::annotate::{Annotator, Corrections};
use crate::config::Config;
use crate::imu::{ImuId, Intake};
use crate::record::{Block, Channel, Event, Message, Schema, Topic};

/// Writes corrected messages.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Corrector {
    /// Topics of corrected messages by the channel they come from: as that, but for the name.
    topics: BTreeMap<u16, Topic>,
    /// Of what there is a corrected message.
    written: BTreeSet<String>,
}

impl Corrector {
    /// A channel, with its id in the recording.
    pub(super) fn channel(&mut self, channel: &Channel, schema: Option<&Schema>) {
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
    pub(super) fn topic(&self, channel: u16, source: &str) -> Option<Topic> {
        Some(Topic { name: format!("{source}/stillpoint/corrected"), ..self.topics.get(&channel)?.clone() })
    }

    /// Whether there is a corrected message of an IMU of that name.
    pub(super) fn has_written(&self, name: &str) -> bool {
        self.written.contains(name)
    }

    /// Corrects the message that `intake` has just taken, appends the blocks that were closed before it, and tells of
    /// each message that was written.
    pub(super) fn correct<'c>(
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

/// Reads a recording again, now that its last calibration is known, split by split.
pub(super) struct SecondReading<'a> {
    intake: Intake,
    roster: Roster,
    /// Of this split.
    schemas: BTreeMap<u16, Schema>,
    corrector: Corrector,
    annotator: &'a mut Annotator,
    /// By IMU.
    corrections: Vec<Option<Corrections>>,
    blocks: Vec<Block>,
}

impl<'a> SecondReading<'a> {
    pub(super) fn new(config: &Config, annotator: &'a mut Annotator, corrections: Vec<Option<Corrections>>) -> Self {
        Self {
            intake: Intake::new(&config.imu).with_fix_topic(config.fit.fix_topic.clone()),
            roster: Roster::default(),
            schemas: BTreeMap::new(),
            corrector: Corrector::default(),
            annotator,
            corrections,
            blocks: Vec::new(),
        }
    }

    /// Reads the next split, and hands over its corrected messages.
    pub(super) fn read(
        &mut self,
        split: &Recording,
        keep: impl FnMut(&Annotator, Block) -> Result<(), Error>,
        watch: Watch<'_>,
    ) -> Result<(), Error> {
        let mut hearing = Hearing { reading: self, keep };
        split.scan(watch, &mut hearing)?;
        let last = hearing.reading.annotator.finish();
        hearing.reading.blocks.extend(last);
        hearing.keep()?;
        self.schemas.clear();
        self.roster.begin_split();
        Ok(())
    }

    /// The recording has ended.
    pub(super) fn finish(self) -> Corrector {
        self.corrector
    }
}

/// Hears a split.
struct Hearing<'r, 'a, K> {
    reading: &'r mut SecondReading<'a>,
    keep: K,
}

impl<K: FnMut(&Annotator, Block) -> Result<(), Error>> Hearing<'_, '_, K> {
    fn keep(&mut self) -> Result<(), Error> {
        let SecondReading { annotator, blocks, .. } = self.reading;
        blocks.drain(..).try_for_each(|block| (self.keep)(annotator, block))
    }
}

impl<K: FnMut(&Annotator, Block) -> Result<(), Error>> Listener for Hearing<'_, '_, K> {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        let SecondReading { intake, roster, schemas, corrector, annotator, corrections, blocks } = self.reading;
        match event {
            Event::Schema(schema) => {
                schemas.insert(schema.id, schema.clone());
            }
            Event::Channel(channel) => {
                let schema = schemas.get(&channel.schema_id);
                if let Some(channel) = roster.enlist(channel, schema) {
                    intake.channel(&channel, schema);
                    corrector.channel(&channel, schema);
                }
            }
            Event::Message(message) => {
                let message = Message { channel: roster.id(message.channel), ..message };
                if intake.wants(message.channel) {
                    intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
                    intake.take_notices();
                    let by = |imu: ImuId| corrections.get(imu.index()).and_then(Option::as_ref);
                    corrector.correct(&message, intake, by, annotator, blocks, |_| {});
                }
            }
            _ => {}
        }
        self.keep()
    }

    fn is_useless(&self, channels: &[u16]) -> bool {
        let SecondReading { intake, roster, .. } = &*self.reading;
        channels.iter().all(|&id| roster.knows(id) && !intake.wants(roster.id(id)))
    }
}
