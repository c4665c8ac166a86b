//! What happened to the IMUs of a recording, for a report: told by its annotations where it has some, else by the
//! engine. Nothing that was annotated is fitted again. How a report looks is left to [`report`](crate::report).

use std::collections::BTreeMap;

use crate::Error;
use crate::annotate;
use crate::config::{Config, Layer};
use crate::engine;
use crate::imu::{ImuId, Intake, Reading, Sample, Sensor};
use crate::pipeline::channel_ids::Roster;
use crate::pipeline::learner::Learner;
use crate::record::{Block, Event, Schema, Topic};
use crate::report::{Findings, Story};
use crate::run::input::recording::Watch;
use crate::run::input::splits::{Input, Read};
use crate::run::inspect::topics::no_imu;

/// Damages that are listed one by one.
const LISTED: u64 = 10;

/// What a report is made of.
#[derive(Debug, Default)]
pub struct Stories {
    /// The IMUs.
    pub imus: Vec<Story>,
    /// The settings that were used, as TOML.
    pub settings: String,
    /// What was missed or wrong, one line each.
    pub notes: Vec<String>,
    /// How many damages there are.
    pub damages: u64,
}

/// Reads a recording, annotated or not, or a sidecar.
///
/// # Errors
///
/// If it cannot be read, or has neither annotations nor a usable IMU topic.
pub fn stories(input: &Input, config: &Config, watch: Watch<'_>) -> Result<Stories, Error> {
    let settings = input.settings()?.and_then(|mut settings| settings.remove("configuration"));
    // A configuration that another version wrote may not be understood; it is shown all the same.
    let used = settings.as_ref().and_then(|text| Config::load(&[Layer::file("the recording", text)]).ok());
    let config = used.as_ref().unwrap_or(config);
    let mut teller = Teller::new(config);
    let mut learner = settings.is_none().then(|| Learner::new(config));
    let mut splits = input.split_names();
    learner.iter_mut().for_each(|learner| learner.begin_split(splits.next(), true));
    input.scan(watch, |read| {
        match read {
            Read::Event(event) => {
                teller.take(&event, learner.is_none());
                if let Some(learner) = &mut learner {
                    learner.take(event, &mut |_| {});
                }
            }
            Read::SplitEnd => {
                teller.begin_split();
                if let Some(learner) = &mut learner {
                    learner.end_split();
                    learner.begin_split(splits.next(), false);
                }
            }
        }
        learner.iter_mut().for_each(|learner| teller.learned(learner));
        Ok(())
    })?;
    if let Some(mut learner) = learner {
        learner.close(&mut |_| {});
        teller.learned(&mut learner);
        if !learner.has_imu() {
            return Err(no_imu(input.path(), &learner.missing(), learner.channels()));
        }
        teller.notes.extend(learner.finish(&mut |_| {}).notes);
    }
    let Teller { imus, mut notes, damages, .. } = teller;
    if imus.is_empty() {
        return Err(Error::input(input.path(), "was annotated, but no IMU was found in it: nothing to report"));
    }
    if damages > LISTED {
        notes.push(format!("{damages} damages in all"));
    }
    Ok(Stories { imus, settings: settings.unwrap_or_else(|| config.canonical()), notes, damages })
}

struct Teller {
    imus: Vec<Story>,
    notes: Vec<String>,
    damages: u64,
    intake: Intake,
    roster: Roster,
    /// Of this split.
    schemas: BTreeMap<u16, Schema>,
    /// Annotation channels of this split: the IMU's name, type, encoding.
    annotations: BTreeMap<u16, (String, String, String)>,
    samples: Vec<(ImuId, Sensor, Sample)>,
}

impl Teller {
    fn new(config: &Config) -> Self {
        Self {
            imus: Vec::new(),
            notes: Vec::new(),
            damages: 0,
            intake: Intake::new(&config.imu),
            roster: Roster::default(),
            schemas: BTreeMap::new(),
            annotations: BTreeMap::new(),
            samples: Vec::new(),
        }
    }

