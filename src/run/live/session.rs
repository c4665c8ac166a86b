//! Notice of one recording, as messages for viewers. [`Live`](super::Live) sends them.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::{ChannelBuilder, RawChannel};

use super::previous_calibration::PreviousCalibration;
use super::queue::Item;
use super::shared::Shared;
use crate::Stamp;
use crate::annotate::diagnostics::{self, Diagnostic, Level};
use crate::config::Config;
use crate::engine::Message;
use crate::messages::Face;
use crate::messages::triad::Status as Known;
use crate::record::{Annotation, Channel, Schema, Topic};
use crate::report::Findings;
use crate::run::Notice;
use crate::still::{State, Status};

/// Longest interval between diagnostics, in nanoseconds of the recording's time.
const TICK: u64 = 1_000_000_000;

/// Shows the news of one recording. A topic of the same name and type in another recording is continued.
pub struct Session<'a> {
    shared: &'a Shared,
    /// Channels of the recording by id that have no used message yet, and the schemas that they share.
    unused: BTreeMap<u16, (Channel, Option<Arc<Schema>>)>,
    schemas: BTreeMap<u16, Arc<Schema>>,
    used: BTreeMap<u16, Arc<RawChannel>>,
    /// Channels by topic.
    annotations: BTreeMap<String, Arc<RawChannel>>,
    earlier: Option<PreviousCalibration>,
    log_time: u64,
    damages: usize,
    /// State of the IMUs, to be sent when due.
    diagnostics: Vec<Diagnostic>,
    due: u64,
}

impl<'a> Session<'a> {
    pub(super) fn new(shared: &'a Shared) -> Self {
        Self {
            shared,
            unused: BTreeMap::new(),
            schemas: BTreeMap::new(),
            used: BTreeMap::new(),
            annotations: BTreeMap::new(),
            earlier: None,
            log_time: 0,
            damages: 0,
            diagnostics: Vec::new(),
            due: 0,
        }
    }

    /// Also shows messages corrected by an earlier calibration, and by the recording's own once that is published.
    pub fn corrected_by(mut self, calibrations: Vec<Findings>, config: &Config) -> Self {
        self.earlier = Some(PreviousCalibration::new(calibrations, config));
        self
    }

    /// Shows a notice. Never waits for a viewer.
    pub fn show(&mut self, notice: &Notice<'_>) {
        match notice {
            // What was written anew under this name has its own channels and times.
            Notice::Opened(0) => {
                self.unused.clear();
                self.used.values().for_each(|channel| self.shared.leave(channel.id()));
                self.used.clear();
                (self.log_time, self.damages, self.due) = (0, 0, 0);
            }
            Notice::Channel { channel, schema: said } => {
                let schema = said.map(|schema| self.share(schema));
                self.unused.insert(channel.id, ((*channel).clone(), schema));
                self.earlier.iter_mut().for_each(|earlier| earlier.channel(channel, *said));
            }
            Notice::Message { message, .. } => {
                self.log_time = message.log_time;
                self.source(message.channel);
                // No viewer gets messages of the recording from before it connected.
                if let Some(channel) = self.used.get(&message.channel).filter(|_| self.shared.is_watched()) {
                    self.put(channel, message.log_time, message.data.to_vec(), true);
                }
                let corrected = self.earlier.as_mut().map(|earlier| earlier.correct(message));
                for (topic, annotation) in corrected.into_iter().flatten() {
                    self.annotate(&topic, &annotation, true);
                }
            }
            Notice::Annotation { imu, topic, annotation, event } => {
                self.annotate(topic, annotation, false);
                if let (Some(earlier), Message::Calibration(calibration)) = (&mut self.earlier, &event.message) {
                    earlier.calibrated(imu, calibration);
                }
                if matches!(event.message, Message::Coverage(_) | Message::Calibration(_)) {
                    self.due = 0;
                }
            }
            Notice::Corrected { topic, annotation } if self.shared.is_watched() => {
                self.annotate(topic, annotation, true)
            }
            Notice::Damage(_) => {
                self.damages += 1;
                self.due = 0;
            }
            Notice::Imu { findings, status } if self.log_time >= self.due => {
                self.diagnostics.extend(diagnose(findings, status))
            }
            Notice::Read(_) => self.diagnose(),
            _ => {}
        }
    }

    /// Sends the state of the recording and its IMUs, for diagnostic panels.
    fn diagnose(&mut self) {
        if self.log_time < self.due || self.diagnostics.is_empty() {
            return;
        }
        self.due = self.log_time.saturating_add(TICK);
        let (level, message) = match self.damages {
            0 => (Level::Ok, "undamaged".to_owned()),
            damages => (Level::Warn, format!("{damages} damaged places")),
        };
        let recording =
            Diagnostic { level, name: "stillpoint: recording".to_owned(), message, ..Diagnostic::default() };
        self.diagnostics.insert(0, recording);
        let data = diagnostics::encode(Stamp::from_log_time(self.log_time).into(), &self.diagnostics);
        self.diagnostics.clear();
        self.annotate(
            &diagnostics::topic(),
            &Annotation { topic: 0, sequence: 0, log_time: self.log_time, data },
            false,
        );
    }

    /// Advertises a topic at its first used message.
    fn source(&mut self, id: u16) {
        let Some((channel, schema)) = self.unused.remove(&id) else { return };
        if let Some(built) = self.shared.advertise(self.builder(&channel, schema.as_deref())) {
            self.used.insert(id, built);
        }
    }

