//! ROS diagnostics, for the status panels of viewers. They are shown live and are not annotations, which hold the same
//! information.

use std::collections::BTreeMap;

use prost_types::Timestamp;

use super::cdr::Writer;
use crate::record::Topic;

/// Severity, with the numbers of `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Level {
    /// In order.
    #[default]
    Ok = 0,
    /// Needs attention.
    Warn = 1,
}

/// State of one component.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnostic {
    /// Severity.
    pub level: Level,
    /// Name of the component.
    pub name: String,
    /// State in words.
    pub message: String,
    /// Topic of the sensor.
    pub hardware: String,
    /// Related values: label and value.
    pub values: Vec<(String, String)>,
}

const SCHEMA: &str = "\
std_msgs/Header header
diagnostic_msgs/DiagnosticStatus[] status
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: diagnostic_msgs/DiagnosticStatus
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
diagnostic_msgs/KeyValue[] values
================================================================================
MSG: diagnostic_msgs/KeyValue
string key
string value
";

/// Topic that panels show by default.
pub fn topic() -> Topic {
    Topic {
        name: "/diagnostics".to_owned(),
        schema_name: "diagnostic_msgs/msg/DiagnosticArray".to_owned(),
        schema_encoding: "ros2msg".to_owned(),
        schema: SCHEMA.into(),
        message_encoding: "cdr".to_owned(),
        metadata: BTreeMap::new(),
    }
}

/// Encodes a `DiagnosticArray`.
pub fn encode(time: Timestamp, diagnostics: &[Diagnostic]) -> Vec<u8> {
    let mut out = Writer::new();
    out.time(time);
    out.string("");
    out.length(diagnostics.len());
    for diagnostic in diagnostics {
        out.u8(diagnostic.level as u8);
        out.string(&diagnostic.name);
        out.string(&diagnostic.message);
        out.string(&diagnostic.hardware);
        out.length(diagnostic.values.len());
        for (key, value) in &diagnostic.values {
            out.string(key);
            out.string(value);
        }
    }
    out.finish()
}
