//! Outcome of the fit to turns between rests.

use crate::Stamp;
use crate::fit::turn_fit::{BiasCourses, TooLittle, TurnEstimate};
use crate::plural::counted;
use crate::turns::Unusable;

/// Outcome of the fit to turns beside an accelerometer: an estimate, or the reason why not.
#[derive(Clone, Debug)]
pub(super) struct TurnOutcome {
    pub(super) found: Result<TurnEstimate, TooLittle>,
    /// Reasons why turns do not count, with their numbers.
    pub(super) unusable: Vec<(Unusable, usize)>,
    /// Start of the first rest, and the equations of the turns on a bias that changes since then, if there are enough.
    pub(super) courses: Option<(Stamp, BiasCourses)>,
    /// Whether the turns made the accelerometer's model triangular, or sharpened it.
    pub(super) completed: bool,
}

impl TurnOutcome {
    /// Equations of the turns on a bias that changes, at times since `first`.
    pub(super) fn bias_courses(&self, first: Stamp) -> Option<BiasCourses> {
        let (start, courses) = self.courses.as_ref()?;
        Some(courses.clone().later(start.seconds_since(first)))
    }

    /// Whether turns reached the end of the range.
    fn is_clipped(&self) -> bool {
        self.unusable.iter().any(|(why, _)| *why == Unusable::Clipped)
    }

    /// Remarks for people.
    pub(super) fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        match &self.found {
            Ok(found) => {
                let rms =
                    (found.residuals.iter().map(|x| x * x).sum::<f64>() / found.residuals.len().max(1) as f64).sqrt();
                remarks.push(format!(
                    "sensitivity from {} turns between rests, which it explains to {:.2}°",
                    found.used,
                    rms.to_degrees()
                ));
                if let Some(turn) = found.left_out {
                    let off = found.residuals.get(turn).copied().unwrap_or(0.0).to_degrees();
                    remarks.push(format!("turn {} contradicts the others by {off:.1}°: left out", turn + 1));
                }
                if !found.redundant {
                    remarks.push("without one of the turns the others would say less: turn it once more".to_owned());
                }
            }
            // Turns that reach the end of the range are told of as a fault: further ones like them would not help.
            Err(_) if self.is_clipped() => {}
            Err(why) => remarks.push(format!("no sensitivity from turns: {why}")),
        }
        for (why, count) in self.unusable.iter().filter(|(why, _)| *why != Unusable::Clipped) {
            remarks.push(format!("{} without use: {why}", counted(*count as u64, "turn")));
        }
        remarks
    }
}