    /// A schema, kept once however many channels have it.
    fn share(&mut self, schema: &Schema) -> Arc<Schema> {
        match self.schemas.get(&schema.id).filter(|known| ***known == *schema) {
            Some(known) => known.clone(),
            None => {
                let shared = Arc::new(schema.clone());
                self.schemas.insert(schema.id, shared.clone());
                shared
            }
        }
    }

    fn annotate(&mut self, topic: &Topic, annotation: &Annotation, is_bulk: bool) {
        if !self.annotations.contains_key(&topic.name) {
            let name = topic.schema_name.clone();
            let schema = (!name.is_empty()).then(|| foxglove::Schema {
                name,
                encoding: topic.schema_encoding.clone(),
                data: Cow::Owned(topic.schema.clone()),
            });
            let builder = ChannelBuilder::new(&topic.name).message_encoding(&topic.message_encoding).schema(schema);
            let built = self.shared.advertise(builder.context(&self.shared.context));
            self.annotations.extend(built.map(|channel| (topic.name.clone(), channel)));
        }
        if let Some(channel) = self.annotations.get(&topic.name) {
            self.put(channel, annotation.log_time, annotation.data.clone(), is_bulk);
        }
    }

    fn put(&self, channel: &Arc<RawChannel>, log_time: u64, data: Vec<u8>, is_bulk: bool) {
        self.shared.queue.put(Item { channel: channel.clone(), log_time, data, is_bulk });
    }

    fn builder(&self, channel: &Channel, schema: Option<&Schema>) -> ChannelBuilder {
        let schema = schema.map(|schema| foxglove::Schema {
            name: schema.name.clone(),
            encoding: schema.encoding.clone(),
            data: Cow::Owned(schema.data.clone()),
        });
        let builder = ChannelBuilder::new(&channel.topic).message_encoding(&channel.message_encoding);
        builder.schema(schema).metadata(channel.metadata.clone()).context(&self.shared.context)
    }
}

impl Drop for Session<'_> {
    fn drop(&mut self) {
        self.used.values().chain(self.annotations.values()).for_each(|channel| self.shared.leave(channel.id()));
    }
}

/// Rest state, seen faces and calibration of an IMU: a warning where an operator has to act.
fn diagnose(findings: &Findings, status: &Status) -> [Diagnostic; 3] {
    let name = |what: &str| format!("stillpoint: {}: {what}", findings.name);
    let number = |label: &str, value: f64| (label.to_owned(), format!("{value:.4}"));
    let (level, message) = match status.state {
        State::Unknown => (Level::Warn, "its noise is not known yet: let it rest"),
        State::Moving => (Level::Ok, "moving"),
        State::Still => (Level::Ok, "still"),
    };
    let floors = [("accelerometer noise, m/s²", status.accel_floor), ("gyroscope noise, rad/s", status.gyro_floor)];
    let rest = Diagnostic {
        level,
        name: name("rest"),
        message: message.to_owned(),
        hardware: findings.topic.clone(),
        values: [number("deviation over the noise floor", status.statistic), number("still below", status.enter)]
            .into_iter()
            .chain(floors.into_iter().filter_map(|(label, floor)| Some(number(label, floor?))))
            .collect(),
    };
    let faces = findings.coverage.as_ref().map_or(&[][..], |coverage| &coverage.faces);
    let seen = faces.iter().filter(|face| face.placements > 0).count();
    let all = findings.coverage.as_ref().is_some_and(|coverage| coverage.complete);
    let face = |face: &Face| match face.placements {
        0 => (face.name.clone(), "missing".to_owned()),
        placements => (face.name.clone(), format!("{placements}×, {:.1} s", face.seconds)),
    };
    let faces = Diagnostic {
        level: if all { Level::Ok } else { Level::Warn },
        name: name("faces"),
        message: if faces.is_empty() { "none seen yet".to_owned() } else { format!("{seen} of {} seen", faces.len()) },
        hardware: findings.topic.clone(),
        values: faces.iter().map(face).collect(),
    };
    let triad = findings.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
    let next = findings.coverage.as_ref().map_or("", |coverage| coverage.next_step.as_str());
    let (level, message) = match triad.map(|triad| triad.status()) {
        Some(Known::Confirmed) => (Level::Ok, "confirmed".to_owned()),
        Some(Known::Provisional) => (Level::Warn, format!("provisional: {next}")),
        Some(Known::Undetermined) | None => (Level::Warn, findings.reason().unwrap_or_default().to_owned()),
    };
    let revision = findings.calibration.as_ref().map_or(0, |calibration| calibration.revision);
    let counts = [("rests accepted", findings.accepted()), ("rests rejected", findings.rejected().count())];
    let vectors = triad.into_iter().flat_map(|triad| [("bias, m/s²", &triad.bias), ("scale", &triad.scale)]);
    let calibration = Diagnostic {
        level,
        name: name("calibration"),
        message,
        hardware: findings.topic.clone(),
        values: [("revision".to_owned(), revision.to_string())]
            .into_iter()
            .chain(counts.map(|(label, count)| (label.to_owned(), count.to_string())))
            .chain(vectors.filter_map(|(label, vector)| {
                let vector = vector.as_ref()?;
                Some((label.to_owned(), format!("{:.4} {:.4} {:.4}", vector.x, vector.y, vector.z)))
            }))
            .collect(),
    };
    [rest, faces, calibration]
}
