//! Stages of a scan, and the steps between them that it emits.

use super::attachments::Attaching;
use super::early_summary::Asking;
use super::emission::Emission;
use super::event::Damage;
use super::message_indexes::ChunkReindexing;
use super::original::Recognising;
use super::search::Search;
use crate::record::frame_window::{Frame, Stop};

/// An event without its data, which stays in place.
pub(super) enum Step {
    Stop(Stop),
    Chunk(Frame),
    Header,
    Schema(u16),
    Channel(u16),
    Message,
    ChunkEnd,
    Damage(Damage),
    End,
}

/// Stage of a scan: what is read next.
#[derive(Default)]
pub(super) enum Stage {
    #[default]
    Magic,
    Recognising(Box<Recognising>),
    Record,
    /// A chunk was offered and waits for the answer.
    Offering(Frame),
    Emission(Emission),
    Attaching(Attaching),
    Asking(Box<Asking>),
    Reindexing(Box<ChunkReindexing>),
    Searching(Search),
    EndMagic,
    Done,
}
