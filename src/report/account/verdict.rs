//! Verdict on an earlier calibration, with the rates of false alarms that it is built for.

use nalgebra::DVector;

use super::residuals::{Residuals, of_accelerometer, of_gyroscope};
use super::seen::{Seen, seen};
use super::site::Site;
use crate::fit::{fisher_beyond, student_beyond};
use crate::messages::Triad;
use crate::messages::triad::Status;
use crate::report::{Earlier, Findings};

/// Rates of false alarms that the verdicts are built for: shares of the recordings of a sensor that did not move.
pub const SUSPICIOUS: f64 = 1e-2;
/// The rate of [`Verdict::Shifted`].
pub const SHIFTED: f64 = 1e-4;

/// Verdict on an earlier calibration of a triad.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The readings are as it predicts.
    Inside,
    /// So far off by chance in one of 100 recordings.
    Suspicious,
    /// So far off by chance in one of 10,000 recordings.
    Shifted,
}

impl Verdict {
    /// Name in texts and documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inside => "inside",
            Self::Suspicious => "suspicious",
            Self::Shifted => "shifted",
        }
    }
}

/// Earlier calibration of a triad, held against the rests of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Account {
    /// "accelerometer" or "gyroscope".
    pub sensor: String,
    /// Verdict, or the reason why there is none.
    pub outcome: Result<Outcome, &'static str>,
}

/// Distance of the readings from what was predicted.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The verdict.
    pub verdict: Verdict,
    /// Share of recordings in which a sensor that did not move would be so far off.
    pub chance: f64,
    /// Number of placements.
    pub placements: usize,
    /// χ² of all readings over their number.
    pub chi2_per_dof: f64,
    /// The reading that is furthest off.
    pub worst: Worst,
    /// Whether the earlier calibration states its uncertainty; otherwise it counts as exact.
    pub states_uncertainty: bool,
}

/// Reading that is furthest from what was predicted, in standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct Worst {
    /// Start of its rest, ns.
    pub start: i64,
    /// Face that it lay on, if on any.
    pub face: String,
    /// Axis of the gyroscope; of an accelerometer ‖a‖ counts.
    pub axis: Option<usize>,
    /// By how much it is off, m/s² or rad/s, and the standard deviation of that.
    pub off: f64,
    /// Standard deviation of what was predicted.
    pub std: f64,
}

/// Holds the earlier calibration of an IMU's accelerometer and gyroscope to account.
///
/// # Errors
///
/// If the earlier calibration has none that is this one.
pub fn account(now: &Findings, earlier: &Earlier<'_>) -> Result<Vec<Account>, String> {
    let then = earlier.of(&now.name, &now.topic)?.findings;
    let Some(then) = &then.calibration else { return Ok(Vec::new()) };
    let seen = seen(now);
    let site = Site::of(now.calibration.as_ref(), then);
    let believed = |triad: &Option<Triad>| triad.clone().filter(|triad| triad.status() != Status::Undetermined);
    let accelerometer = believed(&then.accelerometer);
    let mut accounts = Vec::new();
    if let Some(triad) = &accelerometer {
        let residuals = of_accelerometer(triad, then.placements, &seen, &site);
        accounts.push(Account { sensor: "accelerometer".to_owned(), outcome: outcome(residuals, &seen) });
    }
    if let Some(triad) = believed(&then.gyroscope) {
        let residuals = of_gyroscope(&triad, accelerometer.as_ref(), then.placements, &seen);
        accounts.push(Account { sensor: "gyroscope".to_owned(), outcome: outcome(residuals, &seen) });
    }
    Ok(accounts)
}

fn outcome(residuals: Result<Residuals, &'static str>, seen: &[Seen]) -> Result<Outcome, &'static str> {
    let residuals = residuals?;
    let count = residuals.values.len();
    let (squares, variances) = residuals.tested().ok_or("its uncertainty contradicts itself")?;
    let chi2_per_dof = squares / count as f64;
    // The share of all variance that was estimated has so many degrees of freedom (Satterthwaite).
    let shares = residuals.estimated.component_div(&variances);
    let freedom = |share: f64| residuals.freedom / share.clamp(1e-3, 1.0).powi(2);
    let together = fisher_beyond(chi2_per_dof, count as f64, freedom(shares.mean()));
    let score = DVector::from_fn(count, |i, _| residuals.values[i].abs() / variances[i].sqrt());
    let worst = score.imax();
    let alone = student_beyond(score[worst], freedom(shares[worst])) * count as f64;
    let chance = if count == 1 { alone } else { 2.0 * together.min(alone) }.min(1.0);
    let verdict = match chance {
        chance if chance <= SHIFTED => Verdict::Shifted,
        chance if chance <= SUSPICIOUS => Verdict::Suspicious,
        _ => Verdict::Inside,
    };
    let (place, axis) = residuals.of[worst];
    let rest = seen.get(place).ok_or("no rest shows it")?;
    Ok(Outcome {
        verdict,
        chance,
        placements: residuals.placements,
        chi2_per_dof,
        worst: Worst {
            start: rest.start,
            face: rest.face.clone(),
            axis,
            off: residuals.values[worst],
            std: variances[worst].sqrt(),
        },
        states_uncertainty: residuals.states_uncertainty,
    })
}
