//! Reference of true specific force and angular rate, and the estimates of an IMU's triads beside it.

use serde::{Deserialize, Serialize};

use super::refusal::Refusal;
use crate::fit::{self, Estimate, NormalEquations, Parameterisation, TimeInterpolation, Truth, limits};
use crate::imu::{Quantity, Sample, Sensor};

/// Triads beside a reference.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Reference {
    interpolation: TimeInterpolation,
    accelerometer: NormalEquations,
    gyroscope: NormalEquations,
}

/// Largest residual rms from noise and interpolation if the noise floor is unknown, m/s² and rad/s.
const ALLOWANCE: [f64; 2] = [0.05, 0.01];
/// Largest residual rms in motion, in units of an axis' noise at rest.
const OF_FLOOR: f64 = 3.0;

impl Reference {
    /// Creates a reference whose samples are not interpolated across steps longer than `gap_s`, s.
    pub(super) fn new(gap_s: f64) -> Self {
        Self {
            interpolation: TimeInterpolation::new(gap_s),
            accelerometer: NormalEquations::default(),
            gyroscope: NormalEquations::default(),
        }
    }

    pub(super) fn push(&mut self, sensor: Sensor, Sample { stamp, value, .. }: &Sample) {
        let Self { interpolation, accelerometer, gyroscope } = self;
        let quantity = match sensor {
            Sensor::Accelerometer => return interpolation.reading(0, *stamp, *value),
            Sensor::Gyroscope => return interpolation.reading(1, *stamp, *value),
            Sensor::Secondary(_) => return,
            Sensor::Reference(Quantity::Force) => 0,
            Sensor::Reference(Quantity::Rate) => 1,
        };
        interpolation.reference(quantity, *stamp, *value, &mut |triad, measured, [force, rate]| match triad {
            0 => accelerometer.push(&measured, &Truth { own: force, other: rate }),
            _ => gyroscope.push(&measured, &Truth { own: rate, other: force }),
        });
    }

    /// Drops the readings of a triad so far, or the reference for them.
    pub(super) fn forget(&mut self, sensor: Sensor) {
        if matches!(sensor, Sensor::Accelerometer | Sensor::Reference(_)) {
            self.accelerometer = NormalEquations::default();
        }
        if matches!(sensor, Sensor::Gyroscope | Sensor::Reference(_)) {
            self.gyroscope = NormalEquations::default();
        }
    }

    /// Estimate of the accelerometer, or the reason why not. `floor` is the noise of its axes at rest, if known, m/s².
    pub(super) fn accelerometer(
        &self,
        shape: Parameterisation,
        config: &fit::Config,
        floor: Option<f64>,
    ) -> Result<Estimate, Refusal> {
        let limits = limits(shape, |term| config.bounds.accelerometer(term));
        let most = ALLOWANCE[0].max(OF_FLOOR * floor.unwrap_or(0.0));
        explained(&self.accelerometer, self.accelerometer.solve(shape, &limits, most), "m/s²")
    }

    /// Estimate of the gyroscope, or the reason why not. `floor` is the noise of its axes at rest, if known, rad/s.
    pub(super) fn gyroscope(
        &self,
        shape: Parameterisation,
        config: &fit::Config,
        floor: Option<f64>,
    ) -> Result<Estimate, Refusal> {
        let limits = limits(shape, |term| config.bounds.gyroscope(term));
        let most = ALLOWANCE[1].max(OF_FLOOR * floor.unwrap_or(0.0));
        explained(&self.gyroscope, self.gyroscope.solve(shape, &limits, most), "rad/s")
    }
}

fn explained(
    sums: &NormalEquations,
    found: Result<Estimate, fit::Error>,
    unit: &'static str,
) -> Result<Estimate, Refusal> {
    if sums.samples() == 0 {
        return Err(Refusal::NoReference);
    }
    match found {
        Err(fit::Error::Singular(_)) => Err(Refusal::TooLittleMotion),
        Err(error) => Err(error.into()),
        Ok(fit) if !fit.agrees() => {
            Err(Refusal::ReferenceContradicts { rms: fit.residual_rms, limit: fit.residual_limit, unit })
        }
        Ok(fit) => Ok(fit),
    }
}
