//! The shell: files, threads and signals live here and nowhere else. The layers beneath interpret the bytes.

mod batch;
mod gather;
mod input;
mod inspect;
mod limits;
#[cfg(feature = "live")]
mod live;
mod output;
mod prefix;
mod runtime;
mod stop;
mod store;
mod tail;
mod watch;

pub use crate::pipeline::{Ending, Notice, Notify, Progress};
pub use batch::{EarlierResult, Form, Options, Report, annotate, calibrate, finished};
pub use gather::{Gathered, SensorKey, gather};
pub use input::{Input, Listener, Made, Watch, made, text};
pub use inspect::{Channels, Found, ReportData, Use, channels, findings, report_data, strip};
pub use limits::{allow_many_files, outlive_file_size_limit};
#[cfg(feature = "live")]
pub use live::{Live, Session, Viewers};
pub use output::{Access, Partial, Reads, Written, default_output, take_back};
pub use prefix::{folders_below, is_sidecar_name, recordings_under, results_under, under};
pub use runtime::runtime;
pub use stop::Stop;
pub use store::{is_prefix, is_url, put_text};
pub use tail::{Following, Tailed, sidecar_of, tail};
pub use watch::{Metrics, Show, Verdict, Watching, WatchingPrefix, serve, watch, watch_prefix};
