//! Encoding of a channel's messages, with the plan to read each.

use serde::{Deserialize, Serialize};

use super::json::Pick;
use super::malformed::Malformed;
use super::plan::Plan;
use super::protobuf::ProtobufPlan;

/// Encoding, with the places of what is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Encoding {
    /// Each message states which of these it uses.
    Cdr {
        xcdr1: Plan,
        xcdr2: Plan,
        delimited: Plan,
    },
    Ros1(Plan),
    Protobuf(ProtobufPlan),
    Json(Pick),
}

/// Plan for the encapsulation that a message states, and whether its numbers are big-endian.
pub(super) fn encapsulated<'p>(
    data: &[u8],
    xcdr1: &'p Plan,
    xcdr2: &'p Plan,
    delimited: &'p Plan,
) -> Result<(&'p Plan, bool), Malformed> {
    let truncated = Malformed::Truncated { offset: 0, wanted: HEADER, len: data.len() };
    let &[high, low, ..] = data.first_chunk::<HEADER>().ok_or(truncated)?;
    let identifier = u16::from_be_bytes([high, low]);
    // Identifiers of DDS-XTypes 1.3 and, from 0x10 on, those of its drafts that are still in use.
    let plan = match identifier {
        0x00 | 0x01 => xcdr1,
        0x06 | 0x07 | 0x10 | 0x11 => xcdr2,
        0x08 | 0x09 | 0x14 | 0x15 => delimited,
        _ => return Err(Malformed::Encapsulation { identifier }),
    };
    Ok((plan, identifier.is_multiple_of(2)))
}

/// Length of the encapsulation header: a representation identifier and two bytes of options.
pub(super) const HEADER: usize = 4;
