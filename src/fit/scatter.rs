//! How far placements scatter beyond what noise explains.

/// The assumed scatter weighs as much as so many observed degrees of freedom.
const PRIOR_WEIGHT: f64 = 4.0;

/// Variance between placements, from residuals with known noise variances and a prior.
///
/// The estimator of Paule and Mandel (1982) sets the weighted sum of squares to its expectation, the degrees of freedom.
/// The prior enters like `prior_weight` further residuals that scatter as it says, so that it rules while there is no
/// redundancy and fades as there is.
pub fn variance_between(residuals: impl Iterator<Item = (f64, f64)> + Clone, freedom: f64, prior: f64) -> f64 {
    let expected = freedom + PRIOR_WEIGHT;
    let excess = |between: f64| {
        let observed: f64 = residuals.clone().map(|(residual, noise)| residual * residual / (between + noise)).sum();
        observed + PRIOR_WEIGHT * prior * prior / between - expected
    };
    // Falls from infinity to below zero: bisection on the logarithm, twelve decades about the prior.
    let (mut low, mut high) = (prior * prior * 1e-6, prior * prior * 1e6);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if excess(middle) > 0.0 { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_redundancy_the_prior_rules() {
        let variance = variance_between(std::iter::repeat_n((0.0, 1e-6), 6), 0.0, 0.01);
        assert!((variance / 1e-4 - 1.0).abs() < 1e-6, "{variance}");
    }

    #[test]
    fn with_much_redundancy_the_residuals_rule() {
        let residuals = (0..200).map(|i| (if i % 2 == 0 { 0.03 } else { -0.03 }, 1e-6));
        let variance = variance_between(residuals, 200.0, 0.01);
        assert!((variance.sqrt() / 0.03 - 1.0).abs() < 0.02, "{variance}");
    }

    #[test]
    fn noise_is_not_counted_as_scatter() {
        let residuals = (0..400).map(|i| (if i % 2 == 0 { 0.01 } else { -0.01 }, 1e-4));
        let variance = variance_between(residuals, 400.0, 0.001);
        assert!(variance.sqrt() < 0.003, "{variance}");
    }
}
