//! Rests on their way out: a rest waits for a credible noise floor, by which it may turn out to be none.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::rest::Rest;
use crate::imu::Sensor;

/// Largest number of rests that wait for a credible floor.
const MOST: usize = 256;

/// Queue of rests, oldest first.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct WaitingRests {
    /// Those that wait for a credible floor.
    held: VecDeque<Rest>,
    ready: VecDeque<Rest>,
}

impl WaitingRests {
    /// Adds a finished rest. Of too many, the oldest is lost.
    pub(super) fn keep(&mut self, rest: Rest) {
        if self.held.len() == MOST {
            self.held.pop_front();
        }
        self.held.push_back(rest);
    }

    /// Lets those go that are rests by a credible floor, and drops the others.
    pub(super) fn release(&mut self, is_quiet: impl Fn(&Rest) -> bool) {
        self.ready.extend(self.held.drain(..).filter(is_quiet));
    }

    /// Removes the readings of a triad from the rests that wait.
    pub(super) fn forget(&mut self, sensor: Sensor) {
        self.held = self.held.drain(..).filter_map(|rest| rest.without(sensor)).collect();
    }

    /// Next rest that was let go.
    pub(super) fn next(&mut self) -> Option<Rest> {
        self.ready.pop_front()
    }
}
