//! Recorders that are not ours: the Rust writer of the MCAP project, in the ways in which it is used.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use mcap::{Compression, MessageStream, WriteOptions, Writer};

use crate::common::recording;

/// A session to record: messages, and when each is due.
pub struct Session {
    profile: String,
    messages: Vec<mcap::Message<'static>>,
}

/// How a recorder writes.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    pub compression: Option<Compression>,
    pub seeking: bool,
    /// Through a buffer of 8 KiB, as most do.
    pub buffered: bool,
    /// Flushes after so many messages.
    pub flush: Option<usize>,
    pub chunk: u64,
}

impl Default for Style {
    fn default() -> Self {
        Self { compression: Some(Compression::Zstd), seeking: true, buffered: true, flush: None, chunk: 16 << 10 }
    }
}

impl Session {
    /// The real six-face session, or the demonstration where there are no real ones.
    pub fn six_faces() -> Self {
        let path = recording("nilspod_six_face.ros2.mcap");
        let path = path.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata/demo.mcap"));
        Self::of(&std::fs::read(path).unwrap())
    }

    /// What a recording holds.
    pub fn of(bytes: &[u8]) -> Self {
        let messages = MessageStream::new(bytes).unwrap().map(|message| {
            let mcap::Message { channel, sequence, log_time, publish_time, data } = message.unwrap();
            mcap::Message { channel, sequence, log_time, publish_time, data: data.into_owned().into() }
        });
        let profile = if bytes[..60].windows(4).any(|four| four == b"ros2") { "ros2" } else { "" };
        Self { profile: profile.to_owned(), messages: messages.collect() }
    }

    pub fn len(&self) -> usize {
        self.messages.len()
    }

    /// Records to a file, so many times faster than it was.
    pub fn record(&self, path: &Path, style: Style, speed: f64) {
        let file = File::create(path).unwrap();
        match style.buffered {
            true => self.write(BufWriter::new(file), style, speed, |_| true),
            false => self.write(file, style, speed, |_| true),
        }
    }

    /// Records as long as `goes_on` with the number of messages written; one that stops never finishes.
    pub fn record_while(&self, path: &Path, style: Style, speed: f64, goes_on: impl FnMut(usize) -> bool) {
        self.write(File::create(path).unwrap(), style, speed, goes_on);
    }

    fn write<W: Write + Seek>(&self, file: W, style: Style, speed: f64, mut goes_on: impl FnMut(usize) -> bool) {
        let options = WriteOptions::new().profile(&self.profile).compression(style.compression);
        let options = options.chunk_size(Some(style.chunk)).disable_seeking(!style.seeking).compression_threads(0);
        let mut writer = Writer::with_options(file, options).unwrap();
        let mut channels = BTreeMap::new();
        let (began, first) = (Instant::now(), self.messages.first().map_or(0, |message| message.log_time));
        for (i, message) in self.messages.iter().enumerate() {
            let due = Duration::from_nanos(((message.log_time - first) as f64 / speed) as u64);
            if let Some(early) = due.checked_sub(began.elapsed()).filter(|early| early.as_micros() > 500) {
                std::thread::sleep(early);
            }
            if !goes_on(i) {
                // A recorder that is killed does not finish.
                std::mem::forget(writer);
                return;
            }
            let channel = *channels.entry(message.channel.id).or_insert_with(|| {
                let schema = message.channel.schema.as_ref().unwrap();
                let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
                let mcap::Channel { topic, message_encoding, metadata, .. } = &*message.channel;
                writer.add_channel(schema, topic, message_encoding, metadata).unwrap()
            });
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: message.sequence,
                log_time: message.log_time,
                publish_time: message.publish_time,
            };
            writer.write_to_known_channel(&header, &message.data).unwrap();
            if style.flush.is_some_and(|every| i % every == every - 1) {
                writer.flush().unwrap();
            }
        }
        writer.finish().unwrap();
    }
}

/// So many times faster than real time.
pub fn speed() -> f64 {
    std::env::var("STILLPOINT_SPEED").map_or(200.0, |speed| speed.parse().unwrap())
}
