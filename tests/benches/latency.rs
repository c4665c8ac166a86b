//! From the last byte of a chunk readable to its segments and calibrations readable in the sidecar of a `stillpoint
//! tail`, while a recorder writes 50 MB/s of camera and IMU; what an idle tail costs; and how long a save holds the reader
//! up after 40,000 chunks of 41 channels.
//!
//! `cargo bench --bench latency`; `STILLPOINT_LATENCY_S=30` measures for longer.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

#[path = "../common/many_channels.rs"]
mod many_channels;

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions, Writer};
use stillpoint::record::{Event, Scan};
use stillpoint::simulate::{Scenario, record};

/// Bytes of a chunk, nearly all of them an image.
const CHUNK: usize = 1 << 20;
/// Bytes a second.
const RATE: f64 = 50e6;
/// IMU messages in a chunk: 1.6 s, in which one rest ends.
const IMU: usize = 160;

fn main() {
    let benchmark = std::env::args().any(|argument| argument == "--bench");
    let seconds =
        std::env::var("STILLPOINT_LATENCY_S").map_or(if benchmark { 10.0 } else { 0.5 }, |s| s.parse().unwrap());
    let chunks = (seconds * RATE / CHUNK as f64) as usize;
    let folder = tempfile::tempdir().unwrap();
    let (recording, sidecar) = (folder.path().join("rec.mcap"), folder.path().join("rec.stillpoint.mcap"));
    let session = session(chunks);
    let (written, done) = (Mutex::new(BTreeMap::new()), AtomicBool::new(false));
    let mut tail = start(folder.path());
    let seen = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        scope.spawn(|| observe(&sidecar, &seen, &done));
        write(&recording, &session, chunks, &written);
        // A disk that is busy with what others wrote may hold a tail up for seconds.
        let written = Instant::now();
        while seen.lock().unwrap().len() * 2 <= chunks && written.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(20));
        }
        idle(&tail, Duration::from_secs_f64(if benchmark { 10.0 } else { 1.0 }));
        done.store(true, Ordering::Relaxed);
    });
    let seen = seen.into_inner().unwrap();
    tail.kill().unwrap();
    tail.wait().unwrap();

    let written = written.into_inner().unwrap();
    let mut latencies: Vec<_> = seen
        .iter()
        .filter_map(|(log_time, at)| {
            written.range(log_time..).next().map(|(_, written)| at.saturating_duration_since(*written))
        })
        .collect();
    latencies.sort();
    assert!(latencies.len() * 2 > chunks, "{} annotations seen for {chunks} chunks", latencies.len());
    let quantile = |q: f64| latencies[((latencies.len() - 1) as f64 * q) as usize].as_secs_f64() * 1e3;
    println!(
        "{} segments and calibrations at {:.0} MB/s: p50 {:.1} ms, p99 {:.1} ms, at most {:.1} ms (20 ms of it the poll)",
        latencies.len(),
        RATE * 1e-6,
        quantile(0.5),
        quantile(0.99),
        quantile(1.0)
    );
    let chunks = if benchmark { 40_000 } else { 400 };
    let (length, encoding) = many_channels::checkpoint(chunks);
    println!(
        "a checkpoint after {chunks} chunks of 41 channels: {:.0} kB, encoded in {:.2} ms",
        length as f64 * 1e-3,
        encoding.as_secs_f64() * 1e3
    );
}

fn start(folder: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
    command.args(["tail", "rec.mcap", "-q"]).current_dir(folder).stdin(Stdio::null());
    command.spawn().unwrap()
}

/// A session in which one rest ends in every chunk.
fn session(chunks: usize) -> Vec<u8> {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.motion.duration_s = 0.4;
    let faces = scenario.pose[..6].to_vec();
    scenario.pose = faces.iter().cycle().take(chunks + 4).cloned().collect();
    scenario.pose.iter_mut().for_each(|pose| pose.rest_s = 1.2);
    let mut bytes = Vec::new();
    record(&scenario, &mut bytes).unwrap();
    bytes
}

