//! Kalibr's two IMU files. Its direction is ours: `a = M · a_true + b` and `ω = M · C · ω_true + A · C · a_true + b`.
//! Convention: ethz-asl/kalibr, `IccSensors.py` (`IccScaledMisalignedImu`), and its wiki on the IMU noise model.

use nalgebra::Matrix3;
use serde_json::{Map, Value, json};

use super::{ExportError, Exported, accelerometer, beyond, comments, gyroscope, heading};
use crate::fit::Calibration;
use crate::messages::TriadMean;
use crate::report::{Findings, length, matrix, row_major, yaml};

const WALKS: &str =
    "the random walks of the biases show only in hours at rest (Allan variance), not in the rests of a calibration";

/// The results file: intrinsics of `imu0`, `imu1`, …
pub(super) fn intrinsics(findings: &[Findings]) -> Result<Exported, ExportError> {
    let mut lines = Vec::new();
    let mut document = Map::new();
    let mut warnings = Vec::new();
    let mut refused = None;
    for imu in findings {
        match block(imu) {
            Ok((heading, value)) => {
                lines.extend(heading);
                document.insert(format!("imu{}", document.len()), value);
            }
            Err(error @ ExportError::Holds { .. }) => return Err(error),
            Err(error) => {
                warnings.push(format!("{} is left out: {error}", imu.name));
                refused = refused.or(Some(error));
            }
        }
    }
    if let (true, Some(error)) = (document.is_empty(), refused) {
        return Err(error);
    }
    lines.extend([
        "measured = M * true + b in m/s²; measured = M * C_gyro_i * true + A * C_gyro_i * acceleration + b in rad/s:"
            .to_owned(),
        "the direction of Stillpoint's S. Kalibr estimates M lower triangular and b as a curve that it does not write:"
            .to_owned(),
        "b is an addition, which Kalibr ignores and the crate imu-calib reads".to_owned(),
        format!("no *_random_walk: {WALKS}"),
        "axes as in the recording; convention: ethz-asl/kalibr, IccSensors.py (IccScaledMisalignedImu)".to_owned(),
    ]);
    Ok(Exported { text: comments(&lines) + &yaml::document(&Value::Object(document)), warnings })
}

fn block(imu: &Findings) -> Result<(Vec<String>, Value), ExportError> {
    let (triad, accel) = accelerometer(imu, None)?;
    let gyro = gyroscope(imu);
    let used = [Some(triad), gyro.map(|(triad, _)| triad)].into_iter().flatten().collect::<Vec<_>>();
    let lost = beyond(triad).chain(gyro.iter().flat_map(|(triad, _)| beyond(triad)));
    if let Some(what) = lost.into_iter().find(|&what| what != "g-sensitivity") {
        let next = "use --format json or yaml";
        return Err(ExportError::Holds { format: "Kalibr's file", what: what.to_owned(), next });
    }
    let mut lines = heading(imu, &used);
    let mut fields = Map::new();
    let mut set = |key: &str, value: Value| fields.insert(key.to_owned(), value);
    set("model", json!("scale-misalignment"));
    set("rostopic", json!(imu.topic));
    set("accelerometers", json!({"M": rows(&accel.sensitivity), "b": plus_zero(&accel)}));
    match gyro {
        Some((triad, gyro)) => {
            let a = matrix(&triad.g_sensitivity).unwrap_or_else(Matrix3::zeros);
            let c = Matrix3::identity();
            set(
                "gyroscopes",
                json!({"M": rows(&gyro.sensitivity), "A": rows(&a), "C_gyro_i": rows(&c), "b": plus_zero(&gyro)}),
            );
        }
        None => lines.push("gyroscope: not determined, no block".to_owned()),
    }
    let noise = Noise::of(imu);
    let mut insert = |key: &str, value: Option<f64>| value.map(|value| fields.insert(key.to_owned(), json!(value)));
    insert("update_rate", noise.rate);
    insert("accelerometer_noise_density", noise.accelerometer);
    insert("gyroscope_noise_density", noise.gyroscope);
    let secondary = imu.calibration.as_ref().map_or(0, |calibration| calibration.secondary.len());
    if secondary > 0 {
        lines.push(format!("without its {secondary} secondary accelerometers, for which Kalibr has no place"));
    }
    Ok((lines, Value::Object(fields)))
}

