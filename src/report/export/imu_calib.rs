//! The YAML of dpkoch/imu_calib: `corrected = SM · raw − bias`, accelerometer only.
//! Convention: `src/accel_calib/accel_calib.cpp` there, `loadCalib` and `applyCalib`.

use nalgebra::Matrix3;

use super::comments::{comments, heading};
use super::error::ExportError;
use super::format::{Exported, Format, RandomWalks};
use super::options::Options;
use super::selection::{accelerometer, one};
use super::unsupported::{beyond, instead};
use crate::report::{Findings, row_major, yaml};

pub(super) const YAML: Format = Format {
    name: "imu-calib",
    help: "SM and bias of dpkoch/imu_calib",
    random_walks: RandomWalks::None,
    write: |findings, options| export(one(findings, options)?, options).map(Exported::plain),
};

fn export(imu: &Findings, options: &Options) -> Result<String, ExportError> {
    let (triad, calibration) = accelerometer(imu, options.sensor.as_deref())?;
    if let Some(what) = beyond(triad).next() {
        let next = instead(what);
        return Err(ExportError::Holds { format: "imu_calib", what: what.to_owned(), next });
    }
    let inverse: Matrix3<f64> = calibration.inverse();
    let bias = inverse * calibration.bias;
    let mut lines = heading(imu, &[triad]);
    lines.extend([
        "corrected = SM * raw - bias, in m/s²: SM is the inverse of Stillpoint's S, bias is SM times Stillpoint's bias"
            .to_owned(),
        "accelerometer only: imu_calib takes a gyroscope's bias at each start, and has no place for its sensitivity"
            .to_owned(),
        "axes as in the recording; convention: dpkoch/imu_calib, accel_calib.cpp (applyCalib)".to_owned(),
    ]);
    let list = |values: &[f64]| values.iter().map(|&v| yaml::number(v + 0.0)).collect::<Vec<_>>().join(", ");
    let (sm, bias) = (list(&row_major(&inverse)), list(bias.as_slice()));
    Ok(format!("{}SM: [{sm}]\nbias: [{bias}]\n", comments(&lines)))
}
