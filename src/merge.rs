//! Combination of recordings of one sensor: rests and turns add up to a calibration that no single recording determines.
//!
//! [`Merge`] is the evidence of recordings on their sensors, in a form that adds up. It is a commutative monoid, and
//! joining the same recording twice changes nothing: any order and grouping of merging gives the same result. The
//! [`engine`](crate::engine) finds rests and turns, and fits them; this layer learns how the sensor changed between recordings.

mod change_points;
mod changes;
mod course;
mod evidence;
mod history;
mod json;
mod noise_set;
mod outcome;
mod past_rest;
mod past_turn;
mod random_walk;
mod remount;
mod thinned_set;
mod timeline;

pub use evidence::{Evidence, Identity, Merge};
pub use history::{Change, ChangeKind, Epoch, History, Point};
pub use json::document;
pub use outcome::{Merged, outcome};
pub use past_rest::{MOST_RESTS, PastRest, RestSet};
pub use past_turn::{PastTurn, TurnSet};
pub use thinned_set::{Member, ThinnedSet};