/// The file that Kalibr reads: noise and rate.
pub(super) fn input(imu: &Findings, walk: Option<[f64; 2]>) -> Result<String, ExportError> {
    let Some([accel_walk, gyro_walk]) = walk else {
        return Err(ExportError::Refused(format!(
            "Kalibr's imu.yaml needs random walks: {WALKS}. Give them with --random-walk ACCEL,GYRO (m/s³/√Hz, rad/s²/√Hz)"
        )));
    };
    let noise = Noise::of(imu);
    let (Some(rate), Some(accel), Some(gyro)) = (noise.rate, noise.accelerometer, noise.gyroscope) else {
        let why = "both the accelerometer and the gyroscope must have been seen at rest for a second or more";
        return Err(ExportError::Undetermined { what: format!("the noise of {}", imu.name), why: why.to_owned() });
    };
    let lines = [
        format!("Noise of {} by Stillpoint {}, from its accepted rests", imu.name, env!("CARGO_PKG_VERSION")),
        "continuous-time densities in m/s²/√Hz and rad/s/√Hz, root mean square over the axes: σ of one sample over"
            .to_owned(),
        "√(samples a second that are not correlated). The random walks were given on the command line".to_owned(),
        "convention: ethz-asl/kalibr, wiki page \"IMU Noise Model\"".to_owned(),
    ];
    let fields = [
        ("accelerometer_noise_density", accel),
        ("accelerometer_random_walk", accel_walk),
        ("gyroscope_noise_density", gyro),
        ("gyroscope_random_walk", gyro_walk),
        ("update_rate", rate),
    ];
    let fields: String = fields.iter().map(|(key, value)| format!("{key}: {}\n", yaml::number(*value))).collect();
    Ok(format!("{}{}{fields}", comments(&lines), yaml::document(&json!({"rostopic": imu.topic}))))
}

/// White noise at rest.
struct Noise {
    /// Samples a second of the accelerometer.
    rate: Option<f64>,
    /// m/s²/√Hz.
    accelerometer: Option<f64>,
    /// rad/s/√Hz.
    gyroscope: Option<f64>,
}

impl Noise {
    fn of(imu: &Findings) -> Self {
        let seen = |sensor: &'static str| {
            let accepted = imu.rests.values().filter(|rest| rest.accepted);
            accepted.filter_map(move |rest| Some((rest.means.iter().find(|mean| mean.sensor == sensor)?, length(rest))))
        };
        let density = |sensor| {
            let (mut energy, mut samples) = (0.0, 0.0);
            for (mean, seconds) in seen(sensor) {
                let n = mean.samples as f64;
                energy += n * variance(mean) * seconds / mean.effective_samples.max(1.0);
                samples += n;
            }
            (samples > 0.0).then(|| f64::sqrt(energy / samples)).filter(|density| *density > 0.0)
        };
        let gaps: f64 = seen("accelerometer").map(|(mean, _)| mean.samples.saturating_sub(1) as f64).sum();
        let seconds: f64 = seen("accelerometer").map(|(_, seconds)| seconds).sum();
        Self {
            rate: (seconds > 0.0).then_some(gaps / seconds),
            accelerometer: density("accelerometer"),
            gyroscope: density("gyroscope"),
        }
    }
}

/// Of one sample, mean over the axes.
fn variance(mean: &TriadMean) -> f64 {
    mean.std.as_ref().map_or(0.0, |std| (std.x * std.x + std.y * std.y + std.z * std.z) / 3.0)
}

fn rows(matrix: &Matrix3<f64>) -> Value {
    row_major(matrix).chunks(3).map(|row| row.iter().map(|v| v + 0.0).collect::<Value>()).collect()
}

fn plus_zero(calibration: &Calibration) -> Value {
    calibration.bias.iter().map(|v| v + 0.0).collect()
}
