//! Numbers of lists of any length: a column for each number that is read from every element.

/// Columns of a message, by the slots of the numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::imu) struct Lists {
    columns: Vec<Vec<f64>>,
    is_over: bool,
}

/// Largest number of elements read from a list. A sensor of 32 kHz that is read ten times a second has fewer.
pub(in crate::imu) const MOST_ELEMENTS: usize = 4096;

impl Lists {
    /// Empties the columns, and provides those of so many slots.
    pub(in crate::imu) fn clear(&mut self, slots: usize) {
        self.columns.iter_mut().for_each(Vec::clear);
        self.columns.resize_with(slots, Vec::new);
        self.is_over = false;
    }

    /// Appends a number to the column of a slot. Columns that were not provided are not kept.
    pub(super) fn push(&mut self, slot: usize, value: f64) {
        match self.columns.get_mut(slot) {
            Some(column) if column.len() < MOST_ELEMENTS => column.push(value),
            Some(_) => self.is_over = true,
            None => {}
        }
    }

    /// Column of a slot.
    pub(in crate::imu) fn column(&self, slot: usize) -> &[f64] {
        self.columns.get(slot).map(Vec::as_slice).unwrap_or_default()
    }

    /// Whether a list was longer than [`MOST_ELEMENTS`].
    pub(super) fn is_over(&self) -> bool {
        self.is_over
    }

    /// Empties the columns again, for another attempt at the same message.
    pub(super) fn restart(&mut self) {
        self.clear(self.columns.len());
    }
}
