//! Reliability of a fit: how well its placements check each other, and what an error in one of them could hide (Baarda,
//! "A testing procedure for use in geodetic networks", 1968).
//!
//! An error ∇ of one equation shows in its own residual as r ∇, with a redundancy r from 0 to 1, and the rest moves the
//! unknowns. The smallest error that the residual test finds four times in five is the minimal detectable bias ∇ = δ
//! σ/√r; the shift of the unknowns by it may go undetected.

use nalgebra::{DMatrix, DVector};

use super::linear_system::Solved;
use super::placement_scatter::stretch;
use super::student_t::{normal_beyond, student};

/// Reliability of the placements of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability {
    /// Check of each equation, in order.
    pub checks: Vec<Check>,
    /// Largest studentised residual, relative to the critical value that is exceeded by chance once in a thousand fits.
    pub disagreement: f64,
}

/// Check of one equation by the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Share of an error that shows in the residual, from 0 to 1.
    pub redundancy: f64,
    /// Largest shift of any parameter by the largest undetected error, in standard deviations, which that error
    /// inflates.
    pub beyond_bars: f64,
    /// Largest undetected error, in standard deviations.
    pub detectable: f64,
    /// Shift of the parameters by the largest undetected error.
    pub hidden: DVector<f64>,
}

/// Least redundancy at which an error is mostly found before it does harm (Förstner 1987 calls 0.3 and more well
/// checked).
const CHECKED: f64 = 0.3;
/// Largest harmless shift, in standard deviations: the bars, inflated by the error, still hold it.
const WITHIN: f64 = 3.0;
/// Largest error of a rest, m/s²: beyond it, as in a starting elevator or a braking vehicle, it is no rest.
pub const GROSS_ERROR: f64 = 0.4;
/// Probability that the test of all residuals of a fit accuses a correct one.
const FALSE_ALARM: f64 = 0.001;
/// Standard deviations beyond the critical value at which four errors in five are found.
const POWER: f64 = 0.84;

impl Reliability {
    /// Assesses a solution whose weights come from the scatter that it showed. No error is assumed larger than `gross`.
    pub fn of(solved: &Solved, gain: &DMatrix<f64>, gross: f64) -> Self {
        let equations = solved.left.len();
        let leverage = |i: usize| (solved.design.row(i) * gain.column(i))[(0, 0)];
        // Equations that do not depend on placements say nothing of their scatter.
        let (of_placements, known): (Vec<_>, Vec<_>) = (0..equations).partition(|&i| solved.is_of_placement(i));
        let saved: f64 = known.iter().map(|&i| leverage(i)).sum();
        let freedom = of_placements.len() as f64 - (solved.design.ncols() as f64 - saved);
        let squares: f64 = of_placements.iter().map(|&i| solved.left[i] * solved.left[i]).sum();
        let tail = FALSE_ALARM / equations.max(1) as f64;
        // Without the tested equation there is one degree of freedom less.
        let critical = student(freedom - 1.0, tail, normal_beyond(tail / 2.0));
        let detectable = critical + POWER;
        let inflation = (1.0 + (detectable * detectable - 1.0) / freedom.max(1.0)).sqrt() * stretch(freedom.max(1.0));
        let mut disagreement = 0.0_f64;
        let checks = (0..equations).map(|i| {
            let leverage = leverage(i);
            let redundancy = (1.0 - leverage).clamp(0.0, 1.0);
            if redundancy > 1e-6 && freedom > 1.5 {
                let squared = solved.left[i] * solved.left[i] / redundancy;
                // Scatter without this equation (equivalent to the test of Pope 1976, in its externally studentised
                // form).
                let others = ((squares - squared) / (freedom - 1.0)).max(1e-12);
                disagreement = disagreement.max((squared / others).sqrt() / critical);
            }
            let most = (detectable / redundancy.sqrt().max(1e-9)).min(gross * solved.weight(i));
            let beyond_bars = detectable * (leverage.max(0.0) / redundancy.max(1e-9)).sqrt() / inflation;
            Check { redundancy, beyond_bars, detectable: most, hidden: gain.column(i) * most }
        });
        Self { checks: checks.collect(), disagreement }
    }

    /// Takes the checks of a fit with more equations, of which the same placements are part.
    pub fn checked_by(&mut self, more: &Self) {
        for (own, other) in self.checks.iter_mut().zip(&more.checks) {
            let smaller = (other.detectable / own.detectable.max(f64::MIN_POSITIVE)).min(1.0);
            let hidden = &own.hidden * smaller;
            *own = Check { hidden, ..other.clone() };
        }
        self.disagreement = self.disagreement.max(more.disagreement);
    }

    /// Whether a single wrong placement would show, whichever it is.
    pub fn is_checked(&self) -> bool {
        self.checks.iter().all(Check::is_enough)
    }

    /// Whether a single wrong placement would show, and none does.
    pub fn confirms(&self) -> bool {
        self.is_checked() && self.disagreement <= 1.0
    }
}

impl Check {
    /// Whether an error would show: in the residual, or through the inflated bars.
    pub fn is_enough(&self) -> bool {
        self.redundancy >= CHECKED || self.beyond_bars <= WITHIN
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::{LinearSystem, Loss, Parameterisation, Truth, limits};
    use super::*;

    /// Readings of one axis, the last of them off by `off`.
    fn of(count: usize, off: f64) -> Reliability {
        let mut system = LinearSystem::new(Parameterisation::BIAS);
        for i in 0..3 * count {
            let value = if i % 2 == 0 { 0.01 } else { -0.01 } + if i == 3 * count - 1 { off } else { 0.0 };
            system.push(&Vector3::ith(i % 3, 1.0), &Truth::default(), value, 1e-4, 0.0);
        }
        let wide = limits(Parameterisation::BIAS, |_| [f64::NEG_INFINITY, f64::INFINITY]);
        let solved = system.solve(&wide, Loss::Square).unwrap();
        Reliability::of(&solved, &solved.gain(), f64::INFINITY)
    }

    #[test]
    fn a_reading_that_nothing_repeats_is_not_checked() {
        assert!(of(1, 0.0).checks[0].redundancy < 1e-9 && !of(1, 0.0).confirms());
        assert!((of(4, 0.0).checks[0].redundancy - 0.75).abs() < 1e-9 && of(4, 0.0).confirms());
    }

    #[test]
    fn a_reading_that_is_off_disagrees() {
        assert!(of(8, 0.02).disagreement <= 1.0);
        assert!(of(8, 0.5).disagreement > 1.0);
    }

    #[test]
    fn what_may_hide_shrinks_with_the_number_of_checks() {
        let hidden = |count| of(count, 0.0).checks[0].hidden.norm();
        assert!(hidden(2) > hidden(4) && hidden(4) > hidden(12), "{} {} {}", hidden(2), hidden(4), hidden(12));
    }
}
