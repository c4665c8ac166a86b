//! Annotations alone, as a recording of their own that viewers show on the original's timeline.
//! Writing the bytes is left to the shell.

use std::collections::BTreeMap;

use mcap::MAGIC;
use serde::{Deserialize, Serialize};

use super::emitter::{Emitter, Manner, Taken};
use super::fold::{library, write_settings};
use super::records::Header;
use super::summary::Summary;
use super::{Block, Error, Piece, Topic};

/// Writes a sidecar: the bytes of [`Sidecar::open`], of each [`Sidecar::block`], and the pieces of [`Sidecar::close`].
///
/// What has been written is whole at any time up to the last block, so that a growing sidecar can be followed; the
/// state can be saved and taken up again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sidecar {
    emitter: Emitter,
}

impl Sidecar {
    /// Begins: header and metadata. The profile is the original's, the settings are what determines the annotations.
    pub fn open(profile: &str, settings: &BTreeMap<String, String>) -> (Self, Vec<u8>) {
        let mut out = MAGIC.to_vec();
        Header { profile: profile.to_owned(), library: library() }.write(&mut out);
        let mut emitter = Emitter::new(0, Some(0), Summary::default(), Manner::Indexed, Taken::default());
        emitter.pass(&out);
        write_settings(&mut emitter, settings, &mut out);
        (Self { emitter }, out)
    }

    /// The bytes that hold a block. Topics that are new to the list come at its end.
    ///
    /// # Errors
    /// If an annotation's topic is not in the list, if ids run out, or if compression fails.
    pub fn block(&mut self, topics: &[Topic], block: &Block) -> Result<Vec<u8>, Error> {
        self.emitter.block(topics, block)
    }

    /// Hands over the chunk indexes since the last time, to be given back in the place of [`Piece::Indexes`].
    pub fn take_indexes(&mut self) -> Vec<u8> {
        self.emitter.summary.take_indexes()
    }

    /// The last pieces: the end of the data, the summary, the footer.
    pub fn close(self) -> Vec<Piece> {
        self.emitter.close()
    }
}
