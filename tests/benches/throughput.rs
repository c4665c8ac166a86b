//! The Rust half of `throughput.py`: makes recordings, and does what Stillpoint is compared with, by the `mcap` crate.
//!
//! `throughput make KIND BYTES FILE`, `throughput read FILE`, `throughput check FILE`, `throughput rewrite FILE OUT`; without arguments, a
//! try of all on little ones.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read as _};
use std::path::Path;

use mcap::records::MessageHeader;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Compression, WriteOptions};
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["make", kind, bytes, file] => make(kind, bytes.parse().unwrap(), Path::new(file)),
        ["read", file] => println!("{}", read(Path::new(file), false)),
        ["check", file] => println!("{}", read(Path::new(file), true)),
        ["rewrite", file, out] => rewrite(Path::new(file), Path::new(out)),
        _ => try_all(),
    }
}

fn try_all() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("a.mcap"), folder.path().join("b.mcap"));
    for kind in ["none", "lz4", "zstd", "frames", "imu", "small"] {
        make(kind, 3_000_000, &file);
        let messages = read(&file, false);
        rewrite(&file, &out);
        assert!(messages > 0 && read(&out, true) == messages, "{kind}");
    }
}

/// A camera of 30 frames a second, every one of them different, beside an IMU at 400 Hz; or the IMU alone.
fn make(kind: &str, bytes: u64, path: &Path) {
    let (compression, camera, chunk) = match kind {
        "none" => (None, Some(Frames::Random), 1 << 20),
        "lz4" => (Some(Compression::Lz4), Some(Frames::Random), 1 << 20),
        "zstd" => (Some(Compression::Zstd), Some(Frames::Random), 1 << 20),
        "frames" => (Some(Compression::Zstd), Some(Frames::Raw), 1 << 20),
        "imu" => (Some(Compression::Zstd), None, 1 << 20),
        // 150,000 chunks in a gigabyte.
        "small" => (None, Some(Frames::Random), 7_000),
        other => panic!("no such kind: {other}"),
    };
    let file = BufWriter::with_capacity(1 << 20, File::create(path).unwrap());
    let options = WriteOptions::new().profile("ros2").library("throughput").compression(compression);
    let options = options.chunk_size(Some(chunk)).compression_threads(0);
    let mut writer = options.create(file).unwrap();
    let schema = stillpoint_schema(&mut writer);
    let imu = writer.add_channel(schema, "/imu/data", "cdr", &BTreeMap::new()).unwrap();
    let image = writer.add_schema("sensor_msgs/msg/CompressedImage", "ros2msg", b"uint8[] data").unwrap();
    let image = writer.add_channel(image, "/camera/image", "cdr", &BTreeMap::new()).unwrap();

    let mut random = ChaCha8Rng::seed_from_u64(1);
    let size = if kind == "small" { 6_600 } else { 300_000 };
    let mut frame = vec![0; size];
    let mut written = 0;
    for n in 0.. {
        if written >= bytes {
            break;
        }
        let log_time = 1_700_000_000_000_000_000 + n * 2_500_000;
        let mut put = |channel_id, data: &[u8]| {
            let header = MessageHeader { channel_id, sequence: n as u32, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, data).unwrap();
            written += data.len() as u64;
        };
        let due = n * 30 / 400 != (n + 1) * 30 / 400 || kind == "small";
        if let Some(frames) = camera.filter(|_| due) {
            frames.fill(&mut frame, &mut random);
            put(image, &frame);
        }
        put(imu, &reading(n, log_time, &mut random));
    }
    writer.finish().unwrap();
}

#[derive(Clone, Copy)]
enum Frames {
    /// As JPEG is: nothing to compress.
    Random,
    /// Smooth pictures with a noisy last bit or two.
    Raw,
}

impl Frames {
    fn fill(self, frame: &mut [u8], random: &mut ChaCha8Rng) {
        random.fill_bytes(frame);
        if let Self::Raw = self {
            let phase: u32 = random.random_range(0..640);
            for (pixel, i) in frame.iter_mut().zip(phase..) {
                *pixel = (i / 5 % 128) as u8 + (*pixel & 3);
            }
        }
    }
}

