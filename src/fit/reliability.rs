//! Reliability of a fit: how far its placements check each other, and what an error of one of them could hide (Baarda,
//! "A testing procedure for use in geodetic networks", 1968).
//!
//! An error ∇ of one equation shows in its own residual as r ∇, with a redundancy r between none and all, and moves the
//! unknowns by the rest. The smallest that the test of residuals finds four times in five is the minimal detectable bias
//! ∇ = δ σ/√r; what that moves the unknowns by is what nobody would have noticed.

use nalgebra::{DMatrix, DVector};

use super::linear_system::Solved;
use super::placement_scatter::stretch;
use super::student_t::{normal_beyond, student};

/// How well the placements of a fit are checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability {
    /// Of each equation, in their order.
    pub checks: Vec<Check>,
    /// The largest studentised residual over the one that agreement exceeds once in a thousand fits.
    pub disagreement: f64,
}

/// How well one equation is checked by the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Share of an error that shows in the residual, from none (0) to all of it (1).
    pub redundancy: f64,
    /// By how many of its own standard deviations, which it inflates, the largest error that would not be noticed moves any
    /// parameter at the most.
    pub beyond_bars: f64,
    /// The largest error that would not be noticed, in standard deviations.
    pub detectable: f64,
    /// What that moves the parameters by.
    pub hidden: DVector<f64>,
}

/// Below this redundancy an error is seldom found before it does harm (Förstner 1987 calls 0.3 and more well checked).
const CHECKED: f64 = 0.3;
/// An error that inflates the bars so that they hold what it does is no wrong answer, in standard deviations.
const WITHIN: f64 = 3.0;
/// A rest that is off by more than this is no rest, m/s²: an elevator that starts, a vehicle that brakes.
pub const GROSS_ERROR: f64 = 0.4;
/// Probability with which the test of all residuals of a fit accuses an honest one.
const FALSE_ALARM: f64 = 0.001;
/// Standard deviations beyond the critical value at which four errors in five are found.
const POWER: f64 = 0.84;

impl Reliability {
    /// Of a solution whose weights are those of the scatter that it showed. No error is taken for larger than `gross`.
    pub fn of(solved: &Solved, gain: &DMatrix<f64>, gross: f64) -> Self {
        let equations = solved.left.len();
        let freedom = equations as f64 - solved.design.ncols() as f64;
        let squares = solved.left.norm_squared();
        let tail = FALSE_ALARM / equations.max(1) as f64;
        // Without the one that is tested there is a degree of freedom less.
        let critical = student(freedom - 1.0, tail, normal_beyond(tail / 2.0));
        let detectable = critical + POWER;
        let inflation = (1.0 + (detectable * detectable - 1.0) / freedom.max(1.0)).sqrt() * stretch(freedom.max(1.0));
        let mut disagreement = 0.0_f64;
        let checks = (0..equations).map(|i| {
            let leverage = (solved.design.row(i) * gain.column(i))[(0, 0)];
            let redundancy = (1.0 - leverage).clamp(0.0, 1.0);
            if redundancy > 1e-6 && freedom > 1.5 {
                let squared = solved.left[i] * solved.left[i] / redundancy;
                // The scatter without this one (Pope 1976 told the other way round).
                let others = ((squares - squared) / (freedom - 1.0)).max(1e-12);
                disagreement = disagreement.max((squared / others).sqrt() / critical);
            }
            let most = (detectable / redundancy.sqrt().max(1e-9)).min(gross * solved.weight(i));
            let beyond_bars = detectable * (leverage.max(0.0) / redundancy.max(1e-9)).sqrt() / inflation;
            Check { redundancy, beyond_bars, detectable: most, hidden: gain.column(i) * most }
        });
        Self { checks: checks.collect(), disagreement }
    }

    /// The same placements are checked by more than this fit was made of.
    pub fn checked_by(&mut self, more: &Self) {
        for (own, other) in self.checks.iter_mut().zip(&more.checks) {
            let smaller = (other.detectable / own.detectable.max(f64::MIN_POSITIVE)).min(1.0);
            let hidden = &own.hidden * smaller;
            *own = Check { hidden, ..other.clone() };
        }
        self.disagreement = self.disagreement.max(more.disagreement);
    }

    /// Whether any one wrong placement would show.
    pub fn is_checked(&self) -> bool {
        self.checks.iter().all(Check::is_enough)
    }

    /// Whether it would, and none does.
    pub fn confirms(&self) -> bool {
        self.is_checked() && self.disagreement <= 1.0
    }
}

impl Check {
    /// Whether an error would show: by itself, or by what it does to the bars.
    pub fn is_enough(&self) -> bool {
        self.redundancy >= CHECKED || self.beyond_bars <= WITHIN
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::{LinearSystem, Loss, Parameterisation, Truth, limits};
    use super::*;

    /// Readings of one axis, the last of them off by so much.
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
