//! Recordings made from arbitrary bytes: written by the `mcap` crate or record by record, then mistreated.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::ops::Range;

use arbitrary::{Result, Unstructured};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, MAGIC, WriteOptions};

/// A recording, mistreated in up to four ways. It begins as one, or it would be refused at once.
pub fn recording(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let file = if u.ratio(2, 3)? { written(u)? } else { by_hand(u)? };
    mistreated(file, u)
}

/// A sound recording of the `mcap` crate.
pub fn written(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let compression = *u.choose(&[None, Some(Compression::Lz4), Some(Compression::Zstd)])?;
    let mut out = Cursor::new(Vec::new());
    let mut writer = WriteOptions::new()
        .profile(*u.choose(&["ros2", "", "ros1"])?)
        .library("test")
        .compression(compression)
        .compression_threads(0)
        .use_chunks(u.ratio(2, 3)?)
        .chunk_size(Some(u.int_in_range(1..=1000)?))
        .calculate_data_section_crc(u.arbitrary()?)
        .emit_message_indexes(u.ratio(3, 4)?)
        .emit_summary_records(u.ratio(3, 4)?)
        .emit_summary_offsets(u.arbitrary()?)
        .create(&mut out)
        .unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Imu", "ros2msg", b"float64 x").unwrap();
    let channels: Vec<u16> = (0..u.int_in_range(1..=4)?)
        .map(|n| writer.add_channel(schema * (n % 2), &format!("/topic{n}"), "cdr", &BTreeMap::new()).unwrap())
        .collect();
    let mut log_time: u64 = u.int_in_range(0..=1000)?;
    for sequence in 0..u.int_in_range(0..=40)? {
        match u.int_in_range(0..=19)? {
            0 => {
                let data = Cow::Owned(bytes(u)?);
                let (name, media_type) = ("calibration.yaml".to_owned(), "text/yaml".to_owned());
                writer.attach(&Attachment { log_time: 5, create_time: 6, name, media_type, data }).unwrap();
            }
            1 => {
                let metadata = BTreeMap::from([("key".to_owned(), "value".to_owned())]);
                writer.write_metadata(&Metadata { name: "robot".to_owned(), metadata }).unwrap();
            }
            _ => {
                log_time = log_time.wrapping_add(u.int_in_range(0..=20)?);
                let channel_id = *u.choose(&channels)?;
                let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
                writer.write_to_known_channel(&header, &bytes(u)?).unwrap();
            }
        }
    }
    writer.finish().unwrap();
    drop(writer);
    Ok(out.into_inner())
}

/// Bytes of a message or attachment: of one kind, arbitrary, or records themselves.
fn bytes(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    Ok(match u.int_in_range(0..=7)? {
        0 => records(u, 1)?,
        1 => [MAGIC, &records(u, 1)?, MAGIC].concat(),
        2 => {
            let length = u.int_in_range(0..=40)?;
            u.bytes(length)?.to_vec()
        }
        3 => vec![0; u.int_in_range(0..=3000)?],
        _ => vec![u.arbitrary()?; u.int_in_range(0..=100)?],
    })
}

/// A recording of any records in any order.
fn by_hand(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let header = record(0x01, &[text("ros2"), text("by hand")].concat());
    let mut out = [MAGIC, &header, &records(u, 0)?].concat();
    if u.ratio(1, 2)? {
        out.extend(record(0x0F, &[0; 4]));
        let start = if u.arbitrary()? { out.len() as u64 } else { 0 };
        if start > 0 {
            out.extend(records(u, 0)?);
        }
        out.extend(record(0x02, &[&start.to_le_bytes()[..], &[0; 12]].concat()));
        out.extend(MAGIC);
    }
    Ok(out)
}

/// Some records: of the data or the summary, sound or with wrong numbers in them, chunks within chunks, too.
fn records(u: &mut Unstructured<'_>, depth: u32) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    for _ in 0..u.int_in_range(0..=if depth == 0 { 16 } else { 4 })? {
        out.extend(any_record(u, depth)?);
    }
    Ok(out)
}

