//! Events reported while a recording is followed.

use std::time::Duration;

use crate::engine;
use crate::record::{Annotation, Channel, Damage, Message, Schema, Topic};
use crate::report::Findings;
use crate::still::Status;

/// Receiver of notices.
pub type Notify<'a> = &'a mut dyn FnMut(Notice<'_>);

/// One reported event.
#[derive(Clone, Copy, Debug)]
pub enum Notice<'a> {
    /// The recording is missing or empty: its recorder is about to start.
    Awaited,
    /// The recording exists. The results of a killed run up to this byte are reused.
    Opened(u64),
    /// The recording continues in this file of its folder.
    Split(&'a str),
    /// A channel of the recording, before its first message.
    Channel {
        /// Channel record.
        channel: &'a Channel,
        /// Schema of its messages, if any.
        schema: Option<&'a Schema>,
    },
    /// A message of the recording that is used.
    Message {
        /// Message as recorded.
        message: &'a Message<'a>,
        /// Number of samples in it.
        samples: usize,
    },
    /// A new result.
    Annotation {
        /// Output name of the IMU, empty if it concerns the whole recording.
        imu: &'a str,
        /// Topic that it is written to.
        topic: &'a Topic,
        /// Annotation as written.
        annotation: &'a Annotation,
        /// Content of the annotation.
        event: &'a engine::Event,
    },
    /// A corrected message was written.
    Corrected {
        /// Topic that it is written to.
        topic: &'a Topic,
        /// Message as written.
        annotation: &'a Annotation,
    },
    /// State of one IMU, each time before [`Notice::Read`].
    Imu {
        /// Findings so far.
        findings: &'a Findings,
        /// State of rest, and noise floor.
        status: Status,
    },
    /// Damage in the recording.
    Damage(&'a Damage),
    /// All existing bytes have been read.
    Read(Progress),
    /// The state was encoded, to be saved. No other event comes meanwhile.
    Saved {
        /// Length of the checkpoint in bytes.
        length: u64,
        /// Time that the encoding held the reader up.
        encoding: Duration,
    },
    /// A problem, after which the operation is retried.
    Trouble(&'a str),
    /// The recording has ended, for this reason. The annotated recording is being written.
    Ended(Ending),
}

/// Progress of following a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Bytes whose messages were used.
    pub read: u64,
    /// Bytes of the recording so far.
    pub length: u64,
    /// Bytes of the sidecar.
    pub sidecar: u64,
}

/// Reason why a recording has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The recorder finished the recording.
    Finished,
    /// Nothing was added for the idle timeout.
    Idle,
    /// The file was deleted; its bytes are still available.
    Deleted,
    /// Another file has its name now; its bytes are still available.
    Replaced,
    /// The file became shorter than what had been read of it, so its bytes are lost.
    Truncated,
}
