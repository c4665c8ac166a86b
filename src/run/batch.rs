//! The batch path: a finished recording in, an annotated recording or a sidecar out.
//!
//! What is learned and how it is encoded is left to the layers beneath; what is said about it to the commands.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::correct::SecondReading;
use super::learn::{Learned, Learner, not_corrected, uncorrected};
use super::output::{Output, Written};
use super::recording::{Listener, Recording, Watch};
use super::spill::Spill;
use crate::Error;
use crate::annotate::{Corrected, Corrections};
use crate::config::Config;
use crate::imu::Verdict;
use crate::record::{Block, Channel, Damage, Event, Fold, Inventory, Piece, Sidecar, Tail};
use crate::report::Findings;

/// How to annotate.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// What to write.
    pub form: Form,
    /// Replace an output that exists.
    pub force: bool,
    /// Write a result even if no topic is an IMU.
    pub allow_no_imu: bool,
    /// Also read the chunks that hold nothing of use.
    pub verify: bool,
    /// Wait until the output is on the device.
    pub sync: bool,
}

/// What to write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// The recording with its annotations, as a new file.
    #[default]
    Annotated,
    /// The same, in the place of the recording itself, which must have been opened for
    /// [`Access::Change`](super::Access::Change). Always synced.
    InPlace,
    /// The annotations alone.
    Sidecar,
}

/// What was found in a recording.
#[derive(Debug)]
pub struct Report {
    /// The IMUs, and what was learned of each.
    pub imus: Vec<Findings>,
    /// Every channel, and what it was used for.
    pub channels: Vec<(Channel, Verdict)>,
    /// What was refused or missed, one line each.
    pub notes: Vec<String>,
    /// What is wrong with the recording: the first hundred damages.
    pub damage: Vec<Damage>,
    /// How many damages there are.
    pub damages: u64,
    /// Messages in the recording.
    pub messages: u64,
}

/// Annotates a recording into `output`; in place, that is its own path.
///
/// # Errors
///
/// If the recording cannot be read, has no usable IMU topic, or the output cannot be written; nothing is left behind.
pub fn annotate(
    recording: &Recording,
    output: &Path,
    config: &Config,
    options: Options,
    watch: Watch<'_>,
) -> Result<(Report, Written), Error> {
    let (path, settings) = (output, settings(config));
    let mut output = match options.form {
        Form::InPlace => Output::itself(recording)?,
        Form::Annotated | Form::Sidecar => Output::open(path, options.force)?,
    };
    let abandon = AtomicBool::new(false);
    let mut kept = Kept::beside(path);
    let (inventory, learned) = thread::scope(|scope| {
        let copying = (options.form == Form::Annotated).then(|| scope.spawn(|| output.copy_ahead(recording, &abandon)));
        let learned = learn(recording, config, options, Some(&mut kept), watch);
        abandon.store(learned.is_err(), Ordering::Relaxed);
        let copied =
            copying.map_or(Ok(()), |thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        let learned = learned?;
        copied.map(|()| learned)
    })?;
    if let Some(original) = recording.original_within(&inventory)? {
        drop(output);
        return annotate(&original, path, config, options, watch);
    }
    let mut learned = learned;
    if config.output.corrected == Corrected::Final {
        correct_all(recording, config, &mut learned, &mut kept, watch)?;
    }
    let report = Report::new(&inventory, &learned);
    let result = match options.form {
        Form::Sidecar => write_sidecar(&mut output, recording, &inventory, &settings, &learned, kept),
        Form::Annotated | Form::InPlace => {
            write_annotated(&mut output, recording, inventory, &settings, &learned, kept, watch)
        }
    };
    result?;
    Ok((report, output.finish(recording, options.sync)?))
}

/// Writes what was learned from a recording while it was recorded, as [`annotate`] writes what it learned itself.
pub(super) fn fold(
    recording: &Recording,
    (inventory, learned): (&Inventory, &Learned),
    kept: Kept,
    output: &Path,
    config: &Config,
    options: Options,
    watch: Watch<'_>,
) -> Result<(Report, Written), Error> {
    let mut output = Output::open(output, options.force)?;
    let abandon = AtomicBool::new(false);
    thread::scope(|scope| {
        let copying = scope.spawn(|| output.copy_ahead(recording, &abandon));
        while !copying.is_finished() {
            abandon.store(watch(0).is_err(), Ordering::Relaxed);
            thread::sleep(Duration::from_millis(1));
        }
        copying.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    watch(0)?;
    write_annotated(&mut output, recording, inventory.clone(), &settings(config), learned, kept, watch)?;
    Ok((Report::new(inventory, learned), output.finish(recording, options.sync)?))
}

/// Learns from a recording, and writes nothing.
///
/// # Errors
///
/// If the recording cannot be read or has no usable IMU topic.
pub fn calibrate(recording: &Recording, config: &Config, watch: Watch<'_>) -> Result<Report, Error> {
    let (inventory, learned) = learn(recording, config, Options::default(), None, watch)?;
    if let Some(original) = recording.original_within(&inventory)? {
        return calibrate(&original, config, watch);
    }
    Ok(Report::new(&inventory, &learned))
}

/// What determines the bytes of the annotations.
pub(super) fn settings(config: &Config) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("configuration".to_owned(), config.canonical()),
    ])
}

