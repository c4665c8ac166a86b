//! Fit of the gyroscope's sensitivity, and of the accelerometer's cross-axis sensitivities, to turns between rests.
//!
//! At both ends of a turn the accelerometer shows the direction of gravity, and in between the gyroscope shows the
//! rotation of the frame: two equations a turn. A tilt and a cross-axis sensitivity of the accelerometer look alike at
//! rest but not while turning, so both sensors are fitted together (gyroscopes alone: Tedaldi, Pretto & Menegatti, "A
//! robust and easy to implement method for IMU calibration without external equipments", ICRA 2014).
//!
//! Weighted Gauss–Newton about the entries of C = S⁻¹ of the gyroscope, and the bias and lower-triangular S of the
//! accelerometer. Neighbouring turns share the errors of the rest between them. The assumed part of the errors is
//! scaled down, or an error common to all turns is added, until χ² equals its degrees of freedom (Paule & Mandel 1982).

mod bias_courses;
mod equations;
mod g_sensitivity;
mod information;
mod inverse_errors;
mod session;
mod solution;
mod too_little;
mod turn_estimate;
mod vertical_equation;
mod vertical_scale;

use nalgebra::Matrix3;

pub(in crate::fit) use self::bias_courses::BiasAtRest;
pub use self::bias_courses::BiasCourses;
use self::equations::Given;
pub use self::g_sensitivity::GSensitivity;
pub use self::information::{OffDiagonals, Told};
pub use self::session::{RestSeen, TurnSeen, TurnSession};
use self::solution::TurnSolution;
use self::too_little::LEAST_TURNS;
pub use self::too_little::TooLittle;
pub use self::turn_estimate::TurnEstimate;
pub use self::vertical_scale::{VerticalScale, vertical_scales};
use super::estimate::Estimate;

/// Fewest turns that are compared with the rests at their ends.
const LEAST_COMPARED: usize = 3;

/// Least angle by which a turn rotates gravity, rad.
const TURNED: f64 = std::f64::consts::FRAC_PI_6;

/// Result of a fit to turns.
#[derive(Clone, Debug)]
pub struct TurnFit {
    /// Estimate, or the reason why the turns do not determine the gyroscope's S.
    pub estimate: Result<TurnEstimate, TooLittle>,
    /// Equations of the turns on a bias that changes; `None` with too few of them.
    pub bias_courses: Option<BiasCourses>,
}

/// Fits the turns, given an accelerometer calibrated at rests whose placements scatter by `placement_std` (m/s²).
pub fn fit(session: &TurnSession, accelerometer: &Estimate, placement_std: f64) -> TurnFit {
    match solve(session, accelerometer, placement_std) {
        Ok(fit) => fit,
        Err(why) => TurnFit { estimate: Err(why), bias_courses: None },
    }
}

fn solve(session: &TurnSession, accelerometer: &Estimate, placement_std: f64) -> Result<TurnFit, TooLittle> {
    let given = Given::of(accelerometer, placement_std).ok_or(TooLittle::Unsolved)?;
    let calibration = accelerometer.calibration();
    let turned = session.turns.iter().filter(|turn| {
        let [before, after] = session.ups(turn, &calibration);
        libm::atan2(before.cross(&after).norm(), before.dot(&after)) >= TURNED
    });
    let turned = turned.count();
    let too_few = (turned < LEAST_TURNS).then(|| match session.turns.len() {
        all if all >= LEAST_TURNS => {
            TooLittle::AboutVertical { turned, all, declared: session.turns.iter().any(|turn| turn.known.is_some()) }
        }
        _ => TooLittle::Few { turned },
    });
    if let Some(too_few) = too_few.clone().filter(|_| turned < LEAST_COMPARED) {
        return Err(too_few);
    }
    let g_sensitivity = GSensitivity::of(session, &calibration);
    let by_up = g_sensitivity.as_ref().map_or(Matrix3::zeros(), |g| g.by_up);
    let everything = vec![true; session.turns.len()];
    let mut all = TurnSolution::of(session, &given, by_up, &everything)?;
    let bias_courses = BiasCourses::of(&all, session);
    if let Some(too_few) = too_few {
        return Ok(TurnFit { estimate: Err(too_few), bias_courses });
    }
    let mut kept = everything;
    let left_out = all.contradicting();
    if let Some(wrong) = left_out {
        kept[wrong] = false;
        all = TurnSolution::of(session, &given, by_up, &kept)?;
    }
    Ok(TurnFit { estimate: all.summarise(&kept, left_out, g_sensitivity), bias_courses })
}
