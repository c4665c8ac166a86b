//! The log message of ROS 2, which its own tools show. In every other recording it is Foxglove's.

use super::cdr::Writer;
use super::ros2::write_time;
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

/// The bytes of a log message as `SCHEMA` has it. Foxglove's knows no function.
pub fn encode(log: &Log) -> Vec<u8> {
    let stamp = log.timestamp.unwrap_or_default();
    let mut out = Writer::new();
    write_time(&mut out, stamp.seconds, stamp.nanos);
    out.u8(severity(log.level()));
    out.string(&log.name);
    out.string(&log.message);
    out.string(&log.file);
    out.string("");
    out.u32(log.line);
    out.finish()
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
