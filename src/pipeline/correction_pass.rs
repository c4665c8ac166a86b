//! Correction pass: a recording read again, now that its last calibration is known, for `corrected = "final"`.

use std::collections::BTreeMap;

use crate::annotate::{Annotator, Corrections};
use crate::config::Config;
use crate::imu::{ImuId, Intake};
use crate::pipeline::channel_ids::Roster;
use crate::pipeline::correction::Corrector;
use crate::record::{Block, Event, Message, Schema, Topic};

/// Corrected messages out of the events of a second scan, split by split.
pub(crate) struct CorrectionPass<'a> {
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

impl<'a> CorrectionPass<'a> {
    pub(crate) fn new(config: &Config, annotator: &'a mut Annotator, corrections: Vec<Option<Corrections>>) -> Self {
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

    /// Takes an event of the scan.
    pub(crate) fn take(&mut self, event: Event<'_>) {
        let Self { intake, roster, schemas, corrector, annotator, corrections, blocks } = self;
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
    }

    /// Whether messages on these channels, all of them known, are corrected by nothing.
    pub(crate) fn is_useless(&self, channels: &[u16]) -> bool {
        channels.iter().all(|&id| self.roster.knows(id) && !self.intake.wants(self.roster.id(id)))
    }

    /// Hands over the blocks that were closed since the last time.
    pub(crate) fn take_blocks(&mut self) -> Vec<Block> {
        std::mem::take(&mut self.blocks)
    }

    /// Topics of the annotations so far.
    pub(crate) fn topics(&self) -> &[Topic] {
        self.annotator.topics()
    }

    /// A split has ended, and another may begin.
    pub(crate) fn end_split(&mut self) {
        let last = self.annotator.finish();
        self.blocks.extend(last);
        self.schemas.clear();
        self.roster.begin_split();
    }

    /// The recording has ended.
    pub(crate) fn finish(self) -> Corrector {
        self.corrector
    }
}
