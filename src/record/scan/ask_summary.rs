//! Reading of the summary ahead of time, and the return to the data.

use super::Scan;
use super::early_summary::{Asking, EarlySummary};
use super::stage::Stage;
use crate::record::frame_window::Stop;

impl Scan {
    /// Starts to read the summary, to return here afterwards. A growing recording has none yet, so the scan waits.
    pub(super) fn ask(&mut self) -> Result<(), Stop> {
        if !self.window.extent().finished {
            return Err(self.window.wait());
        }
        self.stage = Stage::Asking(Box::new(Asking::new(self.window.offset(), self.limits)));
        Ok(())
    }

    pub(super) fn answer(&mut self) -> Result<(), Stop> {
        let Stage::Asking(mut asking) = std::mem::take(&mut self.stage) else { return Ok(()) };
        let in_order = match asking.read(&mut self.window) {
            Err(stop @ Stop::Read { .. }) => {
                self.stage = Stage::Asking(asking);
                return Err(stop);
            }
            read => read.unwrap_or(false),
        };
        self.window.seek(asking.back);
        self.stage = Stage::Record;
        let found = match in_order {
            true => {
                let (found, schemas, channels) = asking.into_parts();
                // Contradictions are reported later, when the summary is read in its turn.
                self.learn_from_summary(schemas, channels);
                found
            }
            false => EarlySummary::default(),
        };
        self.early_summary = Some(found);
        Ok(())
    }
}
