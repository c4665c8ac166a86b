//! The shell: files, threads and signals live here and nowhere else.
//!
//! What the bytes mean is left to the layers beneath, which know none of these.

mod ahead;
mod appending;
mod bag;
mod batch;
mod channels;
mod checkpoint;
mod correct;
mod folder;
mod glance;
mod growing;
mod in_place;
mod input;
mod learn;
mod limits;
#[cfg(feature = "live")]
mod live;
mod metrics;
mod news;
mod output;
mod partial;
mod read_back;
mod recording;
mod roster;
mod serve;
mod spill;
mod stop;
mod story;
mod strip;
mod tail;
mod target;
mod watch;

pub use batch::{Form, Options, Report, annotate, calibrate};
pub use channels::{Channels, Use, channels};
pub use in_place::Access;
pub use input::Input;
pub use limits::allow_many_files;
#[cfg(feature = "live")]
pub use live::{Live, Session};
pub use metrics::Metrics;
pub use news::{Ending, News, Progress, Tell};
pub use output::Written;
pub use partial::Partial;
pub use read_back::{Found, findings};
pub use recording::{Listener, Watch};
pub use serve::serve;
pub use stop::Stop;
pub use story::{Stories, stories};
pub use strip::strip;
pub use tail::{Following, Tailed, sidecar_of, tail};
pub use watch::{Show, Verdict, Watching, watch};
