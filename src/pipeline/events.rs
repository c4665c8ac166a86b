//! What is told while a recording is followed. Showing it, on a terminal, as lines or to a viewer, is left to who is told.

use crate::engine;
use crate::record::{Annotation, Channel, Damage, Message, Schema, Topic};
use crate::report::Findings;
use crate::still::Status;

/// Whom to tell.
pub type Tell<'a> = &'a mut dyn FnMut(News<'_>);

/// One thing that happened.
#[derive(Clone, Copy, Debug)]
pub enum News<'a> {
    /// The recording is missing or empty: its recorder is about to start.
    Awaited,
    /// The recording is there. What a killed run had done to this byte is taken over.
    Opened(u64),
    /// The recording goes on in this file of its folder.
    Split(&'a str),
    /// A channel of the recording, before its first message.
    Channel {
        /// Its record.
        channel: &'a Channel,
        /// The schema of its messages, if it has one.
        schema: Option<&'a Schema>,
    },
    /// A message of the recording that is used.
    Message {
        /// As it was recorded.
        message: &'a Message<'a>,
        /// How many samples it held.
        samples: usize,
    },
    /// Something was learned.
    Annotation {
        /// Output name of the IMU, empty for what concerns all of the recording.
        imu: &'a str,
        /// Where it is written to.
        topic: &'a Topic,
        /// How it is written.
        annotation: &'a Annotation,
        /// What it says.
        event: &'a engine::Event,
    },
    /// A corrected message was written.
    Corrected {
        /// Where it is written to.
        topic: &'a Topic,
        /// The message.
        annotation: &'a Annotation,
    },
    /// How one IMU stands, each time before [`News::Read`].
    Imu {
        /// What was learned so far.
        findings: &'a Findings,
        /// Whether it rests, and its noise floor.
        status: Status,
    },
    /// Something is wrong with the recording.
    Damage(&'a Damage),
    /// All that is there has been read.
    Read(Progress),
    /// Something is in the way, and is tried again.
    Trouble(&'a str),
    /// Nothing more is recorded, and why. The annotated recording is being written.
    Ended(Ending),
}

/// How far a recording has been followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Bytes whose messages were used.
    pub read: u64,
    /// Bytes that are there.
    pub length: u64,
    /// Bytes of the sidecar.
    pub sidecar: u64,
}

/// Why nothing more is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The recorder finished the recording.
    Finished,
    /// Nothing was added for the idle timeout.
    Idle,
    /// The file was deleted; its bytes are still at hand.
    Deleted,
    /// Another file has its name now; its bytes are still at hand.
    Replaced,
    /// The file became shorter than what had been read of it, so that its bytes are lost.
    Truncated,
}
