//! Reasons why the bytes of a message do not match its schema.

use super::lists::MOST_ELEMENTS;

/// Reason why the bytes of a message do not match its schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The payload ends too early.
    #[error("the payload ends after {len} bytes, {wanted} more are expected at byte {offset}")]
    Truncated {
        /// Offset of the expected bytes in the payload.
        offset: usize,
        /// Number of expected bytes.
        wanted: usize,
        /// Length of the payload, in bytes.
        len: usize,
    },
    /// The CDR encapsulation is not supported.
    #[error("the CDR encapsulation 0x{identifier:04x} ({}) is not read", encapsulation(*identifier))]
    Encapsulation {
        /// First two bytes of the payload.
        identifier: u16,
    },
    /// The payload is not JSON.
    #[error("the payload is not JSON at line {line}, column {column}")]
    Json {
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
    },
    /// The payload is not protobuf.
    #[error("the payload is not protobuf: {what} at byte {offset}")]
    Protobuf {
        /// Offset in the payload.
        offset: usize,
        /// Description of the bytes there.
        what: &'static str,
    },
    /// The character width of a wstring is ambiguous.
    #[error("a wstring could be of more than one size: writers do not agree, and the payload does not tell")]
    WideText,
    /// A list is too short.
    #[error("a list has {found} elements, at least {wanted} are expected")]
    Short {
        /// Number of elements that the configuration requires.
        wanted: u32,
        /// Number of elements found.
        found: u32,
    },
    /// A list of readings is longer than any sensor fills it.
    #[error("a list has more than {} readings", MOST_ELEMENTS)]
    Long,
    /// The lists of one message's readings have different lengths.
    #[error("the lists of its readings have {one} and {other} elements")]
    Uneven {
        /// Number of elements of one of them.
        one: usize,
        /// Number of elements of another.
        other: usize,
    },
    /// A message claims more readings than its lists hold.
    #[error("it claims {claimed} readings, its lists hold {held}")]
    Claims {
        /// Claimed number.
        claimed: u64,
        /// Number of elements of its lists.
        held: usize,
    },
}

/// Name of an unsupported encapsulation.
fn encapsulation(identifier: u16) -> &'static str {
    match identifier {
        0x02 | 0x03 | 0x0a | 0x0b | 0x12 | 0x13 => "a parameter list, as of @mutable types",
        0x04 => "XML",
        0x28b5 => {
            "zstd: each message is compressed, rosbag2's compression_mode MESSAGE; `ros2 bag convert` decompresses"
        }
        _ => "unknown",
    }
}
