//! What recordings of one sensor say together: rests add up to a calibration that no single one of them determines.
//!
//! [`Merge`] is what a recording says of its sensors, as far as that adds up. It is a commutative monoid, and joining
//! the same recording twice changes nothing: whoever merges in whichever order and grouping comes to the same. Finding rests
//! is left to the [`engine`](crate::engine), and so is the fit over them; what is learned here is how the sensor changed in
//! between.

mod change_points;
mod evidence;
mod history;
mod json;
mod noise_set;
mod outcome;
mod random_walk;
mod rest_set;
mod timeline;

pub use evidence::{Evidence, Identity, Merge};
pub use history::{Change, ChangeKind, Epoch, History, Point};
pub use json::document;
pub use outcome::{Merged, outcome};
pub use rest_set::{MOST_RESTS, PastRest, RestSet};
