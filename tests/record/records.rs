//! Recordings put together record by record, for what no writer at hand produces.

use mcap::MAGIC;

pub fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    let mut out = vec![opcode];
    out.extend((body.len() as u64).to_le_bytes());
    out.extend(body);
    out
}

pub fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

pub fn schema(id: u16) -> Vec<u8> {
    record(0x03, &[&id.to_le_bytes()[..], &text("pkg/msg/T"), &text("ros2msg"), &text("int8 x")].concat())
}

pub fn channel(id: u16, schema: u16) -> Vec<u8> {
    let topic = text(&format!("/topic{id}"));
    record(0x04, &[&id.to_le_bytes()[..], &schema.to_le_bytes(), &topic, &text("cdr"), &[0; 4]].concat())
}

pub fn message(channel: u16, log_time: u64) -> Vec<u8> {
    let time = log_time.to_le_bytes();
    record(0x05, &[&channel.to_le_bytes()[..], &[0; 4], &time, &time, b"data"].concat())
}

/// An uncompressed chunk without CRC, and no index of it.
pub fn chunk(records: &[u8]) -> Vec<u8> {
    let size = (records.len() as u64).to_le_bytes();
    record(0x06, &[&[0; 16][..], &size, &[0; 4], &text(""), &size, records].concat())
}

pub fn attachment(name: &str, data: &[u8], crc: u32) -> Vec<u8> {
    let size = (data.len() as u64).to_le_bytes();
    record(0x09, &[&[0; 16][..], &text(name), &text(""), &size, data, &crc.to_le_bytes()].concat())
}

/// A finished recording of these data and summary records.
pub fn recording(data: &[Vec<u8>], summary: &[Vec<u8>]) -> Vec<u8> {
    let header = record(0x01, &[text(""), text("by hand")].concat());
    let mut out = [MAGIC, &header, &data.concat(), &record(0x0F, &[0; 4])].concat();
    let start = out.len() as u64;
    let summary = summary.concat();
    let footer = [&(if summary.is_empty() { 0 } else { start }).to_le_bytes()[..], &[0; 12]].concat();
    out.extend(summary);
    out.extend(record(0x02, &footer));
    out.extend(MAGIC);
    out
}
