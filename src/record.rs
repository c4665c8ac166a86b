//! MCAP bytes: recordings in, recordings out. Only [`imu`](crate::imu) and [`annotate`](crate::annotate)
//! know what a message means.

mod annotations;
mod chunk;
mod chunk_check;
mod chunks;
mod closing_summary;
mod emitter;
mod error;
mod fold;
mod footer;
mod frame_window;
mod inventory;
mod limits;
mod marks;
mod piece;
mod places;
mod plausibility;
mod provenance;
mod records;
mod reindex;
mod scan;
mod sidecar;
mod summary;
mod types;
mod walk;
mod wire;

pub use annotations::{Annotation, Block, Topic};
pub use chunk::{Opened, Opener};
pub use chunks::{Chunk, Chunks};
pub use closing_summary::ClosingSummary;
pub use error::Error;
pub use fold::{Fold, Tail};
pub use footer::{CLOSING, is_closing};
pub use inventory::Inventory;
pub use limits::Limits;
pub use piece::Piece;
pub use places::Places;
pub use provenance::{FileKind, Original, recognise, recognise_scanned};
pub use scan::{Damage, Event, Position, Scan, Supply};
pub use sidecar::{Sidecar, SidecarBlocks};
pub use types::{Channel, Message, Schema};
pub use walk::ReadAt;
pub use wire::{START, is_beginning};
