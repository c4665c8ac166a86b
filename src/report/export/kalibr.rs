//! Kalibr's two IMU files. The direction is the same as here: `a = M · a_true + b` and
//! `ω = M · C · ω_true + A · C · a_true + b`, with M lower triangular and C a rotation, so that S = M · C.
//! Convention: ethz-asl/kalibr, `IccSensors.py` (`IccScaledMisalignedImu`), and its wiki on the IMU noise model.

use nalgebra::Matrix3;
use serde_json::{Map, Value, json};

use super::comments::{comments, heading};
use super::error::ExportError;
use super::format::{Exported, Format, RandomWalks};
use super::options::RandomWalk;
use super::selection::{accelerometer, gyroscope, one};
use super::unsupported::{beyond, instead};
use crate::engine;
use crate::fit::Calibration;
use crate::messages::{AxisNoise, TriadMean};
use crate::report::{Findings, length, matrix, row_major, yaml};

const WALKS: &str = "the random walk of a bias shows only where the sensor is left alone for long, a gyroscope for a minute \
    and more at a time and ten in all, an accelerometer for two";

pub(super) const RESULTS: Format = Format {
    name: "kalibr",
    help: "Intrinsics in the layout of Kalibr's results",
    random_walks: RandomWalks::Bound,
    write: |findings, options| intrinsics(findings, options.random_walk),
};

pub(super) const INPUT: Format = Format {
    name: "kalibr-input",
    help: "Kalibr's imu.yaml: noise densities and rate",
    random_walks: RandomWalks::Any,
    write: |findings, options| input(one(findings, options)?, options.random_walk).map(Exported::plain),
};

/// Writes the results file: intrinsics of `imu0`, `imu1`, …
fn intrinsics(findings: &[Findings], walk: Option<RandomWalk>) -> Result<Exported, ExportError> {
    let bound = matches!(walk, Some(RandomWalk::Bound));
    let mut lines = Vec::new();
    let mut document = Map::new();
    let mut warnings = Vec::new();
    let mut refused = None;
    for imu in findings {
        match block(imu, bound) {
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
        "Stillpoint's S = M * C_gyro_i. Kalibr estimates M lower triangular and b as a curve that it does not write:"
            .to_owned(),
        "b is an addition, which Kalibr ignores and the crate imu-calib reads".to_owned(),
        WALKS.to_owned(),
        "axes as in the recording; convention: ethz-asl/kalibr, IccSensors.py (IccScaledMisalignedImu)".to_owned(),
    ]);
    Ok(Exported { text: comments(&lines) + &yaml::document(&Value::Object(document)), warnings })
}

fn block(imu: &Findings, bound: bool) -> Result<(Vec<String>, Value), ExportError> {
    let (triad, accel) = accelerometer(imu, None)?;
    let gyro = gyroscope(imu);
    let used = [Some(triad), gyro.map(|(triad, _)| triad)].into_iter().flatten().collect::<Vec<_>>();
    let lost = beyond(triad).chain(gyro.iter().flat_map(|(triad, _)| beyond(triad)));
    if let Some(what) = lost.into_iter().find(|&what| what != "g-sensitivity") {
        let next = instead(what);
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
            let (m, c) = lower_and_rotation(&gyro.sensitivity);
            let a = a * c.transpose();
            set("gyroscopes", json!({"M": rows(&m), "A": rows(&a), "C_gyro_i": rows(&c), "b": plus_zero(&gyro)}));
        }
        None => lines.push("gyroscope: not determined, no block".to_owned()),
    }
    let noise = Noise::of(imu);
    let mut insert = |key: &str, value: Option<f64>| value.map(|value| fields.insert(key.to_owned(), json!(value)));
    insert("update_rate", noise.rate);
    for (sensor, of_it) in [("accelerometer", &noise.accelerometer), ("gyroscope", &noise.gyroscope)] {
        insert(&format!("{sensor}_noise_density"), of_it.density);
        insert(&format!("{sensor}_random_walk"), of_it.random_walk(bound));
        lines.extend(of_it.remark(sensor, bound));
    }
    let secondary = imu.calibration.as_ref().map_or(0, |calibration| calibration.secondary.len());
    if secondary > 0 {
        lines.push(format!("without its {secondary} secondary accelerometers, for which Kalibr has no place"));
    }
    Ok((lines, Value::Object(fields)))
}

