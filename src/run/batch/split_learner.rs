//! Learning from a recording split by split, and keeping the annotations of each.

use super::Options;
use super::annotated_writer::Kept;
use crate::Error;
use crate::config::Config;
use crate::pipeline::learner::Learner;
use crate::pipeline::no_imu::no_imu;
use crate::pipeline::time_order::Apart;
use crate::record::{Event, Inventory, Limits};
use crate::run::input::recording::{Recording, Watch};
use crate::run::input::rosbag2::Contents;
use crate::run::input::scan_file::Listener;
use crate::run::input::splits::Input;
use crate::run::output::spill::Spill;

/// State of learning while the splits of a recording are read.
pub(super) struct SplitLearner<'a> {
    input: &'a Input,
    pub(super) learner: Learner,
    options: Options,
    limits: Limits,
    /// Bytes of the splits that have been read.
    pub(super) done: u64,
    /// Number of messages read.
    pub(super) messages: u64,
    /// Contents of the splits with their annotations.
    pub(super) contents: Vec<Contents>,
}

impl<'a> SplitLearner<'a> {
    /// Of a recording, with messages of the channels of `order` in the order of their times, and room for them.
    pub(super) fn new(input: &'a Input, config: &Config, options: Options, order: Option<(Apart, Spill)>) -> Self {
        let learner = Learner::new(config);
        let learner = match order {
            Some((channels, room)) => learner.in_time_order(channels, Box::new(room)),
            None => learner,
        };
        let limits = config.limits.of_recordings();
        Self { input, learner, options, limits, done: 0, messages: 0, contents: Vec::new() }
    }

    /// Learns from the next split; the annotations go into `kept`, if there is one.
    pub(super) fn read(
        &mut self,
        index: usize,
        split: &Recording,
        kept: Option<&mut Kept>,
        watch: Watch<'_>,
    ) -> Result<Inventory, Error> {
        let Self { input, learner, limits, .. } = self;
        learner.begin_split(input.split_names().nth(index), index == 0);
        let contents = Contents::default();
        let mut listening = Listening { learner, kept, contents, verify: self.options.verify };
        let inventory = split.scan(*limits, watch, &mut listening)?;
        let is_last = index + 1 == input.splits.len();
        if is_last {
            for (name, damage) in input.blank() {
                listening.learner.end_split();
                listening.learner.begin_split(Some(name.clone()), false);
                listening.learner.take(Event::Damage(damage.clone()), &mut |_| {});
            }
            listening.learner.close(&mut |_| {});
        } else {
            listening.learner.end_split();
        }
        listening.keep()?;
        let Listening { learner, mut contents, .. } = listening;
        if is_last && !self.options.allow_no_imu && !learner.has_imu() {
            return Err(no_imu(input.path(), learner.sources(), &learner.obstacles()));
        }

        self.messages += inventory.channels().keys().map(|&id| inventory.messages(id)).sum::<u64>();
        contents.add(&Contents::of(&inventory));
        self.contents.push(contents);
        self.done += split.length();
        Ok(inventory)
    }
}

/// Listener to a split.
struct Listening<'l, 'k> {
    learner: &'l mut Learner,
    kept: Option<&'k mut Kept>,
    /// Counts of the annotations.
    contents: Contents,
    verify: bool,
}

impl Listening<'_, '_> {
    /// Keeps the blocks that are ready.
    fn keep(&mut self) -> Result<(), Error> {
        let Self { learner, kept, contents, .. } = self;
        if let Some(failure) = learner.take_failure() {
            return Err(failure);
        }
        let blocks: Vec<_> = learner.take_blocks().collect();
        blocks.iter().try_for_each(|block| {
            contents.count(learner.topics(), block);
            kept.as_mut().map_or(Ok(()), |kept| kept.blocks.push(block))
        })
    }
}

impl Listener for Listening<'_, '_> {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        self.learner.take(event, &mut |_| {});
        self.keep()
    }

    fn indexes(&mut self, chunks: &[u8], reindexed: &[u8]) -> Result<(), Error> {
        self.kept.as_mut().map_or(Ok(()), |kept| kept.indexes.push(chunks, reindexed))
    }

    fn verifies(&self) -> bool {
        self.verify
    }

    fn is_useless(&self, channels: &[u16]) -> bool {
        !self.verify && self.learner.is_useless(channels)
    }
}
