//! Variance of the latest samples of a triad, in constant time a sample.
//!
//! Two stacks of partial sums, back to back: nothing is ever subtracted, so a corrupt sample leaves no trace after it
//! has left the window.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Sliding window over the last `size` samples.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Window {
    size: usize,
    /// Sums over the oldest samples: entry `i` covers those from the `i`-th newest of them to the newest of them.
    front: Vec<Spread>,
    /// Newer samples …
    back: Vec<Vector3<f64>>,
    /// … and their sum.
    back_sum: Spread,
    /// Sum of all samples.
    total: Spread,
}

impl Window {
    pub(super) fn new(size: usize) -> Self {
        Self { size, front: Vec::new(), back: Vec::new(), back_sum: Spread::default(), total: Spread::default() }
    }

    pub(super) fn push(&mut self, value: &Vector3<f64>) {
        if self.is_full() {
            self.pop();
        }
        self.back.push(*value);
        self.back_sum = self.back_sum.merged(&Spread::of(value));
        self.total = match self.front.last() {
            Some(front) => front.merged(&self.back_sum),
            None => self.back_sum,
        };
    }

    pub(super) fn clear(&mut self) {
        *self = Self::new(self.size);
    }

    pub(super) fn size(&self) -> usize {
        self.size
    }

    pub(super) fn is_full(&self) -> bool {
        self.front.len() + self.back.len() >= self.size
    }

    /// Mean of the samples in the window.
    pub(super) fn mean(&self) -> Vector3<f64> {
        self.total.mean
    }

    /// Sample variance of each axis (divisor n − 1).
    pub(super) fn variance(&self) -> Vector3<f64> {
        let Spread { count, squares, .. } = self.total;
        if count < 2.0 { Vector3::zeros() } else { squares / (count - 1.0) }
    }

    fn pop(&mut self) {
        if self.front.is_empty() {
            let mut sum = Spread::default();
            for value in self.back.drain(..).rev() {
                sum = Spread::of(&value).merged(&sum);
                self.front.push(sum);
            }
            self.back_sum = Spread::default();
        }
        self.front.pop();
    }
}

/// Count, mean and per-axis sum of squared deviations.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Spread {
    count: f64,
    mean: Vector3<f64>,
    squares: Vector3<f64>,
}

impl Spread {
    fn of(value: &Vector3<f64>) -> Self {
        Self { count: 1.0, mean: *value, squares: Vector3::zeros() }
    }

    /// Merges two sums (Chan).
    fn merged(&self, other: &Self) -> Self {
        let count = self.count + other.count;
        if count == 0.0 {
            return *self;
        }
        let between = other.mean - self.mean;
        let share = other.count / count;
        Self {
            count,
            mean: self.mean + between * share,
            squares: self.squares + other.squares + between.component_mul(&between) * (self.count * share),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn variance_is_that_of_the_last_samples(
            rows in proptest::collection::vec((-10.0..10.0, -1.0..1.0, 99.0..101.0), 2..200),
            size in 2_usize..40,
        ) {
            let values: Vec<_> = rows.into_iter().map(|(x, y, z): (f64, f64, f64)| Vector3::new(x, y, z)).collect();
            let mut window = Window::new(size);
            for (i, value) in values.iter().enumerate() {
                window.push(value);
                let last = &values[(i + 1).saturating_sub(size)..=i];
                if last.len() > 1 {
                    let mean = last.iter().sum::<Vector3<f64>>() / last.len() as f64;
                    let squares: Vector3<f64> = last.iter().map(|v| (v - mean).component_mul(&(v - mean))).sum();
                    prop_assert!((window.variance() - squares / (last.len() - 1) as f64).norm() < 1e-9);
                    prop_assert!((window.mean() - mean).norm() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_corrupt_sample_leaves_no_trace_after_it_has_left() {
        let mut clean = Window::new(10);
        let mut hit = Window::new(10);
        for i in 0..40 {
            let value = Vector3::new(9.8, 0.01 * f64::from(i % 3), -0.02);
            clean.push(&value);
            hit.push(&if i == 15 { Vector3::repeat(1e300) } else { value });
        }
        assert!((clean.variance() - hit.variance()).norm() < 1e-15);
    }
}
