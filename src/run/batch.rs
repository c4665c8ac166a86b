//! The batch path: a finished recording in, an annotated recording or a sidecar out.
//!
//! What is learned and how it is encoded is left to the layers beneath; what is said about it to the commands.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::bag::Contents;
use super::correct::SecondReading;
use super::input::Input;
use super::learn::{Learned, Learner, not_corrected, uncorrected};
use super::output::{Output, Written};
use super::recording::{Listener, Recording, Watch};
use super::spill::Spill;
use super::target::Target;
use crate::Error;
use crate::annotate::{Annotator, Corrected, Corrections};
use crate::config::Config;
use crate::imu::Verdict;
use crate::record::{Block, Channel, Damage, Event, Fold, Inventory, Piece, Sidecar, Tail, Topic};
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

/// Annotates a recording into `outputs`: one path, or for several files that are one recording a path for each, unless
/// the annotations are written alone. In place, the paths do not matter.
///
/// Each split is annotated with what was learned while it was read; what is open at the end goes into the last one.
///
/// # Errors
///
/// If the recording cannot be read, has no usable IMU topic, or the output cannot be written; nothing is left behind.
pub fn annotate(
    input: &Input,
    outputs: &[PathBuf],
    config: &Config,
    options: Options,
    watch: Watch<'_>,
) -> Result<(Report, Written), Error> {
    let settings = settings(config);
    let alone = options.form == Form::Sidecar;
    let twice = config.output.corrected == Corrected::Final;
    let mut target = Target::open(input, outputs, options)?;
    let mut sidecar = if alone { Some(target.next(0)?) } else { None };
    let mut kept = Kept::beside(target.beside());
    let mut lesson = Lesson::new(input, config, options);
    let mut profile = None;
    // Splits that what is learned of later ones is to be written into.
    let mut drafts = Vec::new();
    for (index, split) in input.splits.iter().enumerate() {
        let done = lesson.done;
        let here = |at| watch(done + at);
        let output = if alone { None } else { Some(target.next(index)?) };
        let abandon = AtomicBool::new(false);
        let inventory = thread::scope(|scope| {
            let copying = output.as_ref().map(|output| scope.spawn(|| output.copy_ahead(split, &abandon)));
            let inventory = lesson.read(index, split, Some(&mut kept), &here);
            abandon.store(inventory.is_err(), Ordering::Relaxed);
            let copied =
                copying.map_or(Ok(()), |thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            let inventory = inventory?;
            copied.map(|()| inventory)
        })?;
        if let Some(original) = split.original_within(&inventory)? {
            drop((output, drafts, sidecar, target));
            return annotate(&input.with_split(index, original)?, outputs, config, options, watch);
        }
        profile.get_or_insert_with(|| inventory.profile().to_owned());
        if let Some(output) = output {
            let kept = std::mem::replace(&mut kept, Kept::beside(target.beside()));
            let draft = Draft { output, split, inventory, kept };
            match twice {
                true => drafts.push(draft),
                false => target.put(draft.write(&settings, lesson.learner.topics(), &here)?, split)?,
            }
        }
    }
    let Lesson { learner, mut contents, messages, .. } = lesson;
    let mut learned = learner.finish(&mut |_| {});
    if twice {
        let keep =
            |split: usize, block: &Block| drafts.get_mut(split).map_or(&mut kept, |draft| &mut draft.kept).block(block);
        correct_all(input, config, &mut learned, &mut contents, keep, watch)?;
    }
    let mut done = 0;
    for draft in drafts {
        let split = draft.split;
        target.put(draft.write(&settings, learned.annotator.topics(), &|at| watch(done + at))?, split)?;
        done += split.length();
    }
    if let (Some(mut output), Some(split)) = (sidecar.take(), input.splits.last()) {
        let profile = profile.unwrap_or_default();
        write_sidecar(&mut output, split, &profile, &settings, learned.annotator.topics(), kept)?;
        target.put(output, split)?;
    }
    let written = target.finish(&contents, learned.annotator.topics())?;
    Ok((Report::new(learned, messages), written))
}

/// A split that was read while it was recorded, and what is to be written behind it.
pub(super) struct Followed<'a> {
    inventory: &'a Inventory,
    /// How many topics of annotations there were at its end.
    topics: usize,
    kept: Kept,
    contents: Contents,
}

