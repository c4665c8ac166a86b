//! Recordings on disk: the input as the user names it, its files, and reading them.

pub(crate) mod growing_file;
mod prefetch;
pub(crate) mod recording;
pub(crate) mod regular;
pub(crate) mod rosbag2;
pub(crate) mod scan_file;
pub(crate) mod source;
mod spans;
pub(crate) mod splits;

pub use recording::Watch;
pub use regular::text;
pub use scan_file::Listener;
pub use splits::{Input, Made, made};
