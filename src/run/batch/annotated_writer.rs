//! What has been read and learned, written: the recording with its annotations behind it, or these alone.
//! What is written is left to [`Fold`] and [`Sidecar`], and where to [`Output`].

use std::collections::BTreeMap;
use std::path::Path;

use crate::Error;
use crate::record::{Block, Fold, Inventory, Piece, Sidecar, Tail, Topic};
use crate::run::input::recording::{Recording, Watch};
use crate::run::output::file::Output;
use crate::run::output::spill::Spill;

/// A split that has been read, and what is to be written behind it.
pub(super) struct Draft<'a> {
    pub(super) output: Output,
    pub(super) split: &'a Recording,
    pub(super) inventory: Inventory,
    pub(super) kept: Kept,
}

impl Draft<'_> {
    pub(super) fn write(
        self,
        settings: &BTreeMap<String, String>,
        topics: &[Topic],
        watch: Watch<'_>,
    ) -> Result<Output, Error> {
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

/// Writes annotations alone.
pub(super) fn write_sidecar(
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
    let mut indexes = Spill::beside(output.path());
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

/// What is written behind the recording, until all of that has been read.
pub(super) struct Kept {
    /// The annotations.
    blocks: Spill,
    /// The chunk indexes.
    pub(super) indexes: Spill,
    /// Chunks whose message indexes are damaged.
    pub(super) reindexed: Spill,
}

impl Kept {
    pub(super) fn beside(output: &Path) -> Self {
        let spill = || Spill::beside(output);
        Self { blocks: spill(), indexes: spill(), reindexed: spill() }
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
