//! Fit of the primary accelerometer without the placements that contradict the others, as found by [`contradiction`].

use nalgebra::DVector;

use super::observations::Placed;
use crate::fit::accelerometer::{Assumptions, Observation};
use crate::fit::outlier_test::contradiction;
use crate::fit::{Error, Estimate, Fixture, accelerometer};

/// Fit with the placements left out of it.
pub(super) struct Sound {
    pub(super) fit: Estimate,
    pub(super) left_out: Vec<LeftOut>,
    pub(super) doubts: Vec<Doubt>,
}

/// Doubt about a placement that was left out: another may be the wrong one.
pub(super) struct Doubt {
    /// Text for people.
    pub(super) text: String,
    /// Change of the parameters in that case.
    pub(super) moved: DVector<f64>,
}

/// Placement that contradicts the others.
pub(super) struct LeftOut {
    pub(super) placed: Placed,
    pub(super) explanation: String,
}

/// At most one placement in this many is left out: if more contradict each other, the session is bad.
const ONE_IN: usize = 6;
/// Weighted sum of squares below which no single placement can be an outlier.
const NOTHING_STANDS_OUT: f64 = 15.0;

/// Fits the placements in `seen`, and removes from it those that contradict the others.
///
/// # Errors
/// If the placements do not determine the parameters, or the solver fails.
pub(super) fn fit_without(seen: &mut Vec<Placed>, given: &Assumptions<'_>, fixture: &Fixture) -> Result<Sound, Error> {
    let most = seen.len() / ONE_IN;
    let (mut left_out, mut doubts) = (Vec::new(), Vec::new());
    loop {
        let observations: Vec<Observation> = seen.iter().map(|placed| placed.observation).collect();
        let fit = accelerometer::fit(&observations, given)?;
        let squares = fit.chi2_per_dof.unwrap_or(0.0) * fit.freedom;
        // The last placement on a face must stay.
        let is_spare = |i: usize| {
            let face = seen.get(i).map(|placed| placed.face);
            seen.iter().filter(|placed| Some(placed.face) == face).count() > 1
        };
        let found = (left_out.len() < most && squares > NOTHING_STANDS_OUT)
            .then(|| contradiction(&observations, given, &fit, is_spare))
            .flatten();
        // If nothing is left to check the choice, it must be beyond doubt.
        let checked = observations.len() > given.shape.unknowns() + 1;
        let Some(found) = found.filter(|found| found.rival.is_none() || checked) else {
            return Ok(Sound { fit, left_out, doubts });
        };
        let wrong = seen.remove(found.index);
        let face = fixture.faces().get(wrong.face).map_or("?", |face| face.name.as_str());
        let mut explanation = format!(
            "nearest to {face}, ‖a‖ is {:+.2} m/s² off g by what the other {} placements say (excused is {:.2}): was it touched, or \
             the table moved? Left out",
            found.off,
            seen.len(),
            found.limit
        );
        if let Some(rival) = found.rival {
            explanation += "; it might be another rest that is wrong, which the bars allow for";
            let text = format!(
                "two rests near {face} differ by {:.3} m/s², and which of them is wrong is not beyond doubt: place {face} up once more",
                found.off.abs()
            );
            doubts.push(Doubt { text, moved: rival.moved });
        }
        left_out.push(LeftOut { placed: wrong, explanation });
    }
}
