//! Correction pass: second reading of a recording once its last calibration is known, for `corrected = "final"`.

use super::correction::Corrector;
use super::learner::rounded;
use super::sources::Sources;
use crate::annotate::{Annotator, Corrections};
use crate::config::Config;
use crate::imu::ImuId;
use crate::record::{Block, Event, Topic};

/// Converts the events of a second scan to corrected messages, split by split.
pub(crate) struct CorrectionPass<'a> {
    sources: Sources,
    corrector: Corrector,
    annotator: &'a mut Annotator,
    /// Corrections by IMU.
    corrections: Vec<Option<Corrections>>,
    blocks: Vec<Block>,
}

impl<'a> CorrectionPass<'a> {
    pub(crate) fn new(config: &Config, annotator: &'a mut Annotator, corrections: Vec<Option<Corrections>>) -> Self {
        let (sources, corrector) = (Sources::new(config), Corrector::default());
        Self { sources, corrector, annotator, corrections, blocks: Vec::new() }
    }

    /// Processes an event of the scan.
    pub(crate) fn take(&mut self, event: Event<'_>) {
        let Self { sources, corrector, annotator, corrections, blocks } = self;
        sources.take(&event);
        let Event::Message(message) = event else { return };
        if let Some(message) = sources.wanted(message) {
            sources.intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
            sources.intake.take_notices();
            let by = |imu: ImuId| corrections.get(imu.index()).and_then(Option::as_ref);
            corrector.correct(&message, sources, by, annotator, blocks, |_| {});
        }
    }

    /// Whether no message on these channels is corrected.
    pub(crate) fn is_useless(&self, channels: &[u16]) -> bool {
        self.sources.is_useless(channels)
    }

    /// Takes the blocks closed since the last call.
    pub(crate) fn take_blocks(&mut self) -> Vec<Block> {
        std::mem::take(&mut self.blocks)
    }

    /// Topics of the annotations so far.
    pub(crate) fn topics(&self) -> &[Topic] {
        self.annotator.topics()
    }

    /// Ends a split; another may follow.
    pub(crate) fn end_split(&mut self) {
        let last = self.annotator.finish();
        self.blocks.extend(last);
        self.sources.begin_split();
    }

    /// Ends the recording. Returns what was written, and notes on it.
    pub(crate) fn finish(self) -> (Corrector, Vec<String>) {
        let notes = rounded(&self.sources.intake, &self.corrector);
        (self.corrector, notes)
    }
}
