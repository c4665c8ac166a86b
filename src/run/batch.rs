//! The batch path: a finished recording in, an annotated recording or a sidecar out.
//!
//! [`split_learner`] learns, [`annotated_writer`] writes; [`finished`](finished()) finds what a store has already.

mod annotated_writer;
mod finished;
mod settings;
mod split_learner;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

pub(super) use self::annotated_writer::Indexes;
use self::annotated_writer::{Kept, NextBlock, ReadSplit, write_annotated, write_sidecar};
pub use self::finished::{EarlierResult, finished};
pub(super) use self::settings::settings;
use self::split_learner::SplitLearner;
use crate::Error;
use crate::annotate::{Corrected, Corrections, is_only_partial};
use crate::config::Config;
use crate::imu::ChannelRole;
use crate::pipeline::annotated_before::annotated_before;
use crate::pipeline::correction_pass::CorrectionPass;
use crate::pipeline::learner::{Learned, not_corrected, uncorrected};
use crate::pipeline::time_order::Apart;
use crate::record::{Block, Channel, Damage, Event, Inventory, Topic};
use crate::report::Findings;
use crate::run::input::recording::Watch;
use crate::run::input::rosbag2::Contents;
use crate::run::input::scan_file::Listener;
use crate::run::input::splits::Input;
pub use crate::run::output::options::{Form, Options};
pub(super) use crate::run::output::set::OutputSet;
use crate::run::output::spill::Spill;
use crate::run::output::written::Written;
use crate::run::store::ResultMark;

/// Findings of a recording.
#[derive(Debug)]
pub struct Report {
    /// The IMUs and their findings.
    pub imus: Vec<Findings>,
    /// Every channel and its use.
    pub channels: Vec<(Channel, ChannelRole)>,
    /// Refused parts, one line each.
    pub notes: Vec<String>,
    /// Topics that the configuration names and the recording lacks, one line each.
    pub missing: Vec<String>,
    /// Damage of the recording: the first hundred places.
    pub damage: Vec<Damage>,
    /// Number of damaged places.
    pub damages: u64,
    /// Number of messages in the recording.
    pub messages: u64,
}

/// Annotates a recording into `outputs`: one path, or one path per file for several files that are one recording,
/// unless only the annotations are written. In place, the paths do not matter.
///
/// Each split is annotated with what was learned while it was read; findings that are open at the end go into the last
/// one.
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
    annotate_in_order(input, outputs, (&input.configured(config), &ResultMark::of(config)), options, watch, None)
}

