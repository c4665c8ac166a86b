//! Resumption of a scan where another one stopped.

use super::Scan;
use super::data_crc::DataCrc;
use super::position::Position;
use super::stage::Stage;

impl Scan {
    /// Scan of a recording that may grow, from the position of another scan. Its length is 0 as with [`Scan::new`].
    pub fn resume(position: Position) -> Self {
        let Position { offset, inventory, indexes, sync, data_crc } = position;
        let (stage, data_crc) = (Stage::Record, DataCrc::resume(data_crc));
        let mut scan = Self { inventory, indexes, sync, stage, data_crc, ..Self::default() };
        scan.window.skip(offset);
        scan
    }

    /// Position to resume from; `None` unless everything before it was emitted and the summary has not begun. Always
    /// `None` in an annotated recording, since that does not grow.
    pub fn position(&self) -> Option<Position> {
        let at_a_record = matches!(self.stage, Stage::Record) && self.queue.is_empty();
        let between = at_a_record && !self.summary.begun && self.ours.is_none();
        between.then(|| Position {
            offset: self.window.offset(),
            inventory: self.inventory.clone(),
            indexes: self.indexes.clone(),
            sync: self.sync.clone(),
            data_crc: self.data_crc.value(),
        })
    }
}
