//! Reports of findings, for people and for programs: findings, reports, and file formats of other programs.
//!
//! Pure like the layers beneath: text and numbers in, text out. The [shell](crate::run) handles files, the program
//! writes to the terminal.

mod account;
mod calendar;
mod course;
mod cross_terms;
mod drift;
mod earlier;
mod envelope;
mod export;
mod findings;
mod import;
mod json;
mod layout;
mod near_miss;
mod numbers;
mod page;
mod parameters;
mod plot;
mod span_means;
mod timeline;
mod words;
pub(crate) mod yaml;

pub use account::{Account, Outcome, SHIFTED, SUSPICIOUS, Verdict, Worst, account, verdict_text};
pub use calendar::{day, moment};
pub use course::{Course, Curve, Jump};
pub use cross_terms::{CrossTerm, cross_terms, direction};
pub use drift::{Change, Drift, drift};
pub use earlier::{Counterpart, Earlier};
pub use envelope::{Envelope, Range};
pub use export::{Axes, ExportError, Exported, Format, Options, RandomWalk, Readings, export};
pub use findings::Findings;
pub use import::{ImportError, import};
pub use json::{coverage, drifts, imus, rests, triad};
pub use layout::{LayoutImu, layout, quoted};
pub use near_miss::{NearMiss, NearMisses};
pub use numbers::{calibration, length, nanos, seconds};
pub(crate) use numbers::{matrix, row_major, vector};
pub use page::Page;
pub use parameters::Parameters;
pub use timeline::Timeline;
pub use words::{Weight, estimate, model, weight};
