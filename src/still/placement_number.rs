//! Numbers the placements: which rests had no motion between them. Finding rests is left to the segmenter.

use serde::{Deserialize, Serialize};

use super::rest::TriadMean;

/// The placement that the IMU is in.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Placement {
    number: u32,
    /// What its first rest read, until motion ends it.
    first: Option<TriadMean>,
}

impl Placement {
    /// The number of a rest's placement: that of the one before a split or a gap, as long as it reads what the first rest
    /// of the placement read. What wandered by more than `max_creep` (m/s²) is another, however slowly it went.
    pub(super) fn place(&mut self, mean: &TriadMean, max_creep: f64) -> u32 {
        let stays = self.first.as_ref().is_some_and(|first| {
            let noise = (first.mean_variance() + mean.mean_variance()).sum().sqrt();
            (mean.mean - first.mean).norm() <= creep_limit(max_creep, noise)
        });
        if !stays {
            self.number = self.number.saturating_add(1);
            self.first = Some(mean.clone());
        }
        self.number
    }

    /// The number of the last rest's.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Motion has ended it.
    pub(super) fn end(&mut self) {
        self.first = None;
    }
}

/// How far two means of one placement may differ, m/s², when their difference has so much noise.
pub(super) fn creep_limit(max_creep: f64, noise: f64) -> f64 {
    max_creep + 4.0 * noise
}
