//! Everything that is learned of one IMU.

use serde::{Deserialize, Serialize};

use crate::annotate::Corrections;
use crate::engine::Engine;
use crate::report::Findings;

/// State of one IMU.
#[derive(Serialize, Deserialize)]
pub(super) struct ImuState {
    pub(super) engine: Engine,
    /// Not saved, since the annotations contain the same, but for the faces of what was nearly a rest.
    #[serde(skip)]
    pub(super) findings: Findings,
    /// Corrections by the calibration in force.
    pub(super) corrections: Option<Corrections>,
}
