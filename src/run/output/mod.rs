//! Results on disk: files that appear when they are complete, and sidecars that grow.

pub(crate) mod file;
pub(crate) mod folder;
pub(crate) mod in_place;
pub(crate) mod names;
pub(crate) mod options;
pub(crate) mod partial;
pub(crate) mod reads;
pub(crate) mod set;
pub(crate) mod sidecar_file;
pub(crate) mod spill;
pub(crate) mod written;

pub use in_place::{Access, take_back};
pub use names::default_output;
pub use partial::Partial;
pub use reads::Reads;
pub use written::Written;