/// What is written behind the recording, until all of that has been read.
pub(super) struct Kept {
    /// The annotations.
    blocks: Spill,
    /// The chunk indexes.
    indexes: Spill,
}

impl Kept {
    pub(super) fn beside(output: &Path) -> Self {
        Self { blocks: Spill::beside(output), indexes: Spill::beside(output) }
    }

    pub(super) fn indexes(&mut self, indexes: &[u8]) -> Result<(), Error> {
        self.indexes.push(indexes)
    }

    pub(super) fn block(&mut self, block: &Block) -> Result<(), Error> {
        let mut bytes = Vec::new();
        block.write(&mut bytes);
        self.blocks.push_item(&bytes)
    }
}

fn next_block(blocks: &mut Spill) -> Result<Option<Block>, Error> {
    Ok(blocks.next_item()?.and_then(|bytes| Block::read(&bytes)))
}

/// Hears a recording.
struct Listening<'k> {
    learner: Learner,
    kept: Option<&'k mut Kept>,
    verify: bool,
}

impl Listener for Listening<'_> {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        self.learner.take(event, &mut |_| {});
        match &mut self.kept {
            Some(kept) => self.learner.take_blocks().try_for_each(|block| kept.block(&block)),
            None => {
                self.learner.take_blocks().for_each(drop);
                Ok(())
            }
        }
    }

    fn indexes(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.kept.as_mut().map_or(Ok(()), |kept| kept.indexes.push(bytes))
    }

    fn is_useless(&self, channels: &[u16]) -> bool {
        !self.verify && self.learner.is_useless(channels)
    }
}

/// Learns from a recording; what is to be written is kept where there is a place for it.
fn learn(
    recording: &Recording,
    config: &Config,
    options: Options,
    kept: Option<&mut Kept>,
    watch: Watch<'_>,
) -> Result<(Inventory, Learned), Error> {
    let mut listening = Listening { learner: Learner::new(config), kept, verify: options.verify };
    let inventory = recording.scan(watch, &mut listening)?;
    let Listening { learner, mut kept, .. } = listening;
    let mut learned = learner.finish(&mut |_| {});
    if let Some(kept) = &mut kept {
        learned.blocks.drain(..).try_for_each(|block| kept.block(&block))?;
    }
    if learned.imus.is_empty() && !options.allow_no_imu {
        return Err(no_imu(recording.path(), &inventory, &learned.channels));
    }
    Ok((inventory, learned))
}

/// Reads the recording again, and corrects its messages by the last calibrations.
fn correct_all(
    recording: &Recording,
    config: &Config,
    learned: &mut Learned,
    kept: &mut Kept,
    watch: Watch<'_>,
) -> Result<(), Error> {
    let of = |imu: &Findings| imu.calibration.as_ref().map(Corrections::of);
    let corrections: Vec<_> = learned.imus.iter().map(of).collect();
    for (imu, corrections) in learned.imus.iter().zip(&corrections) {
        learned.notes.extend(corrections.as_ref().and_then(|corrections| uncorrected(&imu.name, corrections)));
    }
    if corrections.iter().all(Option::is_none) {
        return Ok(());
    }
    let keep = |block: &Block| kept.block(block);
    let mut again = SecondReading::new(config, &mut learned.annotator, corrections, keep);
    recording.scan(watch, &mut again)?;
    let corrector = again.finish()?;
    let stuck = learned.imus.iter().filter(|imu| imu.calibration.is_some() && !corrector.has_written(&imu.name));
    learned.notes.extend(stuck.map(not_corrected));
    Ok(())
}

