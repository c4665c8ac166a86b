//! Any configuration is loaded or refused; what is loaded reads back from its canonical form, and a recording can be
//! annotated with it.

use arbitrary::{Result, Unstructured};
use stillpoint::config::{Config, Layer};
use stillpoint::run::Options;

use super::session;

pub fn check(bytes: &[u8]) {
    let _ = checked(&mut Unstructured::new(bytes));
}

fn checked(u: &mut Unstructured<'_>) -> Result<()> {
    let mut layers = vec![Layer::file("a.toml", &text(u)?)];
    for _ in 0..u.int_in_range(0..=2)? {
        layers.extend(Layer::set(&format!("{}={}", u.choose(KEYS)?, value(u)?)));
    }
    let config = match Config::load(&layers) {
        Ok(config) => config,
        Err(error) => {
            assert!(!error.to_string().contains('\n'), "an error of several lines: {error}");
            return Ok(());
        }
    };
    let canonical = config.canonical();
    let again = Config::load(&[Layer::file("canonical", &canonical)]).expect("the canonical form can be loaded");
    assert_eq!(again.canonical(), canonical);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, session::recording(&mut Unstructured::new(u.peek_bytes(1).unwrap_or_default()))?).unwrap();
    let _ = session::annotated(&path, &config, Options::default());
    Ok(())
}

fn text(u: &mut Unstructured<'_>) -> Result<String> {
    let mut text = String::new();
    for _ in 0..u.int_in_range(0..=8)? {
        match u.int_in_range(0..=9)? {
            0 => text.push_str(u.choose(WORDS)?),
            1 => text.push_str(&format!(
                "[{}]\n",
                u.choose(&["still", "fit", "fit.bounds", "fit.fixture", "output", "limits"])?
            )),
            2 => text.push_str(&format!("[[imu]]\ntopic = \"{}\"\n", u.choose(&["/imu/data_raw", "/a", ""])?)),
            3 => text.push_str(&format!("[imu.{}]\n", u.choose(&["secondary", "reference", "gyro"])?)),
            _ => text.push_str(&format!("{} = {}\n", u.choose(KEYS)?, value(u)?)),
        }
    }
    Ok(text)
}

fn value(u: &mut Unstructured<'_>) -> Result<String> {
    Ok(match u.int_in_range(0..=5)? {
        0 => (*u.choose(VALUES)?).to_owned(),
        1 => u.arbitrary::<f64>()?.to_string(),
        2 => u.arbitrary::<i64>()?.to_string(),
        3 => format!("{}", f64::from(u.int_in_range(-100..=1000)?) / 10.0),
        4 => format!("[{}, {}]", value_of(u)?, value_of(u)?),
        _ => (*u.choose(&["0.5", "1", "3.0", "true"])?).to_owned(),
    })
}

fn value_of(u: &mut Unstructured<'_>) -> Result<f64> {
    Ok(f64::from(u.int_in_range(-100..=100)?) / 10.0)
}

const WORDS: &[&str] =
    &["=", "[", "]", "{", "}", "\"", "'", "\n", "#", "a", ".", "\u{0}", "é", "[[[[[[[[[[[[[[[[", "a.b.c.d = 1\n"];

const VALUES: &[&str] = &[
    "nan",
    "inf",
    "-inf",
    "0",
    "-0.0",
    "1e308",
    "1e-308",
    "5e-324",
    "9223372036854775807",
    "-1",
    "\"\"",
    "\"auto\"",
    "true",
    "[]",
    "{}",
    "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
    "[[1, 0, 0]]",
    "\"adaptive\"",
    "\"moving-std\"",
    "\"bias-scale\"",
    "\"triangular\"",
    "\"cross-axis\"",
    "\"full\"",
    "\"fixture\"",
    "\"magnitude\"",
    "\"huber\"",
    "\"segment\"",
    "\"round\"",
    "\"causal\"",
    "\"final\"",
    "\"off\"",
    "\"protobuf\"",
    "\"json\"",
    "\"cdr\"",
    "\"g\"",
    "\"deg/s\"",
    "\"adxl375\"",
    "\"mpu9250\"",
    "\"linear_acceleration\"",
    "\"angular_velocity\"",
    "{ topic = \"/a\", path = \"b\" }",
    "{ path = \"a\", unit = \"deg/s\" }",
    "[\"a.x\", \"a.y\", \"a.z\"]",
    "[{ begin_s = 1.0, end_s = 2.5, angle_deg = 360 }]",
    "[{ begin_s = nan, end_s = inf, angle_deg = -1e308, imu = \"a\" }]",
    "\"cube\"",
    "\"dodecahedron\"",
    "1970-01-01",
];