/// The same, with messages of these channels in log-time order.
fn annotate_in_order(
    input: &Input,
    outputs: &[PathBuf],
    (config, mark): (&Config, &ResultMark),
    options: Options,
    watch: Watch<'_>,
    order: Option<Apart>,
) -> Result<(Report, Written), Error> {
    let settings = settings(config);
    let alone = options.form == Form::Sidecar;
    let twice = config.output.corrected == Corrected::Final;
    let mut target = OutputSet::open(input, outputs, options, mark.clone())?;
    let mut sidecar = if alone { Some(target.next(0)?) } else { None };
    let mut kept = Kept::beside(target.beside());
    let order = order.map(|apart| (apart, Spill::beside(target.beside())));
    let mut splits = SplitLearner::new(input, config, options, order);
    let mut profile = None;
    // Splits that are written after the last one was read, and the number of topics at the end of each: with the last
    // calibration, or in place, where a split that is written cannot be read in another order.
    let mut unwritten: Vec<(ReadSplit<'_>, usize)> = Vec::new();
    for (index, split) in input.splits.iter().enumerate() {
        let done = splits.done;
        let here = |at| watch(done + at);
        let output = if alone { None } else { Some(target.next(index)?) };
        let abandon = AtomicBool::new(false);
        let inventory = thread::scope(|scope| {
            let copying = output.as_ref().map(|output| {
                let copy = || output.copy_ahead(split, &abandon);
                // Without a thread, it is copied first.
                thread::Builder::new().spawn_scoped(scope, copy).map_err(|_| copy())
            });
            let inventory = splits.read(index, split, Some(&mut kept), &here);
            abandon.store(inventory.is_err(), Ordering::Relaxed);
            let copied = match copying {
                Some(Ok(thread)) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
                Some(Err(copied)) => copied,
                None => Ok(()),
            };
            let inventory = inventory?;
            copied.map(|()| inventory)
        })?;
        if let Some(original) = split.original_within(&inventory)? {
            drop((output, unwritten, sidecar, target));
            return annotate(&input.with_split(index, original)?, outputs, config, options, watch);
        }
        if let Some(apart) = splits.learner.apart() {
            drop((output, unwritten, sidecar, target));
            return annotate_in_order(input, outputs, (config, mark), options, watch, Some(apart));
        }
        // What is annotated once more says that it was edited, too.
        let note = || annotated_before(splits.learner.sources()).or_else(|| split.edit());
        if let Some(note) = note().filter(|_| !alone) {
            tracing::warn!("{}: {note}", split.path().display());
        }
        profile.get_or_insert_with(|| inventory.profile().to_owned());
        if let Some(output) = output {
            let kept = std::mem::replace(&mut kept, Kept::beside(target.beside()));
            let read = ReadSplit { output, split, inventory, kept };
            let in_place = options.form == Form::InPlace && index + 1 < input.splits.len();
            match twice || !unwritten.is_empty() || in_place && splits.learner.may_be_apart() {
                true => unwritten.push((read, splits.learner.topics().len())),
                false => target.put(read.write(&settings, splits.learner.topics(), &here)?, split)?,
            }
        }
    }
    let SplitLearner { learner, mut contents, messages, .. } = splits;
    let mut learned = learner.finish(&mut |_| {});
    if twice {
        let keep = |split: usize, block: &Block| {
            unwritten.get_mut(split).map_or(&mut kept, |(read, _)| &mut read.kept).blocks.push(block)
        };
        correct_all(input, config, &mut learned, &mut contents, keep, watch)?;
    }
    let mut done = 0;
    let topics = learned.annotator.topics();
    for (read, so_far) in unwritten {
        let split = read.split;
        // The last calibration is written into all of them.
        let topics = if twice { topics } else { topics.get(..so_far).unwrap_or(topics) };
        target.put(read.write(&settings, topics, &|at| watch(done + at))?, split)?;
        done += split.length();
    }
    if let (Some(mut output), Some(split)) = (sidecar.take(), input.splits.last()) {
        let profile = profile.unwrap_or_default();
        write_sidecar(&mut output, split, &profile, &settings, learned.annotator.topics(), kept.blocks)?;
        target.put(output, split)?;
    }
    let topics = learned.annotator.topics().to_vec();
    let report = Report::new(learned, messages);
    let written = target.finish(&contents, &topics, (report.damages, report.is_calibrated(config)))?;
    Ok((report, written))
}

/// A split that was read while it was recorded.
pub(super) struct Followed<'a> {
    pub(super) inventory: &'a Inventory,
    /// Number of annotation topics at its end.
    pub(super) topics: usize,
    /// Number of its annotation blocks.
    pub(super) blocks: u64,
    pub(super) indexes: Indexes,
}

/// Writes what was learned from a growing recording, in the same way as [`annotate`]. `next` supplies the blocks of all
/// splits in order.
pub(super) fn fold(
    input: &Input,
    followed: Vec<Followed<'_>>,
    next: NextBlock<'_>,
    learned: &Learned,
    mut target: OutputSet<'_>,
    settings: &BTreeMap<String, String>,
    watch: Watch<'_>,
) -> Result<(Report, Written), Error> {
    let report = Report::of(followed.iter().map(|split| split.inventory), learned);
    let all = learned.annotator.topics();
    let mut contents = Vec::new();
    for (index, (split, followed)) in input.splits.iter().zip(followed).enumerate() {
        let mut output = target.next(index)?;
        let abandon = AtomicBool::new(false);
        thread::scope(|scope| {
            let copy = || output.copy_ahead(split, &abandon);
            let Ok(copying) = thread::Builder::new().spawn_scoped(scope, copy) else { return copy() };
            while !copying.is_finished() {
                abandon.store(watch(0).is_err(), Ordering::Relaxed);
                thread::sleep(Duration::from_millis(1));
            }
            copying.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })?;
        watch(0)?;
        let Followed { inventory, topics, blocks, indexes } = followed;
        let (topics, mut left) = (all.get(..topics).unwrap_or(all), blocks);
        let mut here = Contents::of(inventory);
        let mut next = || {
            let block = if left == 0 { None } else { next()? };
            left = left.saturating_sub(1);
            block.iter().for_each(|block| here.count(all, block));
            Ok(block)
        };
        write_annotated(&mut output, split, inventory.clone(), settings, topics, (&mut next, indexes), watch)?;
        target.put(output, split)?;
        contents.push(here);
    }
    let written = target.finish(&contents, all, (report.damages, true))?;
    Ok((report, written))
}

/// Learns from a recording without writing anything.
///
/// # Errors
///
/// If the recording cannot be read or has no usable IMU topic.
pub fn calibrate(input: &Input, config: &Config, watch: Watch<'_>) -> Result<Report, Error> {
    calibrate_in_order(input, &input.configured(config), watch, None)
}