fn stillpoint_schema<W: std::io::Write + std::io::Seek>(writer: &mut mcap::Writer<W>) -> u16 {
    let rule = "================================================================================\n";
    let vector = |name: &str, fields: &str| {
        let fields: String = fields.chars().map(|axis| format!("float64 {axis}\n")).collect();
        format!("{rule}MSG: geometry_msgs/{name}\n{fields}")
    };
    let text = [
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n",
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n",
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
        &format!("{rule}MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"),
        &format!("{rule}MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"),
        &vector("Quaternion", "xyzw"),
        &vector("Vector3", "xyz"),
    ];
    writer.add_schema("sensor_msgs/msg/Imu", "ros2msg", text.concat().as_bytes()).unwrap()
}

/// Six faces, three seconds each, with a second of motion in between.
fn reading(n: u64, stamp: u64, random: &mut ChaCha8Rng) -> Vec<u8> {
    let (face, within) = (n / 1600 % 6, n % 1600);
    let moving = if within >= 1200 { 3.0 } else { 0.0 };
    let mut noise = |std: f64| {
        let sum: f64 = (0..4).map(|_| random.random_range(-1.0..1.0)).sum();
        std * sum * 0.866
    };
    let mut values = Vec::new();
    for axis in 0..3 {
        values.push(0.01 * (axis as f64 - 1.0) + noise(0.002) + moving * noise(0.3));
    }
    for axis in 0..3 {
        let up = if face / 2 == axis { 9.80665 * (1.0 - 2.0 * (face % 2) as f64) } else { 0.0 };
        values.push(0.1 * (axis as f64 - 1.0) + 1.003 * up + noise(0.03) + moving * noise(1.0));
    }
    let mut out = vec![0, 1, 0, 0];
    out.extend(((stamp / 1_000_000_000) as i32).to_le_bytes());
    out.extend(((stamp % 1_000_000_000) as u32).to_le_bytes());
    out.extend(4_u32.to_le_bytes());
    out.extend(b"imu\0");
    let mut put = |values: &[f64]| values.iter().for_each(|value| out.extend(value.to_le_bytes()));
    put(&[0.0, 0.0, 0.0, 1.0]);
    put(&[0.0; 9]);
    put(&values[..3]);
    put(&[0.0; 9]);
    put(&values[3..]);
    put(&[0.0; 9]);
    out
}

/// The fastest way to the messages of one channel: one thread, reads of 1 MiB, the CRCs of chunks checked or not.
fn read(path: &Path, checked: bool) -> u64 {
    let mut file = File::open(path).unwrap();
    let options = LinearReaderOptions::default().with_record_length_limit(1 << 30).with_validate_chunk_crcs(checked);
    let mut reader = LinearReader::new_with_options(options);
    let (mut imu, mut messages, mut sum) = (None, 0, 0.0);
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = file.read(reader.insert(wanted.max(1 << 20))).unwrap();
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode: mcap::records::op::CHANNEL, data } => {
                let mcap::records::Record::Channel(channel) =
                    mcap::parse_record(mcap::records::op::CHANNEL, data).unwrap()
                else {
                    continue;
                };
                imu = imu.or((channel.topic == "/imu/data").then_some(channel.id));
            }
            LinearReadEvent::Record { opcode: mcap::records::op::MESSAGE, data } => {
                let channel = u16::from_le_bytes(*data.first_chunk().unwrap());
                if Some(channel) == imu {
                    messages += 1;
                    sum += f64::from_le_bytes(*data[22 + 20 + 176..].first_chunk().unwrap());
                }
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    std::hint::black_box(sum);
    messages
}

/// What a program does that knows nothing of chunks: every message through `mcap::Writer`, with zstd.
fn rewrite(path: &Path, out: &Path) {
    let file = std::fs::read(path).unwrap();
    let out = BufWriter::with_capacity(1 << 20, File::create(out).unwrap());
    let mut writer =
        WriteOptions::new().compression(Some(Compression::Zstd)).compression_threads(0).create(out).unwrap();
    for message in mcap::MessageStream::new(&file).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
}
