//! Course of a bias over the temperature: `bias(T) = bias + Σ cₖ (clip(T) − reference)ᵏ`.

use nalgebra::{DMatrix, DVector, Vector3};
use serde::{Deserialize, Serialize};

use crate::messages::TemperatureModel;

/// Course of a bias over the temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BiasCourse {
    /// Temperature at which the bias is that of the triad, °C.
    pub reference: f64,
    /// Lowest and highest temperature seen, °C; beyond them the bias is held to be that at the end of the range.
    pub range: [f64; 2],
    /// Coefficients of the first degree, of the second, and so on: m/s² or rad/s per °C to that power.
    pub coefficients: Vec<Vector3<f64>>,
    /// Covariance of the coefficients, row by row: x, y, z of the first degree, then of the second, and so on; stretched so
    /// that 1.96 standard deviations are half of a 95 % interval.
    covariance: Vec<f64>,
}

/// Scale of the temperature while it is fitted: `u = (T − middle) / half`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) middle: f64,
    pub(super) half: f64,
}

impl Scale {
    pub(super) fn of(range: [f64; 2]) -> Self {
        let [low, high] = range;
        Self { middle: (low + high) / 2.0, half: ((high - low) / 2.0).max(f64::MIN_POSITIVE) }
    }

    pub(super) fn at(self, value: f64) -> f64 {
        (value - self.middle) / self.half
    }
}

impl BiasCourse {
    /// Course about a reference temperature, from the coefficients of the powers of the scaled temperature.
    pub(super) fn about(
        reference: f64,
        range: [f64; 2],
        scaled: &DVector<f64>,
        covariance: &DMatrix<f64>,
        order: usize,
    ) -> Self {
        let scale = Scale::of(range);
        let at = scale.at(reference);
        // (at + d/half)ʲ by the binomial theorem; the constant belongs to the bias.
        let shift = DMatrix::from_fn(3 * order, 3 * order, |row, column| {
            let (i, j) = (row / 3 + 1, column / 3 + 1);
            if row % 3 != column % 3 || j < i {
                return 0.0;
            }
            let binomial = (0..i).fold(1.0, |product, k| product * (j - k) as f64 / (k + 1) as f64);
            binomial * at.powi((j - i) as i32) / scale.half.powi(i as i32)
        });
        let own = 3 * order;
        let coefficients = &shift * scaled.rows(0, own);
        let covariance = &shift * covariance.view((0, 0), (own, own)) * shift.transpose();
        let coefficients = (0..order).map(|k| coefficients.fixed_rows::<3>(3 * k).into_owned()).collect();
        Self { reference, range, coefficients, covariance: covariance.as_slice().to_vec() }
    }

    /// Course of a message, its coefficients taken as independent; `None` if its numbers are no course.
    pub fn of(model: &TemperatureModel) -> Option<Self> {
        let TemperatureModel { reference, minimum, maximum, ref coefficients, ref coefficients_std, .. } = *model;
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let whole = matches!(coefficients.len(), 3 | 6 | 9) && finite(coefficients);
        let sound = whole && finite(&[reference, minimum, maximum]) && minimum <= maximum;
        let variance = |at: usize| coefficients_std.get(at).filter(|std| std.is_finite()).map_or(0.0, |std| std * std);
        sound.then(|| Self {
            reference,
            range: [minimum, maximum],
            coefficients: coefficients.chunks_exact(3).map(Vector3::from_row_slice).collect(),
            covariance: DMatrix::from_diagonal(&DVector::from_fn(coefficients.len(), |at, _| variance(at)))
                .as_slice()
                .to_vec(),
        })
    }

    /// Covariance of the coefficients in their order.
    pub fn covariance(&self) -> DMatrix<f64> {
        let size = 3 * self.order();
        DMatrix::from_fn(size, size, |i, j| self.between(i, j))
    }

    fn between(&self, i: usize, j: usize) -> f64 {
        self.covariance.get(3 * self.order() * i + j).copied().unwrap_or(0.0)
    }

    /// Degree of the polynomial.
    pub fn order(&self) -> usize {
        self.coefficients.len()
    }

    /// Powers of the temperature's distance from the reference, which the coefficients are multiplied by.
    pub fn powers(&self, celsius: f64) -> Vec<f64> {
        let distance = celsius.clamp(self.range[0], self.range[1]) - self.reference;
        (1..=self.order()).map(|degree| distance.powi(degree as i32)).collect()
    }

    /// Change of the bias from the reference temperature to this one, m/s² or rad/s.
    pub fn change(&self, celsius: f64) -> Vector3<f64> {
        self.coefficients.iter().zip(self.powers(celsius)).map(|(coefficient, power)| coefficient * power).sum()
    }

    /// Standard deviation of that change, per axis.
    pub fn change_std(&self, celsius: f64) -> Vector3<f64> {
        let powers = self.powers(celsius);
        Vector3::from_fn(|axis, _| {
            let terms = powers.iter().enumerate().flat_map(|(i, one)| {
                powers.iter().enumerate().map(move |(j, other)| (3 * i + axis, 3 * j + axis, one * other))
            });
            terms.map(|(i, j, product)| self.between(i, j) * product).sum::<f64>().max(0.0).sqrt()
        })
    }

    /// Standard deviations of the coefficients, in their order.
    pub fn coefficients_std(&self) -> Vec<Vector3<f64>> {
        let std = |at: usize| self.between(at, at).max(0.0).sqrt();
        (0..self.order()).map(|k| Vector3::from_fn(|axis, _| std(3 * k + axis))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_only_shifts_the_polynomial() {
        // 1 + 2 u + 3 u² − 4 u³ on every axis, u = (T − 30) / 20.
        let scaled = DVector::from_iterator(9, [2.0, 3.0, -4.0].iter().flat_map(|c| [*c; 3]));
        let covariance = DMatrix::from_diagonal(&DVector::repeat(9, 1e-4));
        let polynomial = |celsius: f64| {
            let u = (celsius - 30.0) / 20.0;
            2.0 * u + 3.0 * u * u - 4.0 * u * u * u
        };
        for reference in [10.0, 37.0, 50.0] {
            let course = BiasCourse::about(reference, [10.0, 50.0], &scaled, &covariance, 3);
            for celsius in [10.0, 20.0, 41.0, 50.0] {
                let change = polynomial(celsius) - polynomial(reference);
                assert!((course.change(celsius) - Vector3::repeat(change)).amax() < 1e-12);
                let u = |celsius: f64| (celsius - 30.0) / 20.0;
                let gap = |k: i32| u(celsius).powi(k) - u(reference).powi(k);
                let std = 0.01 * (gap(1).powi(2) + gap(2).powi(2) + gap(3).powi(2)).sqrt();
                assert!((course.change_std(celsius) - Vector3::repeat(std)).amax() < 1e-9);
            }
            assert_eq!(course.change(-40.0), course.change(10.0), "beyond the range nothing is known");
            assert_eq!(course.change(reference), Vector3::zeros());
        }
    }
}