fn write_annotated(
    output: &mut Output,
    recording: &Recording,
    inventory: Inventory,
    settings: &BTreeMap<String, String>,
    learned: &Learned,
    mut kept: Kept,
    watch: Watch<'_>,
) -> Result<(), Error> {
    let refused = |e: crate::record::Error| Error::input(recording.path(), e.to_string());
    let tail = tail(recording, inventory.prefix(), watch)?;
    let (mut fold, pieces) = Fold::open(inventory, tail, settings, learned.annotator.topics()).map_err(refused)?;
    for piece in pieces {
        match piece {
            Piece::Original(range) if range.start == 0 => output.keep(range, recording)?,
            piece => output.put(&piece, recording)?,
        }
    }
    kept.blocks.rewind()?;
    while let Some(block) = next_block(&mut kept.blocks)? {
        watch(recording.length())?;
        output.put(&fold.block(learned.annotator.topics(), &block).map_err(refused)?, recording)?;
        kept.indexes.push(&fold.take_indexes())?;
    }
    output.close(fold.close(), kept.indexes, recording)
}

fn write_sidecar(
    output: &mut Output,
    recording: &Recording,
    inventory: &Inventory,
    settings: &BTreeMap<String, String>,
    learned: &Learned,
    mut kept: Kept,
) -> Result<(), Error> {
    let refused = |e: crate::record::Error| Error::input(recording.path(), e.to_string());
    let (mut sidecar, head) = Sidecar::open(inventory.profile(), settings);
    output.put(&Piece::Bytes(head), recording)?;
    kept.blocks.rewind()?;
    // Those of the recording are of no use here.
    let mut indexes = Spill::beside(recording.path());
    while let Some(block) = next_block(&mut kept.blocks)? {
        let bytes = sidecar.block(learned.annotator.topics(), &block).map_err(refused)?;
        output.put(&Piece::Bytes(bytes), recording)?;
        indexes.push(&sidecar.take_indexes())?;
    }
    output.close(sidecar.close(), indexes, recording)
}

/// What stands behind the prefix; a summary, mostly, but all that follows the damage in a damaged recording.
fn tail(recording: &Recording, prefix: u64, watch: Watch<'_>) -> Result<Tail, Error> {
    let length = recording.length().saturating_sub(prefix);
    let mut crc = crc32fast::Hasher::new();
    recording.read(prefix..recording.length(), watch, |bytes| crc.update(bytes))?;
    Ok(Tail { length, crc: crc.finalize() })
}

impl Report {
    pub(super) fn new(inventory: &Inventory, learned: &Learned) -> Self {
        Self {
            imus: learned.imus.clone(),
            channels: learned.channels.clone(),
            notes: learned.notes.clone(),
            damage: learned.damage.clone(),
            damages: learned.damages,
            messages: inventory.channels().keys().map(|&id| inventory.messages(id)).sum(),
        }
    }
}

/// The topics there are, why they are not used, and how to map one.
pub(super) fn no_imu(path: &Path, inventory: &Inventory, channels: &[(Channel, Verdict)]) -> Error {
    const LISTED: usize = 8;
    let topic = |(channel, verdict): &(Channel, Verdict)| {
        let schema = inventory.schemas().get(&channel.schema_id);
        let kind = schema.map_or(&*channel.message_encoding, |schema| &*schema.name);
        match verdict {
            Verdict::Skipped(why) => format!("{} ({kind}: {why})", channel.topic),
            _ => format!("{} ({kind})", channel.topic),
        }
    };
    let mut topics: Vec<_> = channels.iter().map(topic).collect();
    topics.sort();
    let further = topics.len().saturating_sub(LISTED);
    topics.truncate(LISTED);
    let listed = match (topics.as_slice(), further) {
        ([], _) => return Error::input(path, "no usable IMU topic: the recording has no topics at all"),
        (topics, 0) => topics.join(", "),
        (topics, further) => format!("{} and {further} more", topics.join(", ")),
    };
    let advice = match super::channels::suggested(channels.iter().map(|(_, verdict)| verdict)) {
        Some(imu) => format!("add --set '{}', which looks right by its names", imu.setting()),
        None => r#"map one with --set 'imu=[{topic="…", accel="…", gyro="…"}]'"#.to_owned(),
    };
    Error::input(path, format!("no usable IMU topic among {listed}; {advice}; see stillpoint topics"))
}
