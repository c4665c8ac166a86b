//! Writing of findings: the recording followed by its annotations, or the annotations alone. [`Fold`] and [`Sidecar`]
//! make the bytes, [`Output`] is their destination.

use std::collections::BTreeMap;
use std::path::Path;

use crate::Error;
use crate::record::{Block, Fold, Inventory, Piece, Sidecar, Tail, Topic};
use crate::run::input::recording::{Recording, Watch};
use crate::run::output::file::Output;
use crate::run::output::spill::Spill;

/// A split that has been read, with the annotations to write behind it.
pub(super) struct ReadSplit<'a> {
    pub(super) output: Output,
    pub(super) split: &'a Recording,
    pub(super) inventory: Inventory,
    pub(super) kept: Kept,
}

/// Source of the blocks to write, one after the other.
pub(super) type NextBlock<'a> = &'a mut dyn FnMut() -> Result<Option<Block>, Error>;

impl ReadSplit<'_> {
    pub(super) fn write(
        self,
        settings: &BTreeMap<String, String>,
        topics: &[Topic],
        watch: Watch<'_>,
    ) -> Result<Output, Error> {
        let Self { mut output, split, inventory, kept: Kept { mut blocks, indexes } } = self;
        let mut next = blocks.next();
        write_annotated(&mut output, split, inventory, settings, topics, (&mut next, indexes), watch)?;
        Ok(output)
    }
}

/// Writes a recording followed by annotations.
pub(super) fn write_annotated(
    output: &mut Output,
    recording: &Recording,
    inventory: Inventory,
    settings: &BTreeMap<String, String>,
    topics: &[Topic],
    (next, mut indexes): (NextBlock<'_>, Indexes),
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
    while let Some(block) = next()? {
        watch(recording.length())?;
        output.put(&fold.block(topics, &block).map_err(refused)?, recording)?;
        indexes.chunks.push(&fold.take_indexes())?;
    }
    indexes.reindexed.rewind()?;
    while let Some(taken) = indexes.reindexed.next_item()? {
        watch(recording.length())?;
        fold.reindex(&taken).iter().try_for_each(|piece| output.put(piece, recording))?;
        indexes.chunks.push(&fold.take_indexes())?;
    }
    output.close(fold.close(), indexes.chunks, recording)
}

/// Writes the annotations alone.
pub(super) fn write_sidecar(
    output: &mut Output,
    recording: &Recording,
    profile: &str,
    settings: &BTreeMap<String, String>,
    topics: &[Topic],
    mut blocks: Blocks,
) -> Result<(), Error> {
    let refused = |e: crate::record::Error| Error::input(recording.path(), e.to_string());
    let (mut sidecar, head) = Sidecar::open(profile, settings);
    output.put(&Piece::Bytes(head), recording)?;
    let mut indexes = Spill::beside(output.path());
    let mut next = blocks.next();
    while let Some(block) = next()? {
        let bytes = sidecar.block(topics, &block).map_err(refused)?;
        output.put(&Piece::Bytes(bytes), recording)?;
        indexes.push(&sidecar.take_indexes())?;
    }
    output.close(sidecar.close(), indexes, recording)
}

/// Tail behind the prefix: usually the summary, in a damaged recording everything behind the damage.
fn tail(recording: &Recording, prefix: u64, watch: Watch<'_>) -> Result<Tail, Error> {
    let length = recording.length().saturating_sub(prefix);
    let mut crc = crc32fast::Hasher::new();
    recording.read(prefix..recording.length(), watch, |bytes| crc.update(bytes))?;
    Ok(Tail { length, crc: crc.finalize() })
}

/// Data to write behind the recording, kept until all of that has been read.
pub(super) struct Kept {
    pub(super) blocks: Blocks,
    pub(super) indexes: Indexes,
}

impl Kept {
    pub(super) fn beside(output: &Path) -> Self {
        Self { blocks: Blocks(Spill::beside(output)), indexes: Indexes::beside(output) }
    }
}

/// Spilled annotation blocks.
pub(super) struct Blocks(Spill);

impl Blocks {
    pub(super) fn push(&mut self, block: &Block) -> Result<(), Error> {
        let mut bytes = Vec::new();
        block.write(&mut bytes);
        self.0.push_item(&bytes)
    }

    /// All blocks, from the first on.
    fn next(&mut self) -> impl FnMut() -> Result<Option<Block>, Error> + '_ {
        let mut begun = false;
        move || {
            if !std::mem::replace(&mut begun, true) {
                self.0.rewind()?;
            }
            Ok(self.0.next_item()?.and_then(|bytes| Block::read(&bytes)))
        }
    }
}

/// Indexes to write again behind the annotations.
pub(crate) struct Indexes {
    /// Chunk indexes.
    chunks: Spill,
    /// Chunks with damaged message indexes.
    reindexed: Spill,
}

impl Indexes {
    pub(crate) fn beside(output: &Path) -> Self {
        Self { chunks: Spill::beside(output), reindexed: Spill::beside(output) }
    }

    /// Takes chunk indexes of a scan, and chunks with damaged message indexes.
    pub(crate) fn push(&mut self, chunks: &[u8], reindexed: &[u8]) -> Result<(), Error> {
        self.chunks.push(chunks)?;
        if reindexed.is_empty() { Ok(()) } else { self.reindexed.push_item(reindexed) }
    }
}
