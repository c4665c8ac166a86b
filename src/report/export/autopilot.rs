//! Parameters of autopilots: `corrected = (raw − offset) · scale`, axis by axis, forward-right-down, m/s² and rad/s.
//!
//! Conventions: PX4 `src/lib/sensor_calibration/Accelerometer.hpp` and `Gyroscope.hpp` (`Correct`), ArduPilot
//! `AP_InertialSensor_Backend.cpp` (`_rotate_and_correct_accel`, `_rotate_and_correct_gyro`). Both apply them to raw
//! readings, before the board rotation.

use nalgebra::Vector3;

use super::comments::{comments, heading};
use super::error::ExportError;
use super::format::{Exported, Format, RandomWalks};
use super::options::{Axes, Options, Readings};
use super::selection::{accelerometer, gyroscope, one};
use super::thermal::{self, Lines, Thermal};
use super::unsupported::{BY_TEMPERATURE, LEANER, beyond};
use crate::fit::Calibration;
use crate::fit::temperature::BiasCourse;
use crate::messages::Triad;
use crate::messages::triad::Model;
use crate::report::parameters::rounded;
use crate::report::{Findings, Parameters};

pub(super) const PX4: Format = Format {
    name: "px4",
    help: "CAL_ACC*, CAL_GYRO* for QGroundControl",
    random_walks: RandomWalks::None,
    write: |findings, options| export(&PX4_FILE, one(findings, options)?, options),
};

pub(super) const ARDUPILOT: Format = Format {
    name: "ardupilot",
    help: "INS_ACC*, INS_GYR* for ground stations",
    random_walks: RandomWalks::None,
    write: |findings, options| export(&ARDUPILOT_FILE, one(findings, options)?, options),
};

/// Differences between the two autopilots.
struct Autopilot {
    name: &'static str,
    /// Names of a slot's parameters; `*` stands for the axis.
    names: fn(u8) -> Option<Names>,
    /// A line of the file; `true` for an integer.
    line: fn(&str, f64, bool) -> String,
    /// Parameters of a slot for biases that depend on the temperature.
    thermal: fn(u8, &[Thermal]) -> Result<Lines, ExportError>,
    /// Whether these hold the offset at the temperature of reference.
    holds_offset: bool,
    /// Its correction for the temperature.
    by_temperature: &'static str,
    /// Parameters of the board rotation, which lies between raw and corrected readings.
    rotation: &'static [&'static str],
    notes: &'static [&'static str],
}

/// Names of the parameters of one sensor.
pub(in crate::report) struct Names {
    pub(in crate::report) accel_offset: String,
    pub(in crate::report) accel_scale: String,
    pub(in crate::report) gyro_offset: String,
    accel_id: String,
    gyro_id: String,
    /// Rotations of the sensor against the board, applied after offset and scale; −1 and 0 mean no rotation.
    pub(in crate::report) rotations: Vec<String>,
}

static PX4_FILE: Autopilot = Autopilot {
    name: "PX4",
    names: px4,
    line: |name, value, integer| match integer {
        true => format!("1\t1\t{name}\t{value}\t6\n"),
        false => format!("1\t1\t{name}\t{}\t9\n", rounded(value)),
    },
    thermal: thermal::px4,
    holds_offset: true,
    by_temperature: "before that, raw - (x0 + x1 d + x2 d² + x3 d³), d = clip(T, TMIN, TMAX) - TREF (TC_*)",
    rotation: &["SENS_BOARD_ROT", "SENS_BOARD_X_OFF", "SENS_BOARD_Y_OFF", "SENS_BOARD_Z_OFF"],
    notes: &[
        "convention: PX4 src/lib/sensor_calibration/Accelerometer.hpp, Gyroscope.hpp (Correct)",
        "vehicle, component, name, value, type, as QGroundControl loads them",
    ],
};

