//! Events to message bytes and back: the topic of an event, its encoding, and its block.
//!
//! The stamp in a message's header is the engine's; [`record`](crate::record) adds ids and chunks. The result is a function of the events and of the ends of the input's chunks, never of wall-clock time.

mod block;
mod cdr;
mod config;
mod correct;
pub mod diagnostics;
mod encoding;
mod log;
mod read;
mod ros2;
mod ros2msg;

pub use config::{Corrected, EncodingChoice, OutputConfig};
pub use correct::{Corrections, is_only_partial};
pub use encoding::Encoding;
pub use read::{ReadError, read};

use serde::{Deserialize, Serialize};

use crate::engine::{Event, Message};
use crate::record::{Annotation, Block, Topic};
use crate::topic::{self, Kind};
use block::OpenBlock;

/// Converts events to blocks of annotations.
///
/// ```
/// use stillpoint::annotate::{Annotator, Encoding};
/// use stillpoint::engine::{Event, Message};
/// use stillpoint::messages::Stillness;
/// use stillpoint::topic;
///
/// let mut annotator = Annotator::new(Encoding::Protobuf);
/// let event = Event { log_time: 1, message: Message::Stillness(Stillness::default()) };
/// assert!(annotator.push("/imu/data", &event).is_none());
/// let block = annotator.finish().unwrap();
/// assert_eq!(block.annotations.len(), 1);
/// assert_eq!(annotator.topics()[0].name, topic::of("/imu/data", topic::Kind::Stillness));
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Annotator {
    encoding: Encoding,
    topics: Vec<Topic>,
    /// Next sequence number of each topic.
    sequences: Vec<u32>,
    open: OpenBlock,
}

impl Annotator {
    /// Annotator without topics. Each topic is created with its first message.
    pub fn new(encoding: Encoding) -> Self {
        Self { encoding, topics: Vec::new(), sequences: Vec::new(), open: OpenBlock::default() }
    }

    /// Topics so far, in the order of their first messages. Annotations refer to them by index.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Adds an event of the IMU with this output name. Returns the block that had to be closed before it, if any.
    pub fn push(&mut self, imu: &str, event: &Event) -> Option<Block> {
        let (name, encoding) = (topic::of(imu, kind_of(&event.message)), self.encoding);
        let place = self.place_of(&name, || encoding.topic(name.clone(), &event.message));
        let annotation = self.annotation(place, event.log_time, encoding.encode(&event.message));
        let urgent = matches!(event.message, Message::Segment(_) | Message::Calibration(_));
        self.open.push(annotation, urgent)
    }

    /// Adds a message whose bytes are already encoded. `topic` creates its topic if there is none of this name yet.
    pub fn push_message(
        &mut self,
        name: &str,
        topic: impl FnOnce() -> Topic,
        log_time: u64,
        data: Vec<u8>,
    ) -> Option<Block> {
        let place = self.place_of(name, topic);
        let annotation = self.annotation(place, log_time, data);
        self.open.push(annotation, false)
    }

    /// Must be called at the end of each chunk of the input, and after each of its messages outside chunks.
    pub fn input_chunk_ended(&mut self) -> Option<Block> {
        if self.open.is_urgent() { self.open.close() } else { None }
    }

    /// Annotations of the block that is still open.
    pub fn open(&self) -> &[Annotation] {
        self.open.annotations()
    }

    /// Last block.
    pub fn finish(&mut self) -> Option<Block> {
        self.open.close()
    }

    /// Index of the topic with this name, which is added if needed.
    fn place_of(&mut self, name: &str, topic: impl FnOnce() -> Topic) -> usize {
        if let Some(known) = self.topics.iter().position(|topic| topic.name == name) {
            return known;
        }
        self.topics.push(topic());
        self.sequences.push(0);
        self.topics.len() - 1
    }

    /// Next annotation on a topic.
    fn annotation(&mut self, topic: usize, log_time: u64, data: Vec<u8>) -> Annotation {
        let sequence = self.sequences[topic];
        self.sequences[topic] = sequence.wrapping_add(1);
        Annotation { topic, sequence, log_time, data }
    }
}

/// Kind of topic for a message.
fn kind_of(message: &Message) -> Kind {
    match message {
        Message::Stillness(_) => Kind::Stillness,
        Message::Segment(_) => Kind::Segment,
        Message::Turn(_) => Kind::Turn,
        Message::Noise(_) => Kind::Noise,
        Message::Coverage(_) => Kind::Coverage,
        Message::Calibration(_) => Kind::Calibration,
        Message::Log(_) => Kind::Log,
    }
}
