//! Recordings to be scanned: written by the `mcap` crate, and then mistreated.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

use mcap::records::{MessageHeader, Metadata};
use mcap::write::PrivateRecordOptions;
use mcap::{Attachment, Compression, WriteOptions};
use proptest::prelude::*;

use crate::needs::{self, data};

/// What a recording shall hold.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// 0 none, 1 lz4, 2 zstd.
    pub compression: u8,
    pub chunked: bool,
    pub summary: bool,
    pub data_crc: bool,
    /// Channel, log time, bytes.
    pub messages: Vec<(u16, u64, usize)>,
    pub attachments: Vec<Vec<u8>>,
    pub metadata: usize,
    pub private: bool,
}

impl Recipe {
    pub fn plain() -> Self {
        Self {
            compression: 2,
            chunked: true,
            summary: true,
            data_crc: true,
            messages: (0..40).map(|n| (n % 3, 10 * u64::from(n), 50)).collect(),
            attachments: vec![vec![1; 300]],
            metadata: 1,
            private: true,
        }
    }

    pub fn write(&self) -> Vec<u8> {
        let compression = match self.compression {
            0 => None,
            1 => Some(Compression::Lz4),
            _ => Some(Compression::Zstd),
        };
        let mut out = Cursor::new(Vec::new());
        let mut writer = WriteOptions::new()
            .profile("ros2")
            .library("test")
            .compression(compression)
            .compression_threads(0)
            .use_chunks(self.chunked)
            .chunk_size(Some(400))
            .calculate_data_section_crc(self.data_crc)
            .emit_summary_records(self.summary)
            .emit_summary_offsets(self.summary)
            .create(&mut out)
            .unwrap();
        let schema = writer.add_schema("sensor_msgs/msg/Imu", "ros2msg", b"float64 x").unwrap();
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), "-".to_owned())]);
        let channels: Vec<u16> = (0..3)
            .map(|n| writer.add_channel(schema * (n % 2), &format!("/topic{n}"), "cdr", &metadata).unwrap())
            .collect();
        for (sequence, &(channel, log_time, length)) in self.messages.iter().enumerate() {
            let header = MessageHeader {
                channel_id: channels[usize::from(channel)],
                sequence: sequence as u32,
                log_time,
                publish_time: log_time / 2,
            };
            let data: Vec<u8> = (0..length).map(|n| (n * sequence) as u8).collect();
            writer.write_to_known_channel(&header, &data).unwrap();
            if sequence == self.messages.len() / 2 {
                self.write_extras(&mut writer);
            }
        }
        if self.messages.is_empty() {
            self.write_extras(&mut writer);
        }
        writer.finish().unwrap();
        drop(writer);
        out.into_inner()
    }

    fn write_extras(&self, writer: &mut mcap::Writer<&mut Cursor<Vec<u8>>>) {
        for data in &self.attachments {
            let attachment = Attachment {
                log_time: 5,
                create_time: 6,
                name: "calibration.yaml".to_owned(),
                media_type: "text/yaml".to_owned(),
                data: Cow::Borrowed(data),
            };
            writer.attach(&attachment).unwrap();
        }
        for n in 0..self.metadata {
            let entries = BTreeMap::from([("key".to_owned(), n.to_string())]);
            writer.write_metadata(&Metadata { name: "robot".to_owned(), metadata: entries }).unwrap();
        }
        if self.private {
            writer.write_private_record(0x90, b"ours", PrivateRecordOptions::IncludeInChunks.into()).unwrap();
            writer.write_private_record(0x91, b"outside", Default::default()).unwrap();
        }
    }
}

pub fn recipes() -> impl Strategy<Value = Recipe> {
    let message = (0_u16..3, 1_u64..1000, 0_usize..200);
    (
        (0_u8..3, prop::bool::weighted(0.7), prop::bool::weighted(0.7), any::<bool>()),
        prop::collection::vec(message, 0..60),
        prop::collection::vec(prop::collection::vec(any::<u8>(), 0..100), 0..3),
        0_usize..3,
        any::<bool>(),
    )
        .prop_map(|((compression, chunked, summary, data_crc), messages, attachments, metadata, private)| Recipe {
            compression,
            chunked,
            summary,
            data_crc,
            messages,
            attachments,
            metadata,
            private,
        })
}

/// A recording that may be cut off, and may have wrong bytes and lost sectors. Its magic is in order.
pub fn mistreated() -> impl Strategy<Value = Vec<u8>> {
    let cut = prop::option::of(any::<prop::sample::Index>());
    let corruptions = prop::collection::vec((any::<prop::sample::Index>(), 1_u8..), 0..3);
    let sector = prop::option::weighted(0.2, (any::<prop::sample::Index>(), 1_usize..300));
    (recipes(), cut, corruptions, sector).prop_map(|(recipe, cut, corruptions, sector)| {
        let mut file = recipe.write();
        if let Some(cut) = cut {
            file.truncate(8 + cut.index(file.len() - 7));
        }
        let behind = &mut file[8..];
        if behind.is_empty() {
            return file;
        }
        for (place, flip) in corruptions {
            behind[place.index(behind.len())] ^= flip;
        }
        if let Some((place, length)) = sector {
            let start = place.index(behind.len());
            let end = behind.len().min(start + length);
            behind[start..end].fill(0);
        }
        file
    })
}

/// An input that failed once, unless they are not there.
pub fn case(name: &str) -> Option<Vec<u8>> {
    needs::case(name).map(|path| std::fs::read(path).unwrap())
}

/// The recordings of others, unless they are not there.
pub fn shared() -> Vec<(PathBuf, Vec<u8>)> {
    let folders = ["containers", "recordings", "recordings/nilspod_six_face.rosbag2"];
    let mut files: Vec<PathBuf> = folders
        .iter()
        .filter_map(|folder| data(folder))
        .flat_map(|folder| std::fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "mcap"))
        .collect();
    files.sort();
    files.into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}
