//! Resumption of a saved [`Learner`]. Findings are not saved, but restored from the annotations.

use super::Learner;
use crate::annotate;
use crate::config::Config;
use crate::engine;
use crate::record::{Annotation, Topic};
use crate::topic;

impl Learner {
    /// Resumes a learner that was saved under the same configuration. Its findings must be [restored](Self::restore_findings)
    /// from the annotations.
    pub(crate) fn resume(mut self, config: &Config) -> Self {
        self.config = config.clone();
        for i in 0..self.imus.len() {
            let findings = self.sources.intake.imus().get(i).map(|imu| self.nothing_of(imu)).unwrap_or_default();
            self.imus.get_mut(i).into_iter().for_each(|learning| learning.findings = findings.clone());
        }
        self
    }

    /// Restores findings from annotations that were written before, on these topics.
    pub(crate) fn restore_findings(&mut self, annotations: &[Annotation], topics: &[Topic]) {
        for annotation in annotations {
            let Some(on) = topics.get(annotation.topic) else { continue };
            let imu = topic::imu_of(&on.name);
            let known = self.imus.iter_mut().find(|learning| Some(&*learning.findings.name) == imu);
            let message = annotate::read(&on.schema_name, &on.message_encoding, &annotation.data);
            if let (Some(learning), Ok(message)) = (known, message) {
                learning.findings.note(&engine::Event { log_time: annotation.log_time, message });
            }
        }
    }

    /// Restores findings from the annotations that had not been written yet.
    pub(crate) fn restore_open_findings(&mut self) {
        let annotator = self.annotator.clone();
        self.restore_findings(annotator.open(), annotator.topics());
    }
}
