//! A recording of many chunks and channels that its recorder has not finished, and what a tail saves of it.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::time::Duration;

use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions, Writer};
use stillpoint::config::Config;
use stillpoint::run::{self, Following, Notice, Options, Stop};
use stillpoint::simulate::{Scenario, record};

/// Channels beside the IMU.
const OTHERS: u32 = 40;

/// Writes so many chunks, each with one message of each channel. The IMU rests, so that nothing is learned on the way.
fn write(path: &Path, chunks: usize) {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.pose.truncate(1);
    scenario.pose[0].rest_s = chunks as f64 / 100.0 + 5.0;
    let mut session = Vec::new();
    record(&scenario, &mut session).unwrap();
    let options = WriteOptions::new().profile("ros2").compression(None).disable_seeking(true).chunk_size(None);
    let mut writer = Writer::with_options(File::create(path).unwrap(), options).unwrap();
    let channel = |n| (n, BTreeMap::new());
    let others = (0..OTHERS).map(channel).map(|(n, none)| writer.add_channel(0, &format!("/other/{n}"), "raw", &none));
    let others: Vec<_> = others.map(Result::unwrap).collect();
    let mut imu = None;
    for message in MessageStream::new(&session).unwrap().map(Result::unwrap).take(chunks) {
        let imu = *imu.get_or_insert_with(|| {
            let schema = message.channel.schema.as_ref().unwrap();
            let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            writer.add_channel(schema, &message.channel.topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let header = |channel_id| MessageHeader {
            channel_id,
            sequence: 0,
            log_time: message.log_time,
            publish_time: message.log_time,
        };
        writer.write_to_known_channel(&header(imu), &message.data).unwrap();
        others.iter().for_each(|&other| writer.write_to_known_channel(&header(other), &[7; 8]).unwrap());
        writer.flush().unwrap();
    }
    std::mem::forget(writer);
}

/// Length of the checkpoint of a tail that has read so many chunks, in bytes, and the time that its encoding took.
pub fn checkpoint(chunks: usize) -> (u64, Duration) {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("rec.mcap"), folder.path().join("out.mcap"));
    write(&input, chunks);
    let following = Following {
        poll: Duration::from_millis(5),
        idle: Duration::from_secs(600),
        patience: Some(Duration::ZERO),
        keep_sidecar: false,
        options: Options::default(),
    };
    let (mut whole, mut saved) = (false, None);
    let mut notify = |notice: Notice<'_>| match notice {
        Notice::Read(progress) => whole = progress.read == progress.length,
        Notice::Saved { length, encoding } if whole && saved.is_none() => {
            saved = Some((length, encoding));
            // The end of the tail: what it has read is gone.
            File::create(&input).unwrap();
        }
        _ => {}
    };
    let _ = run::tail(&input, &output, &Config::default(), &following, &Stop::default(), &mut notify);
    saved.unwrap()
}