impl<'a> Followed<'a> {
    pub(super) fn new(inventory: &'a Inventory, topics: usize, output: &Path) -> Self {
        Self { inventory, topics, kept: Kept::beside(output), contents: Contents::of(inventory) }
    }

    /// Takes annotations.
    pub(super) fn keep(&mut self, topics: &[Topic], block: &Block) -> Result<(), Error> {
        self.contents.count(topics, block);
        self.kept.block(block)
    }
}

/// Writes what was learned from a recording while it was recorded, as [`annotate`] writes what it learned itself.
pub(super) fn fold(
    input: &Input,
    followed: Vec<Followed<'_>>,
    learned: &Learned,
    output: &Path,
    config: &Config,
    options: Options,
    watch: Watch<'_>,
) -> Result<(Report, Written), Error> {
    let settings = settings(config);
    let mut target = Target::open(input, &[output.to_owned()], options)?;
    let report = Report::of(followed.iter().map(|split| split.inventory), learned);
    let all = learned.annotator.topics();
    let mut contents = Vec::new();
    for (index, (split, followed)) in input.splits.iter().zip(followed).enumerate() {
        let output = target.next(index)?;
        let abandon = AtomicBool::new(false);
        thread::scope(|scope| {
            let copying = scope.spawn(|| output.copy_ahead(split, &abandon));
            while !copying.is_finished() {
                abandon.store(watch(0).is_err(), Ordering::Relaxed);
                thread::sleep(Duration::from_millis(1));
            }
            copying.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })?;
        watch(0)?;
        let Followed { inventory, topics, kept, contents: here } = followed;
        let draft = Draft { output, split, inventory: inventory.clone(), kept };
        target.put(draft.write(&settings, all.get(..topics).unwrap_or(all), watch)?, split)?;
        contents.push(here);
    }
    Ok((report, target.finish(&contents, all)?))
}

/// Learns from a recording, and writes nothing.
///
/// # Errors
///
/// If the recording cannot be read or has no usable IMU topic.
pub fn calibrate(input: &Input, config: &Config, watch: Watch<'_>) -> Result<Report, Error> {
    let mut lesson = Lesson::new(input, config, Options::default());
    for (index, split) in input.splits.iter().enumerate() {
        let done = lesson.done;
        let inventory = lesson.read(index, split, None, &|at| watch(done + at))?;
        if let Some(original) = split.original_within(&inventory)? {
            return calibrate(&input.with_split(index, original)?, config, watch);
        }
    }
    Ok(Report::new(lesson.learner.finish(&mut |_| {}), lesson.messages))
}

/// What determines the bytes of the annotations.
pub(super) fn settings(config: &Config) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("configuration".to_owned(), config.canonical()),
    ])
}

/// What is written behind the recording, until all of that has been read.
struct Kept {
    /// The annotations.
    blocks: Spill,
    /// The chunk indexes.
    indexes: Spill,
    /// Chunks whose message indexes are damaged.
    reindexed: Spill,
}

impl Kept {
    fn beside(output: &Path) -> Self {
        let spill = || Spill::beside(output);
        Self { blocks: spill(), indexes: spill(), reindexed: spill() }
    }

    fn block(&mut self, block: &Block) -> Result<(), Error> {
        let mut bytes = Vec::new();
        block.write(&mut bytes);
        self.blocks.push_item(&bytes)
    }
}

fn next_block(blocks: &mut Spill) -> Result<Option<Block>, Error> {
    Ok(blocks.next_item()?.and_then(|bytes| Block::read(&bytes)))
}

/// Hears a split.
struct Listening<'l, 'k> {
    learner: &'l mut Learner,
    kept: Option<&'k mut Kept>,
    /// What there is of annotations.
    contents: Contents,
    verify: bool,
}

impl Listening<'_, '_> {
    /// Keeps what has been learned.
    fn keep(&mut self) -> Result<(), Error> {
        let Self { learner, kept, contents, .. } = self;
        let blocks: Vec<_> = learner.take_blocks().collect();
        blocks.iter().try_for_each(|block| {
            contents.count(learner.topics(), block);
            kept.as_mut().map_or(Ok(()), |kept| kept.block(block))
        })
    }
}