static ARDUPILOT_FILE: Autopilot = Autopilot {
    name: "ArduPilot",
    names: ardupilot,
    line: |name, value, integer| match integer {
        true => format!("{name},{value}\n"),
        false => format!("{name},{}\n", rounded(value)),
    },
    thermal: thermal::ardupilot,
    holds_offset: false,
    by_temperature: "before that, raw - P(T - 35) + P(CALTEMP - 35), P(u) = (c1 + (c2 + c3 u) u) u / 1e6 (INS_TCAL*)",
    rotation: &["AHRS_ORIENTATION"],
    notes: &[
        "convention: ArduPilot libraries/AP_InertialSensor/AP_InertialSensor_Backend.cpp (_rotate_and_correct_accel)",
        "ArduPilot learns INS_GYROFFS at each start unless INS_GYR_CAL is 0",
    ],
};

/// PX4's names of a slot.
pub(in crate::report) fn px4(slot: u8) -> Option<Names> {
    (slot < 4).then(|| Names {
        accel_offset: format!("CAL_ACC{slot}_*OFF"),
        accel_scale: format!("CAL_ACC{slot}_*SCALE"),
        gyro_offset: format!("CAL_GYRO{slot}_*OFF"),
        accel_id: format!("CAL_ACC{slot}_ID"),
        gyro_id: format!("CAL_GYRO{slot}_ID"),
        rotations: vec![format!("CAL_ACC{slot}_ROT"), format!("CAL_GYRO{slot}_ROT")],
    })
}

/// ArduPilot's names of a slot.
pub(in crate::report) fn ardupilot(slot: u8) -> Option<Names> {
    let (offset, scale, id) = match slot {
        0 => ("INS_#OFFS_*", "INS_#SCAL_*", "INS_#_ID"),
        1 => ("INS_#2OFFS_*", "INS_#2SCAL_*", "INS_#2_ID"),
        2 => ("INS_#3OFFS_*", "INS_#3SCAL_*", "INS_#3_ID"),
        3 => ("INS4_#OFFS_*", "INS4_#SCAL_*", "INS4_#_ID"),
        4 => ("INS5_#OFFS_*", "INS5_#SCAL_*", "INS5_#_ID"),
        _ => return None,
    };
    let of = |pattern: &str, sensor| pattern.replace('#', sensor);
    Some(Names {
        accel_offset: of(offset, "ACC"),
        accel_scale: of(scale, "ACC"),
        gyro_offset: of(offset, "GYR"),
        accel_id: of(id, "ACC"),
        gyro_id: of(id, "GYR"),
        rotations: Vec::new(),
    })
}