fn calibrate_in_order(input: &Input, config: &Config, watch: Watch<'_>, order: Option<Apart>) -> Result<Report, Error> {
    let order = order.map(|apart| (apart, Spill::temporary()));
    let mut splits = SplitLearner::new(input, config, Options::default(), order);
    for (index, split) in input.splits.iter().enumerate() {
        let done = splits.done;
        let inventory = splits.read(index, split, None, &|at| watch(done + at))?;
        if let Some(original) = split.original_within(&inventory)? {
            return calibrate(&input.with_split(index, original)?, config, watch);
        }
        if let Some(apart) = splits.learner.apart() {
            return calibrate_in_order(input, config, watch, Some(apart));
        }
    }
    Ok(Report::new(splits.learner.finish(&mut |_| {}), splits.messages))
}

/// Reads the recording again and corrects its messages by the last calibrations. `keep` receives each block and the
/// index of its split.
fn correct_all(
    input: &Input,
    config: &Config,
    learned: &mut Learned,
    contents: &mut [Contents],
    mut keep: impl FnMut(usize, &Block) -> Result<(), Error>,
    watch: Watch<'_>,
) -> Result<(), Error> {
    let known = |imu: &Findings| imu.calibration.clone().filter(|calibration| !is_only_partial(calibration));
    let of = |imu: &Findings| known(imu).as_ref().map(Corrections::of);
    let corrections: Vec<_> = learned.imus.iter().map(of).collect();
    for (imu, corrections) in learned.imus.iter().zip(&corrections) {
        learned.notes.extend(corrections.as_ref().and_then(|corrections| uncorrected(&imu.name, corrections)));
    }
    if corrections.iter().all(Option::is_none) {
        return Ok(());
    }
    let mut pass = CorrectionPass::new(config, &mut learned.annotator, corrections);
    let mut done = 0;
    for (index, (split, contents)) in input.splits.iter().zip(contents).enumerate() {
        let keep = |topics: &[Topic], block: &Block| {
            contents.count(topics, block);
            keep(index, block)
        };
        let mut correcting = Correcting { pass: &mut pass, keep };
        split.scan(config.limits.of_recordings(), &|at| watch(done + at), &mut correcting)?;
        correcting.pass.end_split();
        correcting.keep()?;
        done += split.length();
    }
    let (corrector, notes) = pass.finish();
    learned.notes.extend(notes);
    let stuck = learned.imus.iter().filter(|imu| known(imu).is_some() && !corrector.has_written(&imu.name));
    learned.notes.extend(stuck.map(not_corrected));
    Ok(())
}

impl Report {
    fn new(learned: Learned, messages: u64) -> Self {
        let Learned { imus, channels, notes, missing, damage, damages, .. } = learned;
        Self { imus, channels, notes, missing, damage, damages, messages }
    }

    /// Whether every IMU got an accelerometer calibration. A configured one that is missing got none.
    pub fn is_calibrated(&self, config: &Config) -> bool {
        let is_there = |topic: &str| self.channels.iter().any(|(channel, _)| channel.topic == topic);
        !self.imus.is_empty()
            && self.imus.iter().all(Findings::is_calibrated)
            && config.imu.iter().all(|imu| is_there(&imu.topic))
    }

    /// Report of a recording that was followed, with the message count of its splits.
    pub(super) fn of<'a>(read: impl Iterator<Item = &'a Inventory>, learned: &Learned) -> Self {
        let messages = |read: &Inventory| read.channels().keys().map(|&id| read.messages(id)).sum::<u64>();
        Self {
            imus: learned.imus.clone(),
            channels: learned.channels.clone(),
            notes: learned.notes.clone(),
            missing: learned.missing.clone(),
            damage: learned.damage.clone(),
            damages: learned.damages,
            messages: read.map(messages).sum(),
        }
    }
}

/// Listener to a split that is corrected.
struct Correcting<'p, 'a, K> {
    pass: &'p mut CorrectionPass<'a>,
    keep: K,
}

impl<K: FnMut(&[Topic], &Block) -> Result<(), Error>> Correcting<'_, '_, K> {
    fn keep(&mut self) -> Result<(), Error> {
        let blocks = self.pass.take_blocks();
        blocks.iter().try_for_each(|block| (self.keep)(self.pass.topics(), block))
    }
}

impl<K: FnMut(&[Topic], &Block) -> Result<(), Error>> Listener for Correcting<'_, '_, K> {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        self.pass.take(event);
        self.keep()
    }

    fn is_useless(&self, channels: &[u16]) -> bool {
        self.pass.is_useless(channels)
    }
}
