//! End of a recording: what is left to say of it as a whole.

use std::collections::BTreeSet;

use super::Learner;
use super::engine_setup::is_called;
use super::learned::Learned;
use super::notes::{not_corrected, rounded};
use crate::annotate::Corrected;
use crate::imu::ImuId;
use crate::pipeline::events::Notify;

impl Learner {
    /// Results of the recording.
    pub(crate) fn finish(mut self, notify: Notify<'_>) -> Learned {
        if !self.closed {
            self.close(notify);
        }
        let faults = self.sources.intake.faults().into_iter().map(|fault| fault.to_string());
        let causal = self.config.output.corrected == Corrected::Causal;
        let stuck = self.imus.iter().filter(|imu| causal && imu.corrections.is_some()).map(|imu| &imu.findings);
        let stuck = stuck.filter(|imu| !self.corrector.has_written(&imu.name)).map(not_corrected);
        let stuck = stuck.chain(rounded(&self.sources.intake, &self.corrector));
        let apart = self.apart().is_some();
        let notes = faults.chain(self.timing_remarks()).chain(stuck);
        let notes = notes.chain(self.sources.intake.heading_unread()).chain(self.unused_rotations()).collect();
        let channels = self.sources.channels().map(|(entry, verdict)| (entry.channel.clone(), verdict.clone()));
        Learned {
            imus: self.imus.into_iter().map(|imu| imu.findings).collect(),
            channels: channels.collect(),
            notes,
            missing: self.sources.missing_among(),
            apart,
            damage: self.damage,
            damages: self.damages,
            annotator: self.annotator,
        }
    }

    /// Declared rotations that are of no use, one line each.
    fn unused_rotations(&self) -> Vec<String> {
        let imus = self.sources.intake.imus();
        let named = self.config.fit.rotations.iter().filter_map(|rotation| rotation.imu.as_ref());
        let unknown = named.filter(|name| !imus.iter().any(|imu| is_called(imu, name)));
        let unknown: BTreeSet<_> = unknown.map(|name| format!("fit.rotations: no IMU is called {name}")).collect();
        let unused = imus.iter().zip(&self.imus).flat_map(|(imu, learning)| {
            learning.engine.unused_rotations().iter().map(|text| format!("{}: {text}", imu.name))
        });
        unknown.into_iter().chain(unused).collect()
    }

    /// Corrections to the times of the readings, one line each.
    pub(super) fn timing_remarks(&self) -> Vec<String> {
        let imus = self.sources.intake.imus().iter().enumerate();
        let ids = imus.map(|(i, imu)| (ImuId::of(i), imu));
        ids.flat_map(|(id, imu)| self.timing.remarks(id).into_iter().map(move |text| format!("{}: {text}", imu.name)))
            .chain(match &self.time_merge {
                Some(merge) => Some(merge.remark()),
                None => self.time_order.remark(self.sources.intake.parts()),
            })
            .collect()
    }
}
