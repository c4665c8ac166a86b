//! Change of a bias with temperature in the parameters of autopilots.
//!
//! PX4 (`src/modules/sensors/temperature_compensation`, before 1.14 `src/modules/sensors`): `offset = x0 + x1 d + x2 d² +
//! x3 d³` with `d = clip(T, TMIN, TMAX) − TREF`, which is taken off raw readings before the offset and scale of `CAL_*`.
//!
//! ArduPilot (`AP_InertialSensor_tempcal.cpp`, `correct_sensor`): `v −= P(T − 35) − P(CALTEMP − 35)` with `P(u) = (c1 +
//! (c2 + c3 u) u) u · 1e-6`, both temperatures clipped to TMIN and TMAX, before the offset and scale. Both sensors share
//! the range, of at least 10 °C.

use super::error::ExportError;
use crate::fit::temperature::{BiasCourse, HIGHEST, LEAST_SPAN};
use crate::messages::TemperatureModel;
use crate::report::Parameters;

/// Parameters of a file: name, value, whether it is an integer.
pub(super) type Lines = Vec<(String, f64, bool)>;

/// Bias of one sensor over the temperature, along the axes and in the units of the raw readings of an autopilot.
#[derive(Clone, Debug)]
pub(super) struct Thermal {
    pub(super) is_accelerometer: bool,
    /// Offset at the temperature of reference.
    pub(super) offset: [f64; 3],
    pub(super) course: BiasCourse,
    pub(super) id: Option<f64>,
}

/// Reference temperature of ArduPilot's polynomials, °C.
const ARDUPILOT_REFERENCE: f64 = 35.0;
/// Unit of ArduPilot's coefficients, m/s² or rad/s per °C to the power of the degree.
const ARDUPILOT_UNIT: f64 = 1e-6;

fn px4_prefix(slot: u8, is_accelerometer: bool) -> String {
    format!("TC_{}{slot}_", if is_accelerometer { 'A' } else { 'G' })
}

/// Prefix of ArduPilot's polynomials, and the name of the temperature at calibration.
fn ardupilot_names(slot: u8, is_accelerometer: bool) -> (String, String) {
    let sensor = if is_accelerometer { "ACC" } else { "GYR" };
    match slot {
        0..3 => (format!("INS_TCAL{}_", slot + 1), format!("INS_{sensor}{}_CALTEMP", slot + 1)),
        _ => (format!("INS{}_TCAL_", slot + 1), format!("INS{}_{sensor}_CALTEMP", slot + 1)),
    }
}

/// PX4's parameters. `X0` is the offset, so that of `CAL_*` must be 0.
pub(super) fn px4(slot: u8, sensors: &[Thermal]) -> Result<Lines, ExportError> {
    let mut lines = Lines::new();
    for Thermal { is_accelerometer, offset, course, id } in sensors {
        lines.push((format!("TC_{}_ENABLE", if *is_accelerometer { 'A' } else { 'G' }), 1.0, true));
        let prefix = px4_prefix(slot, *is_accelerometer);
        lines.extend(id.map(|id| (format!("{prefix}ID"), id, true)));
        let [low, high] = course.range;
        lines.extend(
            [("TREF", course.reference), ("TMIN", low), ("TMAX", high)]
                .map(|(name, value)| (format!("{prefix}{name}"), value, false)),
        );
        for degree in 0..=HIGHEST {
            let coefficient = |axis: usize| match degree {
                0 => offset[axis],
                _ => course.coefficients.get(degree - 1).map_or(0.0, |coefficient| coefficient[axis]),
            };
            lines.extend((0..3).map(|axis| (format!("{prefix}X{degree}_{axis}"), coefficient(axis), false)));
        }
    }
    Ok(lines)
}

/// ArduPilot's parameters.
pub(super) fn ardupilot(slot: u8, sensors: &[Thermal]) -> Result<Lines, ExportError> {
    // Beyond the range of either sensor nothing is known of it.
    let low = sensors.iter().map(|sensor| sensor.course.range[0]).fold(f64::NEG_INFINITY, f64::max);
    let high = sensors.iter().map(|sensor| sensor.course.range[1]).fold(f64::INFINITY, f64::min);
    if high - low < LEAST_SPAN {
        return Err(ExportError::Refused(format!(
            "ArduPilot needs a range of {LEAST_SPAN} °C that both sensors were seen in, and it is {low:.1} to {high:.1} °C: \
             calibrate the recording anew (stillpoint annotate RECORDING --set fit.temperature=off), or record more of a range"
        )));
    }
    let (prefix, _) = ardupilot_names(slot, true);
    let mut lines = vec![(format!("{prefix}ENABLE"), 1.0, true)];
    lines.extend([("TMIN", low), ("TMAX", high)].map(|(name, value)| (format!("{prefix}{name}"), value, false)));
    for is_accelerometer in [true, false] {
        let sensor = sensors.iter().find(|sensor| sensor.is_accelerometer == is_accelerometer);
        let (_, at) = ardupilot_names(slot, is_accelerometer);
        lines.extend(sensor.map(|sensor| (at, sensor.course.reference, false)));
        let shifted = sensor.map(|sensor| shifted(&sensor.course, ARDUPILOT_REFERENCE)).unwrap_or_default();
        let name = if is_accelerometer { "ACC" } else { "GYR" };
        for (degree, coefficients) in (1..).zip(shifted) {
            let value = |axis: usize| coefficients[axis] / ARDUPILOT_UNIT;
            let axes = ["X", "Y", "Z"].into_iter().enumerate();
            lines.extend(axes.map(|(axis, letter)| (format!("{prefix}{name}{degree}_{letter}"), value(axis), false)));
        }
    }
    Ok(lines)
}

