//! Reasons why the bytes of a message are not what its schema says.

/// Reason why the bytes of a message are not what its schema says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The payload ends too early.
    #[error("the payload ends after {len} bytes, {wanted} more are expected at byte {offset}")]
    Truncated {
        /// Where the bytes are expected, from the start of the payload.
        offset: usize,
        /// How many.
        wanted: usize,
        /// Length of the payload.
        len: usize,
    },
    /// A way of writing CDR that is not read.
    #[error("the CDR encapsulation 0x{identifier:04x} ({}) is not read", encapsulation(*identifier))]
    Encapsulation {
        /// First two bytes of the payload.
        identifier: u16,
    },
    /// Not JSON.
    #[error("the payload is not JSON at line {line}, column {column}")]
    Json {
        /// Counted from 1.
        line: usize,
        /// Counted from 1.
        column: usize,
    },
    /// Bytes that are no protobuf.
    #[error("the payload is not protobuf: {what} at byte {offset}")]
    Protobuf {
        /// Byte in the payload.
        offset: usize,
        /// What stands there.
        what: &'static str,
    },
    /// A wstring could be of more than one size.
    #[error("a wstring could be of more than one size: writers do not agree, and the payload does not tell")]
    WideText,
    /// A list is too short.
    #[error("a list has {found} elements, at least {wanted} are expected")]
    Short {
        /// How many the configuration asks for.
        wanted: u32,
        /// How many there are.
        found: u32,
    },
}

/// Name of an encapsulation that is not read.
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
