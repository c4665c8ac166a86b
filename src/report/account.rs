//! An earlier calibration held to account: whether the readings at the rests of this recording are as it predicts.
//!
//! At rest ‖S⁻¹(m − b)‖ is g and the rate is zero, whatever the pose. The errors of the earlier calibration, of gravity and
//! of what its model leaves out are common to all rests; noise and the scatter of placements are not. Two tests share the
//! rate of false alarms: χ² of all placements together, under their common covariance, and the worst single reading
//! (Bonferroni). Where the scatter was estimated from few placements, F and Student's t take the place of χ² and the
//! normal distribution.

mod residuals;
mod seen;
mod site;
mod text;
mod verdict;

pub use self::text::verdict_text;
pub use self::verdict::{Account, Outcome, SHIFTED, SUSPICIOUS, Verdict, Worst, account};