    /// Another split begins, if one does.
    fn begin_split(&mut self) {
        self.schemas.clear();
        self.annotations.clear();
        self.roster.begin_split();
    }

    /// Takes what was just learned.
    fn learned(&mut self, learner: &mut Learner) {
        let blocks: Vec<_> = learner.take_blocks().collect();
        blocks.iter().for_each(|block| self.block(block, learner.topics()));
    }

    /// Takes annotations that were just learned.
    fn block(&mut self, block: &Block, topics: &[Topic]) {
        for annotation in &block.annotations {
            let Some(topic) = topics.get(annotation.topic) else { continue };
            let imu = topic.name.split_once("/stillpoint/").map_or("", |(imu, _)| imu);
            self.annotation(imu, &topic.schema_name, &topic.message_encoding, annotation.log_time, &annotation.data);
        }
    }

    /// Takes what stands in the recording; its annotations only where they are `believed`.
    fn take(&mut self, event: &Event<'_>, believed: bool) {
        match event {
            Event::Schema(schema) => {
                self.schemas.insert(schema.id, (*schema).clone());
            }
            Event::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id);
                if let Some(channel) = self.roster.enlist(channel, schema) {
                    self.intake.channel(&channel, schema);
                }
                if let Some((imu, _)) = channel.topic.split_once("/stillpoint/").filter(|_| believed) {
                    let kind = schema.map(|schema| schema.name.clone()).unwrap_or_default();
                    self.annotations.insert(channel.id, (imu.to_owned(), kind, channel.message_encoding.clone()));
                }
            }
            Event::Message(message) => match self.annotations.get(&message.channel).cloned() {
                Some((imu, kind, encoding)) => self.annotation(&imu, &kind, &encoding, message.log_time, message.data),
                None => self.source(self.roster.id(message.channel), message.log_time, message.data),
            },
            Event::Damage(damage) => {
                self.damages += 1;
                if self.damages <= LISTED {
                    self.notes.push(format!("damaged {damage}"));
                }
            }
            _ => {}
        }
    }

    fn annotation(&mut self, imu: &str, kind: &str, encoding: &str, log_time: u64, data: &[u8]) {
        let Ok(message) = annotate::read(kind, encoding, data) else { return };
        let event = engine::Event { log_time, message };
        // The log is of all IMUs; each line names its own.
        if let engine::Message::Log(log) = &event.message {
            let named: Vec<_> = self.imus.iter_mut().filter(|story| story.findings.name == log.name).collect();
            match named.is_empty() {
                true => self.imus.first_mut().into_iter().for_each(|story| story.note(&event)),
                false => named.into_iter().for_each(|story| story.note(&event)),
            }
            return;
        }
        self.story(imu).note(&event);
    }

    fn source(&mut self, channel: u16, log_time: u64, data: &[u8]) {
        if !self.intake.wants(channel) {
            return;
        }
        let samples = &mut self.samples;
        self.intake.message(channel, log_time, data, &mut |imu, sensor, reading| {
            if let Reading::Sample(sample) = reading {
                samples.push((imu, sensor, sample));
            }
        });
        for (imu, sensor, sample) in std::mem::take(&mut self.samples) {
            let Some(imu) = self.intake.imus().get(imu.index()) else { continue };
            let (name, topic) = (imu.name.clone(), imu.topic.clone());
            let story = self.story(&name);
            if story.findings.topic != topic {
                story.findings.topic = topic;
            }
            story.sample(sensor, &sample);
        }
    }

    fn story(&mut self, name: &str) -> &mut Story {
        let known = self.imus.iter().position(|story| story.findings.name == name).unwrap_or_else(|| {
            self.imus.push(Story::new(Findings::new(name, name)));
            self.imus.len() - 1
        });
        &mut self.imus[known]
    }
}