/// The keys of the commented default, and what an IMU may have.
const KEYS: &[&str] = &[
    "topic",
    "name",
    "accel",
    "gyro",
    "temperature",
    "gyro.axes",
    "covariance",
    "preset",
    "model",
    "detector",
    "still.detector",
    "window_s",
    "still.window_s",
    "enter",
    "still.enter",
    "settle_s",
    "still.settle_s",
    "leave",
    "still.leave",
    "min_rest_s",
    "still.min_rest_s",
    "min_fit_s",
    "still.min_fit_s",
    "max_duration_s",
    "still.max_duration_s",
    "gap_s",
    "still.gap_s",
    "late_s",
    "still.late_s",
    "accel_ceiling",
    "still.accel_ceiling",
    "gyro_ceiling",
    "still.gyro_ceiling",
    "max_creep",
    "still.max_creep",
    "max_turn",
    "still.max_turn",
    "fit.model",
    "estimator",
    "fit.estimator",
    "gravity",
    "fit.gravity",
    "latitude_deg",
    "fit.latitude_deg",
    "height_m",
    "fit.height_m",
    "fix_topic",
    "fit.fix_topic",
    "max_tilt_deg",
    "fit.max_tilt_deg",
    "placement_std",
    "fit.placement_std",
    "rate_std",
    "fit.rate_std",
    "cross_axis_std",
    "fit.cross_axis_std",
    "nonlinearity",
    "fit.nonlinearity",
    "loss",
    "fit.loss",
    "refit",
    "fit.refit",
    "half_life_s",
    "fit.half_life_s",
    "max_error",
    "fit.max_error",
    "whole_turns",
    "fit.whole_turns",
    "rotations",
    "fit.rotations",
    "heading",
    "fit.heading",
    "fit.heading.unit",
    "clockwise",
    "std_deg",
    "fit.heading.std_deg",
    "fit.temperature",
    "solid",
    "fit.fixture.solid",
    "mounting_deg",
    "fit.fixture.mounting_deg",
    "accuracy_deg",
    "fit.fixture.accuracy_deg",
    "faces",
    "fit.fixture.faces",
    "accel_bias",
    "fit.bounds.accel_bias",
    "accel_scale",
    "fit.bounds.accel_scale",
    "accel_cross_axis",
    "fit.bounds.accel_cross_axis",
    "accel_rate_sensitivity",
    "fit.bounds.accel_rate_sensitivity",
    "gyro_bias",
    "fit.bounds.gyro_bias",
    "gyro_scale",
    "fit.bounds.gyro_scale",
    "gyro_cross_axis",
    "fit.bounds.gyro_cross_axis",
    "gyro_g_sensitivity",
    "fit.bounds.gyro_g_sensitivity",
    "gyro_g2_sensitivity",
    "fit.bounds.gyro_g2_sensitivity",
    "secondary_bias",
    "fit.bounds.secondary_bias",
    "secondary_scale",
    "fit.bounds.secondary_scale",
    "secondary_cross_axis",
    "fit.bounds.secondary_cross_axis",
    "encoding",
    "output.encoding",
    "corrected",
    "output.corrected",
    "chunk_mib",
    "limits.chunk_mib",
    "ratio",
    "limits.ratio",
    "record_mib",
    "limits.record_mib",
    "definition_mib",
    "limits.definition_mib",
    "definitions_mib",
    "limits.definitions_mib",
    "attachments_mib",
    "limits.attachments_mib",
    "channels",
    "limits.channels",
    "viewers",
    "limits.viewers",
    "viewer_kib",
    "limits.viewer_kib",
    "viewer_rate",
    "limits.viewer_rate",
];
