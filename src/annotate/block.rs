//! Block being filled, and the rule for closing it.

use serde::{Deserialize, Serialize};

use crate::record::{Annotation, Block};

/// Longest span of log time of a block, in nanoseconds: readers in log-time order hold overlapping blocks in memory.
const MAX_SPAN: u64 = 5_000_000_000;

/// Most message data of a block, in bytes.
const MAX_BYTES: usize = 256 << 10;

/// A block that is not closed yet.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct OpenBlock {
    block: Block,
    bytes: usize,
    earliest: u64,
    latest: u64,
    urgent: bool,
}

impl OpenBlock {
    /// Adds an annotation. Returns the block before it if the two together would be too long or too large. A single
    /// annotation is never too large.
    pub fn push(&mut self, annotation: Annotation, urgent: bool) -> Option<Block> {
        let closed = if self.has_room_for(&annotation) { None } else { self.close() };
        let alone = self.block.annotations.is_empty();
        self.earliest = if alone { annotation.log_time } else { self.earliest.min(annotation.log_time) };
        self.latest = if alone { annotation.log_time } else { self.latest.max(annotation.log_time) };
        self.bytes += annotation.data.len();
        self.urgent |= urgent;
        self.block.annotations.push(annotation);
        closed
    }

    /// Annotations in the block.
    pub fn annotations(&self) -> &[Annotation] {
        &self.block.annotations
    }

    /// Whether it holds an annotation that readers wait for.
    pub fn is_urgent(&self) -> bool {
        self.urgent
    }

    /// Closes the block and begins an empty one. `None` if the block is empty.
    pub fn close(&mut self) -> Option<Block> {
        let block = std::mem::take(self).block;
        (!block.annotations.is_empty()).then_some(block)
    }

    fn has_room_for(&self, annotation: &Annotation) -> bool {
        let span = self.latest.max(annotation.log_time) - self.earliest.min(annotation.log_time);
        self.block.annotations.is_empty() || (span <= MAX_SPAN && self.bytes + annotation.data.len() <= MAX_BYTES)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn blocks_lose_nothing_and_are_as_large_as_they_may_be(
            parts in prop::collection::vec((0..3 * MAX_SPAN, 0..MAX_BYTES), 0..40),
        ) {
            let given: Vec<_> = parts.into_iter().map(|(log_time, bytes)| annotation(log_time, bytes)).collect();
            let mut open = OpenBlock::default();
            let mut blocks: Vec<_> = given.iter().filter_map(|one| open.push(one.clone(), false)).collect();
            blocks.extend(open.close());

            let written: Vec<_> = blocks.iter().flat_map(|block| block.annotations.clone()).collect();
            prop_assert_eq!(&written, &given);
            prop_assert!(blocks.iter().all(|block| fits(&block.annotations)));
            for pair in blocks.windows(2) {
                let one_more = [&pair[0].annotations[..], &pair[1].annotations[..1]].concat();
                prop_assert!(!fits(&one_more));
            }
        }
    }

    fn fits(annotations: &[Annotation]) -> bool {
        let times = || annotations.iter().map(|annotation| annotation.log_time);
        let bytes: usize = annotations.iter().map(|annotation| annotation.data.len()).sum();
        let span = times().max().unwrap_or(0) - times().min().unwrap_or(0);
        !annotations.is_empty() && span <= 5_000_000_000 && bytes <= 262_144
    }

    fn annotation(log_time: u64, bytes: usize) -> Annotation {
        Annotation { topic: 0, sequence: 0, log_time, data: vec![0; bytes] }
    }

    #[test]
    fn a_block_spans_five_seconds_of_log_time_and_no_more() {
        let mut open = OpenBlock::default();
        assert_eq!(open.push(annotation(7, 1), false), None);
        assert_eq!(open.push(annotation(7 + MAX_SPAN, 1), false), None);
        let closed = open.push(annotation(8 + MAX_SPAN, 1), false);
        assert_eq!(closed.map(|block| block.annotations.len()), Some(2));
        assert_eq!(open.close().map(|block| block.annotations.len()), Some(1));
    }

    #[test]
    fn log_times_that_run_backward_count_as_span_too() {
        let mut open = OpenBlock::default();
        assert_eq!(open.push(annotation(MAX_SPAN + 1, 1), false), None);
        assert_eq!(open.push(annotation(2, 1), false), None);
        assert!(open.push(annotation(0, 1), false).is_some());
    }

    #[test]
    fn a_block_holds_256_kib_and_no_more() {
        let mut open = OpenBlock::default();
        assert_eq!(open.push(annotation(0, MAX_BYTES - 1), false), None);
        assert_eq!(open.push(annotation(0, 1), false), None);
        assert!(open.push(annotation(0, 1), false).is_some());
    }

    #[test]
    fn one_annotation_larger_than_a_block_has_a_block_of_its_own() {
        let mut open = OpenBlock::default();
        assert_eq!(open.push(annotation(0, 2 * MAX_BYTES), false), None);
        assert!(open.push(annotation(0, 0), false).is_some());
        assert_eq!(open.close().map(|block| block.annotations.len()), Some(1));
        assert_eq!(open.close(), None);
    }
}