fn export(autopilot: &Autopilot, imu: &Findings, options: &Options) -> Result<Exported, ExportError> {
    let Autopilot { name, .. } = *autopilot;
    let names = (autopilot.names)(options.slot)
        .ok_or_else(|| ExportError::Option(format!("{name} has no sensor {}", options.slot)))?;
    let before = in_force(autopilot, &names, imu, options)?;
    let axes = options.axes.or_else(|| imu.source_type.starts_with("px4_msgs/").then_some(Axes::Frd)).ok_or_else(|| {
        ExportError::Option(format!(
            "{name} counts along forward, right, down: say which way the axes of {} point, --axes frd or flu (ROS, MAVROS)",
            imu.topic
        ))
    })?;
    let signs = axes.signs_to(Axes::Frd);

    let accel = accelerometer(imu, options.sensor.as_deref());
    let gyro = gyroscope(imu);
    let mut warnings = Vec::new();
    let mut used = Vec::new();
    let mut values = String::new();
    let mut put = |pattern: &str, values_of: [f64; 3]| {
        for (axis, value) in ["X", "Y", "Z"].iter().zip(values_of) {
            values += &(autopilot.line)(&pattern.replace('*', axis), value, false);
        }
    };
    let mut warm = Vec::new();
    match &accel {
        Ok((triad, calibration)) => {
            let Diagonal { bias, scale } = diagonal(name, triad, calibration)?;
            let [offset, gain] = [0, 1].map(|i| before.accel[i]);
            let mut offset = each(|i| offset[i] + signs[i] * bias[i] / gain[i]);
            if let Some(course) = course(triad, each(|i| signs[i] / gain[i])) {
                warm.push(Thermal { is_accelerometer: true, offset, course, id: before.accel_id });
                offset = if autopilot.holds_offset { [0.0; 3] } else { offset };
            }
            put(&names.accel_offset, offset);
            put(&names.accel_scale, each(|i| gain[i] / scale[i]));
            used.push(*triad);
        }
        // One of the two triads is enough; none is not.
        Err(error) if gyro.is_some() && options.sensor.is_none() => {
            warnings.push(format!("only the gyroscope: {error}"));
        }
        Err(_) => return Err(accel.err().unwrap_or_else(|| ExportError::Refused(String::new()))),
    }
    match &gyro {
        Some((triad, calibration)) => {
            let bias = if triad.model() == Model::Turns {
                let lost = "cannot hold the sensitivity of a gyroscope, which the turns showed";
                warnings
                    .push(format!("{name} {lost}: only its bias is written; --format json, yaml and kalibr hold it"));
                calibration.bias.into()
            } else {
                let Diagonal { bias, scale } = diagonal(name, triad, calibration)?;
                if scale != [1.0; 3] {
                    return Err(holds(name, "the scale of a gyroscope"));
                }
                bias
            };
            let mut offset = each(|i| before.gyro[i] + signs[i] * bias[i]);
            if let Some(course) = course(triad, signs) {
                warm.push(Thermal { is_accelerometer: false, offset, course, id: before.gyro_id });
                offset = if autopilot.holds_offset { [0.0; 3] } else { offset };
            }
            put(&names.gyro_offset, offset);
            used.push(*triad);
        }
        None => warnings.push("only the accelerometer: the gyroscope is not determined".to_owned()),
    }
    let ids = [(accel.is_ok(), &names.accel_id, before.accel_id), (gyro.is_some(), &names.gyro_id, before.gyro_id)];
    for (_, id, value) in ids.into_iter().filter(|(written, ..)| *written) {
        match value {
            Some(value) => values += &(autopilot.line)(id, value, true),
            None => warnings.push(format!("{id} is not written: it must be that of this sensor already")),
        }
    }

    if !warm.is_empty() {
        let lines = (autopilot.thermal)(options.slot, &warm)?;
        values.extend(lines.iter().map(|(name, value, integer)| (autopilot.line)(name, *value, *integer)));
    }

    let mut lines = heading(imu, &used);
    lines.extend(warm.first().map(|_| autopilot.by_temperature.to_owned()));
    lines.push(
        "corrected = (raw - offset) * scale along forward, right, down: scale is 1 / Stillpoint's, offset its bias"
            .to_owned(),
    );
    lines.push(match (&options.readings, axes) {
        (Readings::Corrected(_), _) => "composed with the parameters that were in force".to_owned(),
        (_, Axes::Frd) => "from raw readings, axes as in the recording".to_owned(),
        (_, Axes::Flu) => "from raw readings, y and z turned from the recording's left and up".to_owned(),
    });
    lines.extend(autopilot.notes.iter().map(|&note| note.to_owned()));
    Ok(Exported { text: comments(&lines) + &values, warnings })
}

/// Parameters that an autopilot applied to the readings before calibration.
struct InForce {
    /// Offset, m/s², and scale.
    accel: [[f64; 3]; 2],
    /// Offset, rad/s.
    gyro: [f64; 3],
    accel_id: Option<f64>,
    gyro_id: Option<f64>,
}

