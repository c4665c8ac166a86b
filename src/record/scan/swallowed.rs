//! Whole records swallowed by a record whose length is wrong. Messages outside chunks and records of private opcodes do
//! not imply their length, so there is no other evidence.

use crate::record::frame_window::Stop;
use crate::record::plausibility::{Measure, end, fits, head, is_defined, measure};
use crate::record::wire::{FRAME, op};

/// Longest record that is searched, in bytes (32 MiB).
pub(super) const LOOK: u64 = 1 << 25;

/// Offset in a record's body, not before `from`, of the first of whole records that reach the body's end: one ends
/// there, or beyond it at an offset (from the record's beginning) where the next one `goes_on`. To exclude bytes that
/// only look like records, one of them must be credible by `is_credible`, or two must be messages.
///
/// # Errors
/// If bytes beyond the body must be read first.
pub(super) fn swallowed(
    body: &[u8],
    from: usize,
    is_credible: impl Fn(u8, &[u8]) -> bool,
    goes_on: impl Fn(u64) -> Result<bool, Stop>,
) -> Result<Option<usize>, Stop> {
    // Walks from different starts cover the same bytes, so the work must be bounded.
    let mut steps = body.len() / 8;
    'starts: for start in starts(body).filter(|&start| start >= from) {
        let (mut at, mut messages, mut credible) = (start, 0, false);
        while at < body.len() {
            let Some(left) = steps.checked_sub(1) else { return Ok(None) };
            steps = left;
            let rest = body.get(at..).unwrap_or_default();
            let Some((opcode, length)) = head(rest).filter(|&(opcode, length)| stands(opcode, length)) else {
                continue 'starts;
            };
            let content = rest.get(FRAME..).unwrap_or_default();
            let until = end(at as u64, length);
            match usize::try_from(length).ok().and_then(|length| content.get(..length)) {
                Some(content) => {
                    messages += usize::from(opcode == op::MESSAGE);
                    credible = credible || messages == 2 || is_credible(opcode, content);
                }
                // It runs past the end.
                None if opcode == op::MESSAGE || measure(opcode, content) == Measure::Says(length) => {
                    credible = credible || is_credible(opcode, content);
                    // An attachment may be too long to look beyond it.
                    let is_long = opcode == op::ATTACHMENT && length > LOOK;
                    if !credible || !is_long && !goes_on(FRAME as u64 + until)? {
                        continue 'starts;
                    }
                }
                None => continue 'starts,
            }
            at = usize::try_from(until).unwrap_or(usize::MAX);
        }
        if credible {
            return Ok(Some(start));
        }
    }
    Ok(None)
}

/// Whether a record with this opcode and length may be among others.
fn stands(opcode: u8, length: u64) -> bool {
    (is_defined(opcode) || opcode >= 0x80) && fits(opcode, length)
}

/// Offsets at which records may begin, in order. The upper half of a length is zero (except for attachments of 4 GiB
/// and more), so only every fourth byte need be checked.
fn starts(body: &[u8]) -> impl Iterator<Item = usize> + '_ {
    let zeros = (FRAME - 1..body.len()).step_by(4).filter(|&at| body.get(at) == Some(&0));
    let near = zeros.flat_map(|at| at + 1 - FRAME..at + 5 - FRAME);
    near.filter(|&start| {
        let found = body.get(start..).and_then(head);
        found.is_some_and(|(opcode, length)| length >> 32 == 0 && stands(opcode, length))
    })
}
