//! Correction pass: a recording read again, now that its last calibration is known, for `corrected = "final"`.

use super::correction::Corrector;
use super::sources::Sources;
use crate::annotate::{Annotator, Corrections};
use crate::config::Config;
use crate::imu::ImuId;
use crate::record::{Block, Event, Topic};

/// Corrected messages out of the events of a second scan, split by split.
pub(crate) struct CorrectionPass<'a> {
    sources: Sources,
    corrector: Corrector,
    annotator: &'a mut Annotator,
    /// By IMU.
    corrections: Vec<Option<Corrections>>,
    blocks: Vec<Block>,
}

impl<'a> CorrectionPass<'a> {
    pub(crate) fn new(config: &Config, annotator: &'a mut Annotator, corrections: Vec<Option<Corrections>>) -> Self {
        let (sources, corrector) = (Sources::new(config), Corrector::default());
        Self { sources, corrector, annotator, corrections, blocks: Vec::new() }
    }

    /// Takes an event of the scan.
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

    /// Whether messages on these channels are corrected by nothing.
    pub(crate) fn is_useless(&self, channels: &[u16]) -> bool {
        self.sources.is_useless(channels)
    }

    /// Hands over the blocks that were closed since the last time.
    pub(crate) fn take_blocks(&mut self) -> Vec<Block> {
        std::mem::take(&mut self.blocks)
    }

    /// Topics of the annotations so far.
    pub(crate) fn topics(&self) -> &[Topic] {
        self.annotator.topics()
    }

    /// A split has ended, and another may begin.
    pub(crate) fn end_split(&mut self) {
        let last = self.annotator.finish();
        self.blocks.extend(last);
        self.sources.begin_split();
    }

    /// The recording has ended.
    pub(crate) fn finish(self) -> Corrector {
        self.corrector
    }
}
