//! The Cramér–Rao bound: how small the errors of any unbiased estimator can be that knows the length of gravity, the
//! noise, and which samples were taken at rest, but not how the sensor lay.
//!
//! The unknowns are bias and scale of both accelerometers and, for each rest, two angles of its attitude as nuisance;
//! readings of both are taken together, so what the one says of the attitude helps the other. Every sample truly at rest
//! counts. White noise; where it dithers a coarse converter, rounding adds the variance of a uniform error, step²/12. For
//! exact faces this is σ/√(2N) for the bias of the primary and σ/(g√(2N)) for its scale, N samples a face; the secondary's
//! bias is seen on all six faces, σ/√(6N), since the primary tells how it lay.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use stillpoint::imu::Sensor;
use stillpoint::simulate::{Scenario, Triad, samples};

use super::trial::Quantity;

/// Variances of the twelve parameters.
pub struct Bound(DVector<f64>);

impl Bound {
    /// Of the three axes of a quantity.
    pub fn of(&self, quantity: Quantity) -> impl Iterator<Item = f64> {
        let first = match quantity {
            Quantity::AccelBias => 0,
            Quantity::AccelScale => 3,
            Quantity::SecondaryBias => 6,
            Quantity::SecondaryScale => 9,
            Quantity::GyroBias => unreachable!("no bound is computed"),
        };
        self.0.iter().skip(first).take(3).copied()
    }
}

/// The bound for a session of bias-scale sensors.
pub fn cramer_rao(scenario: &Scenario) -> Bound {
    let mut rests = vec![([0_u32; 2], Vector3::zeros()); scenario.pose.len()];
    for reading in samples(scenario).unwrap() {
        let which = match reading.sensor {
            Sensor::Accelerometer => 0,
            Sensor::Secondary(0) => 1,
            _ => continue,
        };
        if let Some(pose) = reading.pose {
            rests[pose].0[which] += 1;
            rests[pose].1 = reading.force;
        }
    }
    let triads = [&scenario.accelerometer, scenario.secondary.values().next().unwrap()];
    let unknowns = 12 + 2 * rests.len();
    let mut information = DMatrix::<f64>::zeros(unknowns, unknowns);
    for (rest, (counts, force)) in rests.iter().enumerate() {
        for (which, triad) in triads.into_iter().enumerate() {
            let scale: Matrix3<f64> = triad.sensitivity.matrix();
            let mut jacobian = DMatrix::<f64>::zeros(3, unknowns);
            for axis in 0..3 {
                jacobian[(axis, 6 * which + axis)] = 1.0;
                jacobian[(axis, 6 * which + 3 + axis)] = force[axis];
            }
            for (angle, direction) in tangents(force).into_iter().enumerate() {
                jacobian.column_mut(12 + 2 * rest + angle).copy_from(&(scale * direction));
            }
            information += jacobian.tr_mul(&jacobian) * (f64::from(counts[which]) / variance(triad));
        }
    }
    Bound(information.try_inverse().unwrap().diagonal())
}

/// Of one sample.
fn variance(triad: &Triad) -> f64 {
    triad.noise * triad.noise + triad.step * triad.step / 12.0
}

/// How a specific force moves when the attitude turns by a radian about either of two axes across it.
fn tangents(force: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let mut other = Vector3::zeros();
    other[(force.iamax() + 1) % 3] = 1.0;
    let first = force.cross(&other).normalize();
    let second = force.normalize().cross(&first);
    [first * force.norm(), second * force.norm()]
}
