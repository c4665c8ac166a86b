//! What the turns between rests determine, or why they do not.

use crate::fit::turn_fit::{TooLittle, TurnEstimate};
use crate::turns::Unusable;

/// What the turns determine beside an accelerometer, or why not.
#[derive(Clone, Debug)]
pub(super) struct Turning {
    pub(super) found: Result<TurnEstimate, TooLittle>,
    /// How many turns do not count, and why.
    pub(super) unusable: Vec<(Unusable, usize)>,
    /// Whether they made the accelerometer a triangular one.
    pub(super) completed: bool,
}

impl Turning {
    /// In words.
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
            Err(why) => remarks.push(format!("no sensitivity from turns: {why}")),
        }
        for (why, count) in &self.unusable {
            remarks.push(format!("{count} turns do not count: {why}"));
        }
        remarks
    }
}