/// Writes chunk by chunk, and notes when the last byte of each could be read, by the log time of its last message.
fn write(path: &Path, session: &[u8], chunks: usize, written: &Mutex<BTreeMap<u64, Instant>>) {
    let options = WriteOptions::new().profile("ros2").compression(None).disable_seeking(true).chunk_size(None);
    let mut writer = Writer::with_options(File::create(path).unwrap(), options).unwrap();
    let image = writer.add_channel(0, "/camera", "raw", &BTreeMap::new()).unwrap();
    let pixels = vec![0x5A; CHUNK];
    let mut messages = MessageStream::new(session).unwrap().map(Result::unwrap);
    let mut channel = None;
    let began = Instant::now();
    for chunk in 0..chunks {
        let mut last = 0;
        for message in messages.by_ref().take(IMU) {
            let channel_id = *channel.get_or_insert_with(|| {
                let schema = message.channel.schema.as_ref().unwrap();
                let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
                writer.add_channel(schema, &message.channel.topic, "cdr", &BTreeMap::new()).unwrap()
            });
            last = message.log_time;
            let header = MessageHeader { channel_id, sequence: 0, log_time: last, publish_time: last };
            writer.write_to_known_channel(&header, &message.data).unwrap();
        }
        let header = MessageHeader { channel_id: image, sequence: 0, log_time: last, publish_time: last };
        writer.write_to_known_channel(&header, &pixels).unwrap();
        let due = Duration::from_secs_f64((chunk * CHUNK) as f64 / RATE);
        std::thread::sleep(due.saturating_sub(began.elapsed()));
        writer.flush().unwrap();
        written.lock().unwrap().insert(last, Instant::now());
    }
    println!("recorded at {:.0} MB/s", (chunks * CHUNK) as f64 * 1e-6 / began.elapsed().as_secs_f64());
    // The recorder never finishes: what follows is an idle tail.
    std::mem::forget(writer);
}

/// Reads the sidecar as it grows: the log time of each segment and calibration, and when it could be read.
fn observe(sidecar: &Path, seen: &Mutex<Vec<(u64, Instant)>>, done: &AtomicBool) {
    let (mut scan, mut wanted) = (Scan::new(), Vec::new());
    let mut file = None;
    while !done.load(Ordering::Relaxed) {
        let Some(file) = file.as_ref() else {
            file = File::open(sidecar).ok();
            continue;
        };
        scan.extend(file.metadata().unwrap().len());
        loop {
            match scan.next_event() {
                Ok(Event::Read { offset, length }) => {
                    file.read_exact_at(scan.insert(length), offset).unwrap();
                    scan.notify_read(length);
                }
                Ok(Event::Channel(channel))
                    if channel.topic.ends_with("/segment") || channel.topic.ends_with("/calibration") =>
                {
                    wanted.push(channel.id);
                }
                Ok(Event::Message(message)) if wanted.contains(&message.channel) => {
                    seen.lock().unwrap().push((message.log_time, Instant::now()));
                }
                Ok(Event::Wait | Event::End) | Err(_) => break,
                Ok(_) => {}
            }
        }
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// What a tail costs that has nothing to do.
fn idle(tail: &Child, time: Duration) {
    let ticks = || {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", tail.id())).ok()?;
        let fields: Vec<u64> =
            stat.rsplit_once(')')?.1.split_whitespace().skip(11).take(2).map_while(|f| f.parse().ok()).collect();
        Some(fields.iter().sum::<u64>())
    };
    std::thread::sleep(Duration::from_millis(500));
    let before = ticks();
    std::thread::sleep(time);
    if let (Some(before), Some(after)) = (before, ticks()) {
        // A tick is a hundredth of a second.
        println!("an idle tail: {:.2} % of a core", (after - before) as f64 / time.as_secs_f64());
    }
}
