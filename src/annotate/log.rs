//! Log message of ROS 2, for its own tools. Recordings of other profiles use Foxglove's.

use super::cdr::{Reader, Writer};
use crate::messages::foxglove::{Log, log::Level};

pub const SCHEMA_NAME: &str = "rcl_interfaces/msg/Log";

pub const SCHEMA: &str = "\
uint8 DEBUG=10
uint8 INFO=20
uint8 WARN=30
uint8 ERROR=40
uint8 FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// Encodes a log message by `SCHEMA`. Foxglove's has no `function`, which stays empty.
pub fn encode(log: &Log) -> Vec<u8> {
    let mut out = Writer::new();
    out.time(log.timestamp.unwrap_or_default());
    out.u8(severity(log.level()));
    out.string(&log.name);
    out.string(&log.message);
    out.string(&log.file);
    out.string("");
    out.u32(log.line);
    out.finish()
}

/// Decodes a log message.
pub fn read(input: &mut Reader) -> Result<Log, String> {
    let timestamp = Some(input.time()?);
    let level = level(input.u8()?).into();
    let (name, message, file) = (input.string()?.to_owned(), input.string()?.to_owned(), input.string()?.to_owned());
    let _function = input.string()?;
    Ok(Log { timestamp, level, message, name, file, line: input.u32()? })
}

fn severity(level: Level) -> u8 {
    match level {
        Level::Unknown => 0,
        Level::Debug => 10,
        Level::Info => 20,
        Level::Warning => 30,
        Level::Error => 40,
        Level::Fatal => 50,
    }
}

fn level(severity: u8) -> Level {
    match severity {
        10 => Level::Debug,
        20 => Level::Info,
        30 => Level::Warning,
        40 => Level::Error,
        50 => Level::Fatal,
        _ => Level::Unknown,
    }
}
