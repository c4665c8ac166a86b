//! The shell: files, threads and signals live here and nowhere else.
//!
//! What the bytes mean is left to the layers beneath, which know none of these.

mod ahead;
mod batch;
mod channels;
mod glance;
mod in_place;
mod learn;
mod output;
mod partial;
mod read_back;
mod recording;
mod spill;
mod stop;
mod story;
mod strip;

pub use batch::{Form, Options, Report, annotate, calibrate};
pub use channels::{Channels, Use, channels};
pub use in_place::Access;
pub use output::Written;
pub use partial::Partial;
pub use read_back::findings;
pub use recording::{Listener, Recording, Watch};
pub use stop::Stop;
pub use story::{Stories, stories};
pub use strip::strip;
