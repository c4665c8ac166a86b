//! Going on with what was saved: a [`Learner`] does not save what its annotations say, and takes it in again.

use super::Learner;
use crate::annotate;
use crate::config::Config;
use crate::engine;
use crate::record::Annotation;

impl Learner {
    /// Goes on with what was saved under the same configuration. What had been learned is to be
    /// [recalled](Self::recall) from the annotations.
    pub(crate) fn resume(mut self, config: &Config) -> Self {
        self.config = config.clone();
        for i in 0..self.imus.len() {
            let findings = self.intake.imus().get(i).map(|imu| self.nothing_of(imu)).unwrap_or_default();
            self.imus.get_mut(i).into_iter().for_each(|learning| learning.findings = findings.clone());
        }
        self
    }

    /// Takes in an annotation that was written before.
    pub(crate) fn recall(&mut self, topic: &str, event: &engine::Event) {
        let imu = topic.split_once("/stillpoint/").map(|(imu, _)| imu);
        let known = self.imus.iter_mut().find(|learning| Some(&*learning.findings.name) == imu);
        known.into_iter().for_each(|learning| learning.findings.note(event));
    }

    /// Takes in the annotations that had not been written before.
    pub(crate) fn recall_open(&mut self) {
        let said = |annotation: &Annotation| {
            let topic = self.annotator.topics().get(annotation.topic)?;
            let message = annotate::read(&topic.schema_name, &topic.message_encoding, &annotation.data).ok()?;
            Some((topic.name.clone(), engine::Event { log_time: annotation.log_time, message }))
        };
        let open: Vec<_> = self.annotator.open().iter().filter_map(said).collect();
        open.iter().for_each(|(topic, event)| self.recall(topic, event));
    }
}
