//! Reasons why equations have no solution.

/// Reason why a fit has no solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The equations do not determine the unknowns.
    #[error("the equations do not determine the unknowns (condition number {0:.1e})")]
    Singular(f64),
    /// The sizes do not fit, a lower bound is above its upper bound, or a value is not finite.
    #[error("the bounds contradict each other, the sizes do not fit, or a value is not finite")]
    Invalid,
    /// The solver gave up, or what it returned is no minimum.
    #[error("the solver did not converge")]
    NotConverged,
}
