//! Errors of a recording as a whole. Damage within a recording is an [event](super::Event), not an error.

use std::io;

/// Probable format of a file that begins with these bytes, and what to do about it.
fn kind(found: &[u8]) -> String {
    let begins = |with: &[u8]| found.starts_with(with);
    let what = match () {
        () if is_pointer(found) => "a Git LFS pointer, which stands for the recording; fetch it with `git lfs pull`",
        () if !found.is_empty() && found.iter().all(|&byte| byte == 0) => {
            "it begins with nothing but zeros, as a file does whose copy or download was broken off, or whose disk lost power; copy \
             it again from where it was recorded"
        }
        () if begins(&[0x28, 0xb5, 0x2f, 0xfd]) => {
            "compressed as a whole by zstd (rosbag2's compression_mode FILE, for one); decompress it with `zstd -d`"
        }
        () if begins(&[0x1f, 0x8b]) => "compressed as a whole by gzip; decompress it with `gunzip`",
        () if begins(&[0x04, 0x22, 0x4d, 0x18]) => "compressed as a whole by lz4; decompress it with `lz4 -d`",
        () if begins(b"BZh") => "compressed as a whole by bzip2; decompress it with `bunzip2`",
        () if begins(b"\x89MCAP0\n") || begins(b"\x89MCAP0\r\r\n") || begins(b"\x89MCAP0\r\r") => {
            "it was transferred as text, which changed its line ends and cannot be undone; transfer it again as binary \
             (Git: `*.mcap binary` in .gitattributes)"
        }
        () if begins(b"#ROSBAG") => "a ROS 1 bag; convert it with `mcap convert`",
        () if begins(b"SQLite") => "a rosbag2 of sqlite3; convert it with `mcap convert`",
        () if begins(b"ULog") => "a PX4 ULog; convert it to MCAP first, with PlotJuggler or Foxglove for instance",
        () if begins(&[0xfd, b'7', b'z', b'X', b'Z']) => "compressed as a whole by xz; decompress it with `unxz`",
        () if begins(b"PK") => "a zip archive; unpack it with `unzip`",
        () if begins(b"\x89HDF") => "HDF5; convert it to MCAP first",
        () if begins(b"rosbag2_") => "the metadata.yaml of a rosbag2 recording; name the folder that it stands in",
        () if begins(b"<?xml") || begins(b"{") || begins(b"[") => {
            "JSON or XML as a file of its own; write its messages into an MCAP recording, with Python's `mcap` for instance"
        }
        () if is_text(found) => {
            let text = String::from_utf8_lossy(found);
            return format!(
                "text, CSV perhaps, which begins with {:?}; write its readings into an MCAP recording first, as \
                 sensor_msgs/Imu with Python's `mcap-ros2-support` for instance",
                text.lines().next().unwrap_or_default()
            );
        }
        () => return format!("it {}; convert ROS bags with `mcap convert` first", beginning(found)),
    };
    what.to_owned()
}

/// Whether a Git LFS pointer begins like this: "version https://…", in UTF-8 or UTF-16, with or without a mark of the
/// encoding.
fn is_pointer(found: &[u8]) -> bool {
    let text = [&b"\xef\xbb\xbf"[..], b"\xff\xfe", b"\xfe\xff"].iter().find_map(|mark| found.strip_prefix(*mark));
    let text: Vec<u8> = text.unwrap_or(found).iter().copied().filter(|&byte| byte != 0).collect();
    // Of UTF-16 only half as many letters are known.
    let known = text.len().min(8);
    known >= 3 && b"version ".starts_with(text.get(..known).unwrap_or_default())
}

/// Reason why a recording cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The recording has no bytes.
    #[error("the recording is empty: was its recorder ever started?")]
    Empty,
    /// The first bytes are not the magic of MCAP.
    #[error("not an MCAP recording: {}", kind(found))]
    NotMcap {
        /// First bytes of the file.
        found: Vec<u8>,
    },
    /// The recording uses so many schema or channel ids that none are left for the annotations.
    #[error("all 65535 {kind} ids of the recording are taken; write the annotations apart with `--sidecar`")]
    NoFreeId {
        /// `schema` or `channel`.
        kind: &'static str,
    },
    /// An annotation names a topic that is not in the list of topics.
    #[error("annotation of topic {topic}, but there are {topics} topics")]
    UnknownTopic {
        /// Index in the annotation.
        topic: usize,
        /// Number of topics in the list.
        topics: usize,
    },
    /// The annotations of a chunk could not be compressed.
    #[error("cannot compress a chunk of {bytes} bytes: {cause}")]
    Chunk {
        /// Uncompressed size, in bytes.
        bytes: usize,
        /// Error of the compressor.
        cause: io::Error,
    },
    /// A growing sidecar was changed since it was written.
    #[error("the annotations at byte {offset} are not as they were written: {what}")]
    Sidecar {
        /// Offset of the damaged record.
        offset: u64,
        /// Description of the problem.
        what: String,
    },
    /// The bytes of the recording could not be read.
    #[error("cannot read the recording at byte {offset}: {cause}")]
    Read {
        /// Offset of the bytes.
        offset: u64,
        /// Error of the operating system.
        cause: io::Error,
    },
}

fn is_text(found: &[u8]) -> bool {
    !found.is_empty() && found.iter().all(|&byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace())
}

fn beginning(found: &[u8]) -> String {
    match found {
        [] => "is shorter than the first bytes of one".to_owned(),
        found => format!("begins with {found:02x?}"),
    }
}
