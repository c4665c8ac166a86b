//! `reads-kalibr KALIBR.yaml EXPORT.json`: the crate imu-calib reads the Kalibr file and corrects readings; from the
//! corrected ones, the numbers of the JSON export must give the readings back to 1e-9: measured = bias + S · true.

use anyhow::{Context as _, ensure};
use imu_calib::ImuIntrinsics;
use serde_json::Value;

fn main() -> anyhow::Result<()> {
    let paths: Vec<_> = std::env::args().skip(1).collect();
    let [kalibr, json] = paths.as_slice() else { anyhow::bail!("usage: reads-kalibr KALIBR.yaml EXPORT.json") };
    let corrector = ImuIntrinsics::from_kalibr_yaml(kalibr)?.corrector()?;
    let json: Value = serde_json::from_str(&std::fs::read_to_string(json)?)?;
    let (accel, gyro) = (&json["imus"][0]["accelerometer"], &json["imus"][0]["gyroscope"]);

    let mut worst = 0.0_f64;
    for i in 0..1000_u32 {
        // Readings all over the range, without a generator to agree on.
        let at = |k: u32, size: f64| (f64::from((i * 7919 + k * 104_729) % 2003) / 1001.5 - 1.0) * size;
        let raw = ([at(0, 30.0), at(1, 30.0), at(2, 30.0)], [at(3, 5.0), at(4, 5.0), at(5, 5.0)]);
        let corrected = corrector.correct(raw.0, raw.1);
        for (triad, raw, corrected) in [(accel, raw.0, corrected.0), (gyro, raw.1, corrected.1)] {
            for (measured, expected) in measure(triad, corrected)?.iter().zip(raw) {
                worst = worst.max((measured - expected).abs());
            }
        }
    }
    ensure!(worst < 1e-9, "differ by {worst:e}");
    println!("imu-calib corrects as Stillpoint does, to {worst:.1e}");
    Ok(())
}

/// `bias + S · true`; without S, that of the identity.
fn measure(triad: &Value, truth: [f64; 3]) -> anyhow::Result<[f64; 3]> {
    let mut measured = [0.0; 3];
    for (row, value) in measured.iter_mut().enumerate() {
        *value = triad["bias"][row].as_f64().context("no bias")?;
        for (column, truth) in truth.iter().enumerate() {
            let identity = if row == column { 1.0 } else { 0.0 };
            *value += triad["sensitivity"][row][column].as_f64().unwrap_or(identity) * truth;
        }
    }
    Ok(measured)
}