/// Parameters in force. An autopilot applies its parameters to raw readings; applied to corrected ones, they would
/// count twice.
fn in_force(autopilot: &Autopilot, names: &Names, imu: &Findings, options: &Options) -> Result<InForce, ExportError> {
    let Options { readings, slot, .. } = options;
    let slot = *slot;
    let name = autopilot.name;
    let topic = &imu.topic;
    match readings {
        Readings::Unsaid => Err(ExportError::Option(format!(
            "{name} applies its parameters to raw readings: if {topic} holds raw ones, say --raw; if {name} had corrected \
             them already (PX4 sensor_combined, MAVLink HIGHRES_IMU and RAW_IMU), give its parameters with --in-force FILE"
        ))),
        Readings::Raw if is_corrected(&imu.source_type) => Err(ExportError::Option(format!(
            "{} is what PX4 publishes after its own calibration: give the parameters in force with --in-force FILE",
            imu.source_type
        ))),
        Readings::Raw => Ok(InForce { accel: [[0.0; 3], [1.0; 3]], gyro: [0.0; 3], accel_id: None, gyro_id: None }),
        Readings::Corrected(parameters) if thermal::is_enabled(parameters, slot) => Err(ExportError::Refused(format!(
            "the parameters in force correct for the temperature (TC_*, INS_TCAL*), which cannot be composed with: \
                 calibrate a recording of the raw readings, with --raw, or switch that off in {name} while recording"
        ))),
        Readings::Corrected(parameters) => composed(autopilot, names, parameters),
    }
}

fn composed(autopilot: &Autopilot, names: &Names, parameters: &Parameters) -> Result<InForce, ExportError> {
    let is = |name: &str, none: &[f64]| parameters.get(name).is_some_and(|value| !none.contains(&value));
    let of_board = autopilot.rotation.iter().copied().find(|name| is(name, &[0.0]));
    let of_sensor = names.rotations.iter().map(String::as_str).find(|name| is(name, &[-1.0, 0.0]));
    let rotation = of_board.or(of_sensor);
    if let Some(rotation) = rotation {
        return Err(ExportError::Refused(format!(
            "{rotation} turns the readings after their correction: calibrate a recording of the raw ones, with --raw"
        )));
    }
    let vector = |pattern: &str| {
        parameters
            .vector(pattern)
            .ok_or_else(|| ExportError::Refused(format!("the parameters in force lack {}", pattern.replace('*', "X"))))
    };
    let scale = vector(&names.accel_scale)?;
    if scale.iter().any(|&scale| scale <= 0.0) {
        return Err(ExportError::Refused("the parameters in force have a scale that is not positive".to_owned()));
    }
    Ok(InForce {
        accel: [vector(&names.accel_offset)?, scale],
        gyro: vector(&names.gyro_offset)?,
        accel_id: parameters.get(&names.accel_id),
        gyro_id: parameters.get(&names.gyro_id),
    })
}

/// Whether PX4 publishes messages of this type after applying its calibration.
fn is_corrected(source_type: &str) -> bool {
    ["SensorCombined", "VehicleAcceleration", "VehicleAngularVelocity", "VehicleImu"]
        .iter()
        .any(|name| source_type.starts_with("px4_msgs/") && source_type.ends_with(&format!("/{name}")))
}

/// Course of a triad's bias over the temperature, each axis multiplied by a factor.
fn course(triad: &Triad, factors: [f64; 3]) -> Option<BiasCourse> {
    let mut course = triad.temperature.as_ref().and_then(BiasCourse::of)?;
    let factors = Vector3::from(factors);
    course.coefficients.iter_mut().for_each(|coefficient| *coefficient = coefficient.component_mul(&factors));
    Some(course)
}

struct Diagonal {
    bias: [f64; 3],
    scale: [f64; 3],
}

fn diagonal(format: &'static str, triad: &Triad, calibration: &Calibration) -> Result<Diagonal, ExportError> {
    let s = &calibration.sensitivity;
    if (0..9).any(|k| k / 3 != k % 3 && s[(k / 3, k % 3)] != 0.0) {
        return Err(holds(format, "cross-axis sensitivity"));
    }
    if let Some(what) = beyond(triad).find(|&what| what != BY_TEMPERATURE) {
        return Err(holds(format, what));
    }
    Ok(Diagonal { bias: calibration.bias.into(), scale: s.diagonal().into() })
}

fn holds(format: &'static str, what: &str) -> ExportError {
    ExportError::Holds { format, what: what.to_owned(), next: LEANER }
}

fn each(value: impl Fn(usize) -> f64) -> [f64; 3] {
    [value(0), value(1), value(2)]
}
