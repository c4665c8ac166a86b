//! Comment lines at the head of a file.

use crate::messages::{self, Triad};
use crate::printable;
use crate::report::{Findings, model};

/// First comment lines of every foreign format.
pub(super) fn heading(imu: &Findings, triads: &[&Triad]) -> Vec<String> {
    let mut lines = vec![format!("Calibration of {} by Stillpoint {}", imu.name, env!("CARGO_PKG_VERSION"))];
    for triad in triads {
        let model = model(triad.model()).unwrap_or("no model");
        lines.push(format!("{}: {}, {model}", triad.sensor, triad.status().as_str_name()));
    }
    if let Some(messages::Calibration { gravity, gravity_source, .. }) = &imu.calibration {
        lines.push(format!("gravity {gravity} m/s² ({gravity_source})"));
    }
    lines
}

/// Text as comment lines; a name from a recording cannot end a comment early.
pub(super) fn comments(lines: &[String]) -> String {
    let line = |line: &String| format!("# {}\n", printable(line));
    lines.iter().map(line).collect()
}
