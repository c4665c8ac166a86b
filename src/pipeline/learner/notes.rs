//! Notes on a recording as a whole.

use crate::annotate::Corrections;
use crate::imu::{Intake, Sensor};
use crate::pipeline::correction::Corrector;
use crate::report::Findings;

/// Reason why there are no corrected messages of an IMU that was calibrated.
pub(crate) fn not_corrected(imu: &Findings) -> String {
    format!(
        "{}: no message could be corrected: its readings are integers of protobuf, or of a range that does not hold the \
         result; record them as floating point numbers",
        imu.name
    )
}

/// Descriptions of the corrected readings that are integers, as those of their sources are.
pub(crate) fn rounded(intake: &Intake, corrector: &Corrector) -> Vec<String> {
    let rounding = intake.rounding().into_iter().filter(|((name, _), _)| corrector.has_written(name));
    let note = |((name, triad), (sensor, step)): ((&str, &str), (Sensor, f64))| {
        let unit = if sensor == Sensor::Gyroscope { "rad/s" } else { "m/s²" };
        format!(
            "{name}: corrected messages hold integers, as the recording's do: the {triad} is rounded to steps of {step:.2e} {unit}"
        )
    };
    rounding.map(note).collect()
}

/// Description of the readings that corrected messages leave unchanged; `None` if there are none.
pub(crate) fn uncorrected(name: &str, corrections: &Corrections) -> Option<String> {
    let left = corrections.undetermined();
    let list = left.join(", ");
    (!left.is_empty()).then(|| {
        format!(
            "{name}: corrected messages leave what is not determined, or depends on what the other sensor reads at that \
             instant, as it is: {list}"
        )
    })
}
