//! Rotation of the sensor between its rests, from its gyroscope.
//!
//! A turn is rest, motion, rest. The rates are preintegrated (Lupton & Sukkarieh, IEEE T-RO 2012; Forster et al., IEEE
//! T-RO 2017) into [`Piece`]s that depend on neither bias nor sensitivity: both are applied afterwards, to second order
//! of the Magnus expansion (1954), so that every candidate can be tried on the turns of a whole recording without its
//! samples.

mod declared;
mod evidence;
mod heading;
mod history;
mod known_rotation;
mod leg;
mod piece;
mod prediction;
mod preintegrator;
mod range_end;
mod reading;
mod rotation;
mod sample_clock;
mod whole_turn;

pub use declared::{Contradiction, contradiction};
pub use evidence::{Explanation, SeenTurn, angle_between, explain};
pub use heading::{heading_excess, heading_seen, level_axis};
pub use history::{History, Passage};
pub use known_rotation::KnownRotation;
pub use leg::{Leg, Turn, Unusable};
pub use piece::{Candidate, Piece};
pub use prediction::{Ends, Followed, Motion, Prediction, Vertical, follow, motion, predict, vertical};
pub use preintegrator::{Limit, Preintegrator, Stretch};
pub use reading::{AxisOrder, RateScale};
pub use whole_turn::whole_turn;
