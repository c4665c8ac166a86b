//! What can go wrong with a recording as a whole. Damage within one is an [event](super::Event), and no error.

use std::io;

/// Why a recording cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// There is nothing to read.
    #[error("the recording is empty: was its recorder ever started?")]
    Empty,
    /// The first bytes are not MCAP's.
    #[error("not an MCAP recording: it {}; convert ROS bags with `mcap convert` first", beginning(found))]
    NotMcap {
        /// The bytes that stand there.
        found: Vec<u8>,
    },
    /// The recording uses so many schema or channel ids that the annotations find none.
    #[error("all 65535 {kind} ids of the recording are taken; write the annotations apart with `--sidecar`")]
    NoFreeId {
        /// `schema` or `channel`.
        kind: &'static str,
    },
    /// An annotation names a topic that is not in the list of topics.
    #[error("annotation of topic {topic}, but there are {topics} topics")]
    UnknownTopic {
        /// Index that the annotation gives.
        topic: usize,
        /// Topics there are.
        topics: usize,
    },
    /// The annotations of a chunk could not be compressed.
    #[error("cannot compress a chunk of {bytes} bytes: {cause}")]
    Chunk {
        /// Its uncompressed size.
        bytes: usize,
        /// What the compressor says.
        cause: io::Error,
    },
    /// A sidecar that grows is not as it was written.
    #[error("the annotations at byte {offset} are not as they were written: {what}")]
    Sidecar {
        /// Where.
        offset: u64,
        /// What is wrong.
        what: String,
    },
    /// The bytes of the recording could not be had.
    #[error("cannot read the recording at byte {offset}: {cause}")]
    Read {
        /// Where.
        offset: u64,
        /// What the system says.
        cause: io::Error,
    },
}

fn beginning(found: &[u8]) -> String {
    match found {
        [] => "is shorter than the first bytes of one".to_owned(),
        found => format!("begins with {found:02x?}"),
    }
}