impl Listener for Listening<'_, '_> {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        self.learner.take(event, &mut |_| {});
        self.keep()
    }

    fn indexes(&mut self, chunks: &[u8], reindexed: &[u8]) -> Result<(), Error> {
        let Some(kept) = &mut self.kept else { return Ok(()) };
        kept.indexes.push(chunks)?;
        if reindexed.is_empty() { Ok(()) } else { kept.reindexed.push_item(reindexed) }
    }

    fn verifies(&self) -> bool {
        self.verify
    }

    fn is_useless(&self, channels: &[u16]) -> bool {
        !self.verify && self.learner.is_useless(channels)
    }
}

/// What is learned of a recording while its splits are read.
struct Lesson<'a> {
    input: &'a Input,
    learner: Learner,
    options: Options,
    /// Bytes of the splits that have been read.
    done: u64,
    /// Messages in the recording.
    messages: u64,
    /// Of the splits with their annotations.
    contents: Vec<Contents>,
}

impl<'a> Lesson<'a> {
    fn new(input: &'a Input, config: &Config, options: Options) -> Self {
        let learner = Learner::new(config);
        Self { input, learner, options, done: 0, messages: 0, contents: Vec::new() }
    }

    /// Learns from the next split; what is to be written is kept where there is a place for it.
    fn read(
        &mut self,
        index: usize,
        split: &Recording,
        kept: Option<&mut Kept>,
        watch: Watch<'_>,
    ) -> Result<Inventory, Error> {
        let Self { input, learner, .. } = self;
        learner.begin_split(input.split_names().nth(index), index == 0);
        let contents = Contents::default();
        let mut listening = Listening { learner, kept, contents, verify: self.options.verify };
        let inventory = split.scan(watch, &mut listening)?;
        let is_last = index + 1 == input.splits.len();
        if is_last {
            listening.learner.close(&mut |_| {});
        } else {
            listening.learner.end_split();
        }
        listening.keep()?;
        let Listening { learner, mut contents, .. } = listening;
        if is_last && !self.options.allow_no_imu && !learner.has_imu() {
            return Err(no_imu(input.path(), learner.channels()));
        }

        self.messages += inventory.channels().keys().map(|&id| inventory.messages(id)).sum::<u64>();
        contents.add(&Contents::of(&inventory));
        self.contents.push(contents);
        self.done += split.length();
        Ok(inventory)
    }
}

/// Reads the recording again, and corrects its messages by the last calibrations; what is to be written, and into which
/// split, is told to `keep`.
fn correct_all(
    input: &Input,
    config: &Config,
    learned: &mut Learned,
    contents: &mut [Contents],
    mut keep: impl FnMut(usize, &Block) -> Result<(), Error>,
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
    let mut again = SecondReading::new(config, &mut learned.annotator, corrections);
    let mut done = 0;
    for (index, (split, contents)) in input.splits.iter().zip(contents).enumerate() {
        let keep = |annotator: &Annotator, block: Block| {
            contents.count(annotator.topics(), &block);
            keep(index, &block)
        };
        again.read(split, keep, &|at| watch(done + at))?;
        done += split.length();
    }
    let corrector = again.finish();
    let stuck = learned.imus.iter().filter(|imu| imu.calibration.is_some() && !corrector.has_written(&imu.name));
    learned.notes.extend(stuck.map(not_corrected));
    Ok(())
}

/// A split that has been read, and what is to be written behind it.
struct Draft<'a> {
    output: Output,
    split: &'a Recording,
    inventory: Inventory,
    kept: Kept,
}

impl Draft<'_> {
    fn write(self, settings: &BTreeMap<String, String>, topics: &[Topic], watch: Watch<'_>) -> Result<Output, Error> {
        let Self { mut output, split, inventory, kept } = self;
        write_annotated(&mut output, split, inventory, settings, topics, kept, watch)?;
        Ok(output)
    }
}

