//! Status of each triad: confirmed only if any one wrong placement would show, and none does.

use super::fault::{Fault, FaultKind};
use super::solution::Solution;
use crate::fit::{Estimate, Parameterisation};
use crate::imu::Sensor;
use crate::messages::triad::Status;

/// Reason why an estimate is not confirmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unconfirmed {
    /// No estimate.
    Undetermined,
    /// Contradicting placements, without evidence which one is wrong.
    Doubted,
    /// Drifting readings.
    Drifting,
    /// Bias that was taken to one temperature.
    Warmed,
    /// Parameter held back by a bound.
    AtBound,
    /// Placement that nothing else checks.
    Unchecked,
    /// Placements that differ by more than their scatter.
    Disagreeing,
    /// Gyroscope that turned in some rests, or had too few placements.
    Turning,
    /// Gyroscope whose unit is not confirmed.
    Unit,
    /// Gyroscope whose rates do not explain how gravity turned, or only with other axes.
    Contradicted,
}

/// Confirms the primary accelerometer, or returns the reason why not.
pub(super) fn accelerometer(solution: &Solution) -> Result<(), Unconfirmed> {
    let Ok(fit) = &solution.accelerometer else { return Err(Unconfirmed::Undetermined) };
    if !solution.doubts.is_empty() || solution.faults.iter().any(Fault::doubts) {
        return Err(Unconfirmed::Doubted);
    }
    if solution.drift.as_ref().is_some_and(|drift| !drift.followed) {
        return Err(Unconfirmed::Drifting);
    }
    // Placements show the bias along the vertical only, each at its own temperature: a wrong one may pass for warmth.
    if solution.temperature.as_ref().is_some_and(|courses| courses.accelerometer.is_ok()) {
        return Err(Unconfirmed::Warmed);
    }
    estimate(fit)
}

/// Confirms a secondary accelerometer: it is no more certain than the primary that it was compared with.
pub(super) fn secondary(solution: &Solution, fit: &Estimate) -> Result<(), Unconfirmed> {
    accelerometer(solution).and_then(|()| estimate(fit))
}

/// Confirms the gyroscope: a turn at a constant rate passes for a bias, unless the sensor was placed anew in between.
pub(super) fn gyroscope(solution: &Solution, fit: &Estimate) -> Result<(), Unconfirmed> {
    /// Fewest placements.
    const FEW: usize = 4;
    let beside_reference = fit.shape == Parameterisation::FULL_GYROSCOPE;
    if !beside_reference && (solution.gyro_placements < FEW || solution.gyro_turned > 0 || !solution.gyro_posed) {
        return Err(Unconfirmed::Turning);
    }
    let of_it = |kind| solution.faults.iter().any(|fault| fault.sensor == Sensor::Gyroscope && fault.kind == kind);
    // What casts doubt on the rests does so for both triads.
    if solution.faults.iter().any(Fault::doubts) {
        return Err(Unconfirmed::Doubted);
    }
    if of_it(FaultKind::Disagreeing) || of_it(FaultKind::Flipped) {
        return Err(Unconfirmed::Contradicted);
    }
    // A bias alone does not depend on the clock.
    let has_scale = solution.gyroscope.as_ref().is_some_and(|published| published.shape != Parameterisation::BIAS);
    if of_it(FaultKind::Drifting) || of_it(FaultKind::Clock) && has_scale {
        return Err(Unconfirmed::Drifting);
    }
    if !beside_reference && !solution.unit_confirmed {
        return Err(Unconfirmed::Unit);
    }
    estimate(fit)
}

/// Confirms an estimate by itself.
fn estimate(fit: &Estimate) -> Result<(), Unconfirmed> {
    if !fit.active.is_empty() {
        return Err(Unconfirmed::AtBound);
    }
    match &fit.reliability {
        // Beside a reference every sample checks the others.
        None if fit.chi2_per_dof.is_some_and(|chi2| chi2 <= agreement(fit.freedom)) => Ok(()),
        None => Err(Unconfirmed::Disagreeing),
        Some(reliability) if !reliability.is_checked() => Err(Unconfirmed::Unchecked),
        Some(reliability) if !reliability.confirms() => Err(Unconfirmed::Disagreeing),
        Some(_) => Ok(()),
    }
}

pub(super) fn message(confirmed: Result<(), Unconfirmed>) -> Status {
    match confirmed {
        Ok(()) => Status::Confirmed,
        Err(Unconfirmed::Undetermined) => Status::Undetermined,
        Err(_) => Status::Provisional,
    }
}

/// Value of χ² over its degrees of freedom that is exceeded by chance once in a thousand times (Wilson and Hilferty
/// 1931).
fn agreement(freedom: f64) -> f64 {
    const NORMAL: f64 = 3.09;
    let v = 2.0 / (9.0 * freedom.max(1.0));
    libm::pow(1.0 - v + NORMAL * v.sqrt(), 3.0)
}
