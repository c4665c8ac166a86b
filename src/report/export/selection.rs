//! The IMU, and the triads of it, that an export is asked for.

use super::error::ExportError;
use super::options::Options;
use crate::fit::Calibration;
use crate::messages::Triad;
use crate::report::{Findings, calibration};

/// The chosen IMU.
pub(super) fn one<'a>(findings: &'a [Findings], options: &Options) -> Result<&'a Findings, ExportError> {
    let names = || findings.iter().map(|imu| imu.name.as_str()).collect::<Vec<_>>().join(", ");
    match (&options.imu, findings) {
        (None, [only]) => Ok(only),
        (None, _) => Err(ExportError::Several(names())),
        (Some(name), _) => findings
            .iter()
            .find(|imu| imu.name == *name || imu.topic == *name)
            .ok_or_else(|| ExportError::Unknown { what: "IMU", name: name.clone(), known: names() }),
    }
}

/// The chosen accelerometer and its calibration.
pub(super) fn accelerometer<'a>(
    imu: &'a Findings,
    sensor: Option<&str>,
) -> Result<(&'a Triad, Calibration), ExportError> {
    let found = imu.calibration.as_ref();
    let secondary = found.map_or(&[][..], |found| &found.secondary);
    let primary = found.and_then(|found| found.accelerometer.as_ref());
    let triad = match sensor {
        None | Some("accelerometer") => primary,
        Some(name) => Some(secondary.iter().find(|triad| triad.sensor == name).ok_or_else(|| {
            let known: Vec<_> = ["accelerometer"].into_iter().chain(secondary.iter().map(|t| &*t.sensor)).collect();
            ExportError::Unknown { what: "accelerometer", name: name.to_owned(), known: known.join(", ") }
        })?),
    };
    triad.and_then(|triad| Some((triad, calibration(triad)?))).ok_or_else(|| ExportError::Undetermined {
        what: format!("{} of {}", sensor.unwrap_or("the accelerometer"), imu.name),
        why: match sensor {
            Some(_) => triad.and_then(|triad| triad.notes.first().cloned()).unwrap_or_default(),
            None => imu.reason().unwrap_or_default().to_owned(),
        },
    })
}

/// The gyroscope, if it is determined.
pub(super) fn gyroscope(imu: &Findings) -> Option<(&Triad, Calibration)> {
    let triad = imu.calibration.as_ref()?.gyroscope.as_ref()?;
    Some((triad, calibration(triad)?))
}