fn write_annotated(
    output: &mut Output,
    recording: &Recording,
    inventory: Inventory,
    settings: &BTreeMap<String, String>,
    topics: &[Topic],
    mut kept: Kept,
    watch: Watch<'_>,
) -> Result<(), Error> {
    let refused = |e: crate::record::Error| Error::input(recording.path(), e.to_string());
    let tail = tail(recording, inventory.prefix(), watch)?;
    let (mut fold, pieces) = Fold::open(inventory, tail, settings, topics).map_err(refused)?;
    for piece in pieces {
        match piece {
            Piece::Original(range) if range.start == 0 => output.keep(range, recording)?,
            piece => output.put(&piece, recording)?,
        }
    }
    kept.blocks.rewind()?;
    while let Some(block) = next_block(&mut kept.blocks)? {
        watch(recording.length())?;
        output.put(&fold.block(topics, &block).map_err(refused)?, recording)?;
        kept.indexes.push(&fold.take_indexes())?;
    }
    kept.reindexed.rewind()?;
    while let Some(taken) = kept.reindexed.next_item()? {
        watch(recording.length())?;
        fold.reindex(&taken).iter().try_for_each(|piece| output.put(piece, recording))?;
        kept.indexes.push(&fold.take_indexes())?;
    }
    output.close(fold.close(), kept.indexes, recording)
}

fn write_sidecar(
    output: &mut Output,
    recording: &Recording,
    profile: &str,
    settings: &BTreeMap<String, String>,
    topics: &[Topic],
    mut kept: Kept,
) -> Result<(), Error> {
    let refused = |e: crate::record::Error| Error::input(recording.path(), e.to_string());
    let (mut sidecar, head) = Sidecar::open(profile, settings);
    output.put(&Piece::Bytes(head), recording)?;
    kept.blocks.rewind()?;
    // Those of the recording are of no use here.
    let mut indexes = Spill::beside(recording.path());
    while let Some(block) = next_block(&mut kept.blocks)? {
        let bytes = sidecar.block(topics, &block).map_err(refused)?;
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
    fn new(learned: Learned, messages: u64) -> Self {
        let Learned { imus, channels, notes, damage, damages, .. } = learned;
        Self { imus, channels, notes, damage, damages, messages }
    }

    /// Of what was read of each split.
    pub(super) fn of<'a>(read: impl Iterator<Item = &'a Inventory>, learned: &Learned) -> Self {
        let messages = |read: &Inventory| read.channels().keys().map(|&id| read.messages(id)).sum::<u64>();
        Self {
            imus: learned.imus.clone(),
            channels: learned.channels.clone(),
            notes: learned.notes.clone(),
            damage: learned.damage.clone(),
            damages: learned.damages,
            messages: read.map(messages).sum(),
        }
    }
}

/// The topics there are, why they are not used, and how to map one.
pub(super) fn no_imu<'a>(
    path: &Path,
    channels: impl Iterator<Item = (&'a Channel, &'a Verdict, &'a str)> + Clone,
) -> Error {
    const LISTED: usize = 8;
    let topic = |(channel, verdict, kind): (&Channel, &Verdict, &'a str)| {
        let kind = if kind.is_empty() { &channel.message_encoding } else { kind };
        match verdict {
            Verdict::Skipped(why) => format!("{} ({kind}: {why})", channel.topic),
            _ => format!("{} ({kind})", channel.topic),
        }
    };
    let mut topics: Vec<_> = channels.clone().map(topic).collect();
    topics.sort();
    let further = topics.len().saturating_sub(LISTED);
    topics.truncate(LISTED);
    let listed = match (topics.as_slice(), further) {
        ([], _) => return Error::input(path, "no usable IMU topic: the recording has no topics at all"),
        (topics, 0) => topics.join(", "),
        (topics, further) => format!("{} and {further} more", topics.join(", ")),
    };
    let advice = match super::channels::suggested(channels.map(|(_, verdict, _)| verdict)) {
        Some(imu) => format!("add --set '{}', which looks right by its names", imu.setting()),
        None => r#"map one with --set 'imu=[{topic="…", accel="…", gyro="…"}]'"#.to_owned(),
    };
    Error::input(path, format!("no usable IMU topic among {listed}; {advice}; see stillpoint topics"))
}