fn any_record(u: &mut Unstructured<'_>, depth: u32) -> Result<Vec<u8>> {
    let id = u16::to_le_bytes(u.int_in_range(0..=3)?);
    let time = u64::to_le_bytes(number(u)?);
    let kind = u.int_in_range(0..=15)?;
    Ok(match kind {
        0 | 1 => record(0x03, &[&id[..], &text("pkg/msg/T"), &text("ros2msg"), &text("int8 x")].concat()),
        2..=4 => {
            let schema = u16::to_le_bytes(u.int_in_range(0..=3)?);
            let topic = text(u.choose(&["/a", "/b", "/a/stillpoint/segment"])?);
            record(0x04, &[&id[..], &schema, &topic, &text("cdr"), &[0; 4]].concat())
        }
        5..=8 => {
            let data = if depth < 2 && u.ratio(1, 6)? { records(u, depth + 1)? } else { b"data".to_vec() };
            record(0x05, &[&id[..], &[0; 4], &time, &time, &data].concat())
        }
        9 | 10 if depth < 3 => {
            let inner = records(u, depth + 1)?;
            let size = if u.ratio(1, 8)? { number(u)? } else { inner.len() as u64 };
            let compression = *u.choose(&["", "", "lz4", "zstd", "bz2"])?;
            let size = size.to_le_bytes();
            let length = (inner.len() as u64).to_le_bytes();
            record(0x06, &[&time[..], &time, &size, &[0; 4], &text(compression), &length, &inner].concat())
        }
        11 => {
            let data = records(u, depth + 1)?;
            let size = (data.len() as u64).to_le_bytes();
            record(0x09, &[&[0; 16][..], &text("name"), &text(""), &size, &data, &[0; 4]].concat())
        }
        12 => {
            let entries: Vec<u8> = [time, u64::to_le_bytes(number(u)?)].concat();
            record(0x07, &[&id[..], &(entries.len() as u32).to_le_bytes(), &entries].concat())
        }
        13 => {
            // A chunk index, or the index of an attachment, with any numbers.
            let numbers: Vec<u8> =
                (0..4).map(|_| number(u)).collect::<Result<Vec<_>>>()?.iter().flat_map(|n| n.to_le_bytes()).collect();
            let (opcode, rest) = *u.choose(&[(0x08, 28), (0x0A, 24), (0x0B, 14), (0x0D, 8), (0x0E, 0)])?;
            record(opcode, &[numbers, vec![0; rest]].concat())
        }
        14 => record(0x0C, &[text("stillpoint"), 12_u32.to_le_bytes().to_vec(), text("prefix"), text("")].concat()),
        _ => {
            let opcode = *u.choose(&[0x0F, 0x02, 0x01, 0x80, 0x91, 0x00, 0x44])?;
            let length = u.int_in_range(0..=30)?;
            record(opcode, u.bytes(length)?)
        }
    })
}

/// A number as it may stand in a file: small, or at an edge.
fn number(u: &mut Unstructured<'_>) -> Result<u64> {
    Ok(match u.int_in_range(0..=5)? {
        0 => *u.choose(&[u64::MAX, u64::MAX - 8, 1 << 63, (1 << 63) - 1, 1 << 32, 1 << 24, 0])?,
        1 => u.arbitrary()?,
        _ => u.int_in_range(0..=1000)?,
    })
}

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

/// The same recording, mistreated in up to four ways, but with its magic.
pub fn mistreated(mut file: Vec<u8>, u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    for _ in 0..u.int_in_range(0..=4)? {
        mistreat(&mut file, u)?;
    }
    Ok(file)
}

fn mistreat(file: &mut Vec<u8>, u: &mut Unstructured<'_>) -> Result<()> {
    let whole = frames(file);
    if file.len() <= MAGIC.len() || whole.is_empty() {
        return Ok(());
    }
    let frame = whole[u.choose_index(whole.len())?].clone();
    let body = frame.start + 9..frame.end;
    match u.int_in_range(0..=12)? {
        0 => file.truncate(place(file, u)?),
        1 => {
            let at = place(file, u)?;
            file[at] ^= u.int_in_range(1..=255)?;
        }
        2 => {
            let at = place(file, u)?;
            let end = file.len().min(at + u.int_in_range(1..=300)?);
            file[at..end].fill(0);
        }
        // A record lies about its length, by a little or up to the end of another one.
        3 => set(file, frame.start + 1, number(u)?),
        4 => {
            let other = whole[u.choose_index(whole.len())?].end;
            set(file, frame.start + 1, (other.saturating_sub(frame.start + 9)) as u64);
        }
        5 => file[frame.start] = *u.choose(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 0, 0x80, 0xFF])?,
        // A number within a record, or one byte of it.
        6 if body.len() >= 8 => {
            let at = body.start + u.choose_index((body.len() - 7).min(80))?;
            set(file, at, number(u)?);
        }
        7 if !body.is_empty() => {
            let at = body.start + u.choose_index(body.len())?;
            file[at] = u.arbitrary()?;
        }
        8 => _ = file.drain(frame),
        9 => {
            let copy = file[frame].to_vec();
            let to = whole[u.choose_index(whole.len())?].start;
            file.splice(to..to, copy);
        }
        10 => {
            let (at, new) = (place(file, u)?, records(u, 1)?);
            file.splice(at..at, new);
        }
        11 => {
            let (at, length) = (place(file, u)?, u.int_in_range(1..=20)?);
            let new = u.bytes(length)?.to_vec();
            file.splice(at..at, new);
        }
        _ => file.truncate(frame.start + u.choose_index(frame.len())?),
    }
    Ok(())
}

/// Anywhere behind the magic.
fn place(file: &[u8], u: &mut Unstructured<'_>) -> Result<usize> {
    Ok(MAGIC.len() + u.choose_index((file.len() - MAGIC.len()).max(1))?)
}

fn set(file: &mut [u8], at: usize, number: u64) {
    file[at..at + 8].copy_from_slice(&number.to_le_bytes());
}

/// The records from the magic on, as far as they are whole.
pub fn frames(file: &[u8]) -> Vec<Range<usize>> {
    let (mut frames, mut at) = (Vec::new(), MAGIC.len());
    while let Some(length) = file.get(at + 1..at + 9) {
        let length = u64::from_le_bytes(length.try_into().unwrap());
        let Some(end) = usize::try_from(length).ok().and_then(|length| (at + 9).checked_add(length)) else { break };
        if end > file.len() {
            break;
        }
        frames.push(at..end);
        at = end;
    }
    frames
}