/// Coefficients of the same polynomial about another temperature, its constant left out.
fn shifted(course: &BiasCourse, to: f64) -> [[f64; 3]; HIGHEST] {
    let by = to - course.reference;
    let mut shifted = [[0.0; 3]; HIGHEST];
    for (j, coefficient) in (1..).zip(&course.coefficients) {
        let mut binomial = f64::from(j);
        for (i, target) in (1..=j).zip(shifted.iter_mut()) {
            // (u + by)ʲ by the binomial theorem.
            for (axis, value) in target.iter_mut().enumerate() {
                *value += coefficient[axis] * binomial * by.powi(j - i);
            }
            binomial *= f64::from(j - i) / f64::from(i + 1);
        }
    }
    shifted
}

/// Whether an autopilot corrects a slot for the temperature.
pub(in crate::report) fn is_enabled(parameters: &Parameters, slot: u8) -> bool {
    let (ardupilot, _) = ardupilot_names(slot, true);
    let names = ["TC_A_ENABLE".to_owned(), "TC_G_ENABLE".to_owned(), format!("{ardupilot}ENABLE")];
    names.iter().any(|name| parameters.get(name) == Some(1.0))
}

/// Offset at the temperature of reference beside that of `CAL_*` and `INS_*OFFS`, and its change with temperature, as an
/// autopilot's parameters have them; `None` if they have none.
pub(in crate::report) fn read(
    parameters: &Parameters,
    slot: u8,
    is_accelerometer: bool,
) -> Option<([f64; 3], TemperatureModel)> {
    read_px4(parameters, slot, is_accelerometer).or_else(|| read_ardupilot(parameters, slot, is_accelerometer))
}

fn read_px4(parameters: &Parameters, slot: u8, is_accelerometer: bool) -> Option<([f64; 3], TemperatureModel)> {
    let enable = if is_accelerometer { "TC_A_ENABLE" } else { "TC_G_ENABLE" };
    parameters.get(enable).filter(|enabled| *enabled == 1.0)?;
    let prefix = px4_prefix(slot, is_accelerometer);
    let vector = |degree: usize| -> Option<[f64; 3]> {
        let axis = |axis: usize| parameters.get(&format!("{prefix}X{degree}_{axis}"));
        Some([axis(0)?, axis(1)?, axis(2)?])
    };
    let number = |name: &str| parameters.get(&format!("{prefix}{name}"));
    let coefficients = [vector(1)?, vector(2)?, vector(3)?];
    Some((vector(0)?, model(&coefficients, number("TREF")?, [number("TMIN")?, number("TMAX")?])))
}

fn read_ardupilot(parameters: &Parameters, slot: u8, is_accelerometer: bool) -> Option<([f64; 3], TemperatureModel)> {
    let (prefix, at) = ardupilot_names(slot, is_accelerometer);
    parameters.get(&format!("{prefix}ENABLE")).filter(|enabled| *enabled == 1.0)?;
    let name = if is_accelerometer { "ACC" } else { "GYR" };
    let vector = |degree: usize| {
        let vector = parameters.vector(&format!("{prefix}{name}{degree}_*"))?;
        Some(vector.map(|value| value * ARDUPILOT_UNIT))
    };
    let number = |name: &str| parameters.get(&format!("{prefix}{name}"));
    let range = [number("TMIN")?, number("TMAX")?];
    let about = model(&[vector(1)?, vector(2)?, vector(3)?], ARDUPILOT_REFERENCE, range);
    let reference = parameters.get(&at)?.clamp(range[0], range[1]);
    let coefficients = BiasCourse::of(&about).map(|course| shifted(&course, reference))?;
    Some(([0.0; 3], model(&coefficients, reference, range)))
}

fn model(coefficients: &[[f64; 3]; HIGHEST], reference: f64, [minimum, maximum]: [f64; 2]) -> TemperatureModel {
    let order = coefficients.iter().rposition(|degree| *degree != [0.0; 3]).map_or(0, |last| last + 1);
    let coefficients = coefficients.iter().take(order).flatten().copied().collect();
    TemperatureModel { order: order as u32, reference, minimum, maximum, coefficients, coefficients_std: Vec::new() }
}