/// Writes the file that Kalibr reads: noise and rate.
fn input(imu: &Findings, walk: Option<RandomWalk>) -> Result<String, ExportError> {
    let noise = Noise::of(imu);
    let (bound, given) = (matches!(walk, Some(RandomWalk::Bound)), matches!(walk, Some(RandomWalk::Given(_))));
    let walk = match walk {
        Some(RandomWalk::Given(walks)) => Some(walks),
        _ => noise.accelerometer.random_walk(bound).zip(noise.gyroscope.random_walk(bound)).map(<[f64; 2]>::from),
    };
    let Some([accel_walk, gyro_walk]) = walk else {
        return Err(ExportError::Refused(format!(
            "Kalibr's imu.yaml needs random walks: {WALKS}. Give them with --random-walk ACCEL,GYRO (m/s³/√Hz, rad/s²/√Hz), \
             or write the bounds that the rests give with --random-walk bound{}",
            if bound { ": these rests are too short to give one" } else { "" }
        )));
    };
    let (Some(rate), Some(accel), Some(gyro)) = (noise.rate, noise.accelerometer.density, noise.gyroscope.density)
    else {
        let why = "both the accelerometer and the gyroscope must have been seen at rest for a second or more";
        return Err(ExportError::Undetermined { what: format!("the noise of {}", imu.name), why: why.to_owned() });
    };
    let mut lines = vec![
        format!("Noise of {} by Stillpoint {}, from its rests", imu.name, env!("CARGO_PKG_VERSION")),
        "continuous-time densities in m/s²/√Hz and rad/s/√Hz by Allan variance, root mean square over the axes"
            .to_owned(),
    ];
    match given {
        true => lines.push("the random walks were given on the command line".to_owned()),
        false => {
            lines.extend(noise.accelerometer.remark("accelerometer", bound));
            lines.extend(noise.gyroscope.remark("gyroscope", bound));
        }
    }
    lines.push("convention: ethz-asl/kalibr, wiki page \"IMU Noise Model\"".to_owned());
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

/// Factors S into a lower triangular matrix with a positive diagonal and a rotation.
fn lower_and_rotation(s: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    if s[(0, 1)] == 0.0 && s[(0, 2)] == 0.0 && s[(1, 2)] == 0.0 {
        return (*s, Matrix3::identity());
    }
    // Gram and Schmidt on the rows; a matrix close to a scaled identity loses no digits by it.
    let mut lower = Matrix3::zeros();
    let mut rotation = Matrix3::zeros();
    for row in 0..3 {
        let mut rest = s.row(row).into_owned();
        for before in 0..row {
            let along = rotation.row(before).dot(&s.row(row));
            lower[(row, before)] = along;
            rest -= rotation.row(before) * along;
        }
        lower[(row, row)] = rest.norm();
        rotation.set_row(row, &(rest / rest.norm()));
    }
    (lower, rotation)
}

/// Noise at rest.
struct Noise {
    /// Sample rate of the accelerometer, Hz.
    rate: Option<f64>,
    accelerometer: TriadNoise,
    gyroscope: TriadNoise,
}

/// Noise of one triad, root mean square over its axes, in m/s² or rad/s.
#[derive(Default)]
struct TriadNoise {
    /// Noise density, per √Hz.
    density: Option<f64>,
    /// Random walk of the bias, per s√Hz, if every axis shows one.
    claimed: Option<f64>,
    /// Upper bound of the random walk with 95 % probability, of the worst axis.
    bound: Option<f64>,
}

impl TriadNoise {
    /// From the Allan variance; for recordings without Allan sums, from the standard deviations in the rests.
    fn of(imu: &Findings, sensor: &str) -> Self {
        let sums = imu.noise.iter().flat_map(|noise| &noise.triads).find(|sums| sums.sensor == sensor);
        let axes = sums.map(|sums| engine::axis_noise(&engine::allan_sums(sums))).unwrap_or_default();
        if axes.is_empty() {
            return Self { density: deviation(imu, sensor), ..Self::default() };
        }
        let all = |value: fn(&AxisNoise) -> Option<f64>| axes.iter().map(value).collect::<Option<Vec<_>>>();
        let rms = |values: Vec<f64>| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        Self {
            density: all(|axis| Some(axis.density)).map(rms),
            claimed: all(|axis| axis.random_walk).map(rms),
            bound: all(|axis| axis.random_walk_high).map(|values| values.into_iter().fold(0.0, f64::max)),
        }
    }

    /// Random walk to write; the bound only on request.
    fn random_walk(&self, bound: bool) -> Option<f64> {
        self.claimed.or(self.bound.filter(|_| bound))
    }

    /// Remark on the random walk if none is claimed.
    fn remark(&self, sensor: &str, written: bool) -> Option<String> {
        self.density.filter(|_| self.claimed.is_none())?;
        Some(match self.bound {
            Some(_) if written => format!("{sensor}_random_walk is an upper bound (95 %), not an estimate"),
            Some(bound) => format!(
                "{sensor}_random_walk: no more than {bound:.3e} (95 %), and not shown to be there, so not written; \
                 --random-walk bound writes it"
            ),
            None => format!("no {sensor}_random_walk: the rests are too short to bound one"),
        })
    }
}

impl Noise {
    fn of(imu: &Findings) -> Self {
        let gaps: f64 = seen(imu, "accelerometer").map(|(mean, _)| mean.samples.saturating_sub(1) as f64).sum();
        let seconds: f64 = seen(imu, "accelerometer").map(|(_, seconds)| seconds).sum();
        Self {
            rate: (seconds > 0.0).then_some(gaps / seconds),
            accelerometer: TriadNoise::of(imu, "accelerometer"),
            gyroscope: TriadNoise::of(imu, "gyroscope"),
        }
    }
}

/// Means of a triad in the accepted rests, each with the length of the rest in seconds.
fn seen<'a>(imu: &'a Findings, sensor: &str) -> impl Iterator<Item = (&'a TriadMean, f64)> {
    let accepted = imu.rests.values().filter(|rest| rest.accepted);
    accepted.filter_map(move |rest| Some((rest.means.iter().find(|mean| mean.sensor == sensor)?, length(rest))))
}

/// Noise density from the standard deviation of a sample and the number of uncorrelated samples.
fn deviation(imu: &Findings, sensor: &str) -> Option<f64> {
    let (mut energy, mut samples) = (0.0, 0.0);
    for (mean, seconds) in seen(imu, sensor) {
        let n = mean.samples as f64;
        energy += n * variance(mean) * seconds / mean.effective_samples.max(1.0);
        samples += n;
    }
    (samples > 0.0).then(|| f64::sqrt(energy / samples)).filter(|density| *density > 0.0)
}

/// Variance of one sample, mean over the axes.
fn variance(mean: &TriadMean) -> f64 {
    mean.std.as_ref().map_or(0.0, |std| (std.x * std.x + std.y * std.y + std.z * std.z) / 3.0)
}

fn rows(matrix: &Matrix3<f64>) -> Value {
    row_major(matrix).chunks(3).map(|row| row.iter().map(|v| v + 0.0).collect::<Value>()).collect()
}

fn plus_zero(calibration: &Calibration) -> Value {
    calibration.bias.iter().map(|v| v + 0.0).collect()
}
