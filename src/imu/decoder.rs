//! Numbers out of message bytes, compiled once per channel. What the numbers mean is left to
//! [`Intake`](super::Intake).

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::json::Pick;
use super::layout::{Layout, Place, Wire};
use super::lookup::PathError;
use super::plan::{Plan, Rules, Sizes};
use super::tagged::Tagged;
use super::walk::Malformed;

/// Reads the same few numbers out of each message of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decoder(Encoding);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Encoding {
    /// Each message says itself how it is written.
    Cdr {
        xcdr1: Plan,
        xcdr2: Plan,
        delimited: Plan,
    },
    Ros1(Plan),
    Protobuf(Tagged),
    Json(Pick),
}

impl Decoder {
    /// A decoder for `numbers`, and for a text (empty if there is none to read).
    ///
    /// # Errors
    /// If the layout does not allow to find one of them in every message.
    pub fn new(layout: &Layout, numbers: &[Place], text: Option<&Place>) -> Result<Self, PathError> {
        let plan = |align, sizes| Plan::new(layout, numbers, text, Rules { align, sizes });
        Ok(Self(match layout.wire {
            Wire::Cdr => Encoding::Cdr {
                xcdr1: plan(8, Sizes::None)?,
                xcdr2: plan(4, Sizes::Lists)?,
                delimited: plan(4, Sizes::Messages)?,
            },
            Wire::Ros1 => Encoding::Ros1(plan(1, Sizes::None)?),
            Wire::Protobuf => Encoding::Protobuf(Tagged::new(layout, numbers, text)?),
            Wire::Json => Encoding::Json(Pick::new(numbers, text)),
        }))
    }

    /// Reads one message: the numbers in the order they were asked for, and the text. Integers beyond 2⁵³ are
    /// rounded. In protobuf and JSON, a number that is not there is NaN.
    ///
    /// # Errors
    /// If the message is shorter than its schema demands, or written in a way that is not read. `numbers` may have
    /// changed then.
    pub fn read<'d>(&self, data: &'d [u8], numbers: &mut [f64]) -> Result<Cow<'d, [u8]>, Malformed> {
        let text = match &self.0 {
            Encoding::Json(pick) => return pick.read(data, numbers),
            Encoding::Protobuf(tagged) => tagged.read(data, numbers)?,
            Encoding::Ros1(plan) => plan.walk::<false>(data, 0, numbers)?,
            Encoding::Cdr { xcdr1, xcdr2, delimited } => {
                let truncated = Malformed::Truncated { offset: 0, wanted: HEADER, len: data.len() };
                let &[high, low, ..] = data.first_chunk::<HEADER>().ok_or(truncated)?;
                let identifier = u16::from_be_bytes([high, low]);
                // The identifiers of DDS-XTypes 1.3 and, from 0x10 on, those that its drafts left in the field.
                let plan = match identifier {
                    0x00 | 0x01 => xcdr1,
                    0x06 | 0x07 | 0x10 | 0x11 => xcdr2,
                    0x08 | 0x09 | 0x14 | 0x15 => delimited,
                    _ => return Err(Malformed::Encapsulation { identifier }),
                };
                match identifier % 2 {
                    0 => plan.walk::<true>(data, HEADER, numbers)?,
                    _ => plan.walk::<false>(data, HEADER, numbers)?,
                }
            }
        };
        Ok(Cow::Borrowed(text))
    }
}

/// Length of the encapsulation header: a representation identifier and two bytes of options.
const HEADER: usize = 4;
