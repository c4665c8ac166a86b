//! Notes on a recording as a whole.

use crate::annotate::Corrections;
use crate::report::Findings;

/// Reason why there are no corrected messages of an IMU that was calibrated.
pub(crate) fn not_corrected(imu: &Findings) -> String {
    format!(
        "{}: no message could be corrected: its readings are integers, which cannot hold the result, or several in a message",
        imu.name
    )
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
