//! A reference that knows what there was to read, and what that says of an IMU's triads. Aligning and summing up is left to
//! [`fit`](crate::fit).

use serde::{Deserialize, Serialize};

use super::refusal::Refusal;
use crate::fit::{self, Estimate, NormalEquations, Parameterisation, TimeInterpolation, Truth, limits};
use crate::imu::{Quantity, Sample, Sensor};

/// The triads beside a reference.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Reference {
    alignment: TimeInterpolation,
    accelerometer: NormalEquations,
    gyroscope: NormalEquations,
}

/// What noise and interpolation may leave over where the noise floor is unknown, in m/s² and rad/s.
const ALLOWANCE: [f64; 2] = [0.05, 0.01];
/// Of an axis' noise at rest, what may be left over in motion.
const OF_FLOOR: f64 = 3.0;

impl Reference {
    /// Steps of the reference longer than `gap_s` are not bridged.
    pub(super) fn new(gap_s: f64) -> Self {
        Self {
            alignment: TimeInterpolation::new(gap_s),
            accelerometer: NormalEquations::default(),
            gyroscope: NormalEquations::default(),
        }
    }

    pub(super) fn push(&mut self, sensor: Sensor, Sample { stamp, value, .. }: &Sample) {
        let Self { alignment, accelerometer, gyroscope } = self;
        let quantity = match sensor {
            Sensor::Accelerometer => return alignment.reading(0, *stamp, *value),
            Sensor::Gyroscope => return alignment.reading(1, *stamp, *value),
            Sensor::Secondary(_) => return,
            Sensor::Reference(Quantity::Force) => 0,
            Sensor::Reference(Quantity::Rate) => 1,
        };
        alignment.reference(quantity, *stamp, *value, &mut |triad, measured, [force, rate]| match triad {
            0 => accelerometer.push(&measured, &Truth { own: force, other: rate }),
            _ => gyroscope.push(&measured, &Truth { own: rate, other: force }),
        });
    }

    /// What a triad read so far, or what it was held against, no longer counts.
    pub(super) fn forget(&mut self, sensor: Sensor) {
        if matches!(sensor, Sensor::Accelerometer | Sensor::Reference(_)) {
            self.accelerometer = NormalEquations::default();
        }
        if matches!(sensor, Sensor::Gyroscope | Sensor::Reference(_)) {
            self.gyroscope = NormalEquations::default();
        }
    }

    /// The accelerometer, whose axes have a noise of `floor` at rest as far as that is known (m/s²); or why not.
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

    /// The gyroscope, whose axes have a noise of `floor` at rest as far as that is known (rad/s); or why not.
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
