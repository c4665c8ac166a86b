//! Numbers out of message bytes, compiled once per channel. What the numbers mean is left to
//! [`Intake`](super::Intake).

use serde::{Deserialize, Serialize};

use super::layout::{Layout, Place, Wire};
use super::lookup::PathError;
use super::plan::{Plan, Rules};
use super::walk::Malformed;

/// Reads the same few numbers out of each message of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decoder(Encoding);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Encoding {
    /// Each message says itself which of the two versions it is written in.
    Cdr {
        xcdr1: Plan,
        xcdr2: Plan,
    },
    Ros1(Plan),
}

impl Decoder {
    /// A decoder for `numbers`, and for a text (empty if there is none to read).
    ///
    /// # Errors
    /// If the layout does not allow to find one of them in every message.
    pub fn new(layout: &Layout, numbers: &[Place], text: Option<&Place>) -> Result<Self, PathError> {
        let plan = |align, delimited| Plan::new(layout, numbers, text, Rules { align, delimited });
        Ok(Self(match layout.wire {
            Wire::Cdr => Encoding::Cdr { xcdr1: plan(8, false)?, xcdr2: plan(4, true)? },
            Wire::Ros1 => Encoding::Ros1(plan(1, false)?),
        }))
    }

    /// Reads one message: the numbers in the order they were asked for, and the text. Integers beyond 2⁵³ are
    /// rounded.
    ///
    /// # Errors
    /// If the message is shorter than its schema demands, or written in a way that is not read. `numbers` may have
    /// changed then.
    pub fn read<'d>(&self, data: &'d [u8], numbers: &mut [f64]) -> Result<&'d [u8], Malformed> {
        match &self.0 {
            Encoding::Ros1(plan) => plan.walk::<false>(data, 0, numbers),
            Encoding::Cdr { xcdr1, xcdr2 } => {
                let truncated = Malformed::Truncated { offset: 0, wanted: HEADER, len: data.len() };
                let &[high, low, ..] = data.first_chunk::<HEADER>().ok_or(truncated)?;
                match u16::from_be_bytes([high, low]) {
                    0x00 => xcdr1.walk::<true>(data, HEADER, numbers),
                    0x01 => xcdr1.walk::<false>(data, HEADER, numbers),
                    // The identifiers of DDS-XTypes 1.3 and, from 0x10 on, those that its drafts left in the field.
                    0x06 | 0x10 => xcdr2.walk::<true>(data, HEADER, numbers),
                    0x07 | 0x11 => xcdr2.walk::<false>(data, HEADER, numbers),
                    other => Err(Malformed::Encapsulation(other)),
                }
            }
        }
    }
}

/// Length of the encapsulation header: a representation identifier and two bytes of options.
const HEADER: usize = 4;
