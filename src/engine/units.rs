//! Units and axes that readings turned out to have, and texts on what to do about it.

use crate::imu::{AccelUnit, RateUnit};
use crate::turns::{AxisOrder, RateScale};

/// Finding on a unit, from the data.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum UnitFinding<Unit> {
    /// No finding.
    #[default]
    Unknown,
    /// The assumed unit.
    Confirmed,
    /// Another unit: the text on it, and the unit to set if there is one.
    Other(String, Option<Unit>),
}

/// Unit of recorded specific force, from the magnitude of gravity at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ForceScale {
    /// m/s², although another unit is set.
    Metres,
    /// Standard gravity, g.
    Gravities,
    /// Thousandths of a g, cm/s², or 1,024 counts per g: too near to each other to be distinguished.
    Thousandths,
    /// Millimetres per second squared.
    Millimetres,
    /// Counts of a converter, so many per g.
    Counts(f64),
}

/// Standard gravity, m/s².
const G: f64 = 9.80665;

impl ForceScale {
    /// Finds the unit of a recording from the magnitude of gravity, in assumed m/s² by this factor; `None` if it is as
    /// it should be, or no known unit matches.
    pub(super) fn of(gravity: f64, factor: f64) -> Option<Self> {
        /// Largest error as a logarithm, mostly from a bias.
        const OFF: f64 = 0.09;
        /// Relative magnitudes that a sensor with a large bias or another full-scale range may have.
        const PLAUSIBLE: std::ops::Range<f64> = 0.45..2.2;
        if PLAUSIBLE.contains(&(gravity / G)) {
            return None;
        }
        let recorded = gravity / factor;
        let counts =
            (8..=15).filter(|bits| *bits != 10).map(|bits| f64::from(1 << bits)).map(|a_g| (Self::Counts(a_g), a_g));
        let named =
            [(Self::Metres, G), (Self::Gravities, 1.0), (Self::Thousandths, 1000.0), (Self::Millimetres, 1000.0 * G)];
        let off = |unit: f64| libm::log(recorded / unit).abs();
        let nearest = named.into_iter().chain(counts).min_by(|(_, a), (_, b)| off(*a).total_cmp(&off(*b)));
        nearest.filter(|(_, unit)| off(*unit) < OFF).map(|(scale, _)| scale)
    }
}

/// Finding on the unit of an accelerometer, from the magnitude of gravity at rest, in m/s² if it was taken for `unit`.
pub fn unit_of_gravity(gravity: f64, unit: AccelUnit) -> UnitFinding<AccelUnit> {
    match ForceScale::of(gravity, unit.factor()) {
        Some(scale) => {
            let setting = match scale {
                ForceScale::Metres => Some(AccelUnit::MetresPerSecondSquared),
                ForceScale::Gravities => Some(AccelUnit::StandardGravity),
                _ => None,
            };
            UnitFinding::Other(not_metres(gravity, scale), setting)
        }
        None if (0.85..1.15).contains(&(gravity / G)) => UnitFinding::Confirmed,
        None => UnitFinding::Unknown,
    }
}

/// Unit to set for a gyroscope that was taken for `unit`, if there is one.
pub(super) fn rate_unit(per_radian: f64, unit: RateUnit) -> Option<RateUnit> {
    let right = (0.8..1.25).contains(&per_radian);
    match RateScale::near(per_radian / unit.factor()) {
        _ if right => None,
        RateScale::Radians => Some(RateUnit::RadiansPerSecond),
        RateScale::Degrees => Some(RateUnit::DegreesPerSecond),
        _ => None,
    }
}

/// Text on a gravity that is not in m/s², although converted as such.
pub(super) fn not_metres(gravity: f64, scale: ForceScale) -> String {
    let what = match scale {
        ForceScale::Metres => "it is in m/s²: set accel = { unit = \"m/s^2\" } in its [[imu]]".to_owned(),
        ForceScale::Gravities => "it is in g: set accel = { unit = \"g\" } in its [[imu]]".to_owned(),
        ForceScale::Thousandths => "it is in mg or cm/s², which no setting converts: record it in m/s² or g".to_owned(),
        ForceScale::Millimetres => "it is in mm/s², which no setting converts: record it in m/s² or g".to_owned(),
        ForceScale::Counts(a_g) => format!(
            "these are raw counts of the converter, {a_g} a g, which no setting converts: record it in m/s² or g"
        ),
    };
    let digits = if gravity < 20.0 { 2 } else { 0 };
    format!("reads {gravity:.digits$} at rest, where gravity is {G:.2} m/s²: {what}")
}

/// Fault of a gyroscope's readings, by the turns.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Misread {
    /// Another unit, with any axes.
    Unit,
    /// Axes that only a fault of the gyroscope explains.
    Gyroscope,
    /// Axes that a fault of the accelerometer explains more simply.
    Accelerometer,
    /// Axes rotated relative to the accelerometer: either sensor may be at fault.
    Turned,
}

/// Fault of the readings, and the text on it. `per_radian` is the number of readings per rad/s, or else `or`, if taken
/// for `unit`.
pub(super) fn otherwise(per_radian: f64, or: Option<f64>, axes: AxisOrder, unit: RateUnit) -> (Misread, String) {
    let right = (0.8..1.25).contains(&per_radian);
    let unit = (!right).then(|| other_unit(per_radian / unit.factor(), or.map(|or| or / unit.factor())));
    let order = (axes != AxisOrder::RIGHT).then(|| other_axes(axes));
    match (unit, order) {
        (Some(unit), Some((_, order))) => (Misread::Unit, format!("{unit}; {order}")),
        (Some(unit), None) => (Misread::Unit, unit),
        (None, Some((kind, order))) => {
            (kind, format!("{order}: gravity turns between rests against what the rates say. Correct it in the driver"))
        }
        (None, None) => (Misread::Unit, String::new()),
    }
}

/// Text on rates in another unit, from the recorded number per rad/s, or else `or`.
fn other_unit(recorded: f64, or: Option<f64>) -> String {
    let called = |recorded: f64| match RateScale::near(recorded) {
        RateScale::Radians => "in rad/s".to_owned(),
        RateScale::Degrees => "in deg/s".to_owned(),
        RateScale::Milliradians => "in mrad/s".to_owned(),
        RateScale::Millidegrees => "in thousandths of a deg/s".to_owned(),
        RateScale::Counts(a_degree) => format!("raw counts of the converter, {a_degree:.1} a °/s"),
    };
    let or = or.map(|or| format!(", or {}", called(or))).unwrap_or_default();
    let remedy = match RateScale::near(recorded) {
        RateScale::Radians => ": set gyro = { unit = \"rad/s\" } in its [[imu]]",
        RateScale::Degrees => ": set gyro = { unit = \"deg/s\" } in its [[imu]]",
        _ => ", which no setting converts: record them in rad/s or deg/s",
    };
    format!("between rests gravity turned as if the rates were {}{or}{remedy}", called(recorded))
}

/// Fault of axes that are not in order, and the text on it.
fn other_axes(axes: AxisOrder) -> (Misread, String) {
    let names = ["x", "y", "z"];
    if axes.is_in_order() {
        return flipped(axes.flipped);
    }
    let exchanged = |order: AxisOrder| {
        let moved: Vec<_> = (0..3).filter(|&axis| order.from[axis] != axis).map(|axis| names[axis]).collect();
        (order.flipped == [false; 3] && moved.len() == 2).then(|| moved.join(" and "))
    };
    if let Some(pair) = exchanged(axes) {
        return (Misread::Gyroscope, format!("the gyroscope's {pair} axes are exchanged"));
    }
    if let Some(pair) = exchanged(axes.reversed()) {
        return (
            Misread::Accelerometer,
            format!("the accelerometer's {pair} axes are exchanged (or the gyroscope's, and all of its axes flipped)"),
        );
    }
    let read = |axis: usize| format!("{}{}", if axes.flipped[axis] { "-" } else { "" }, names[axes.from[axis]]);
    let kind = if axes.is_mirrored() { Misread::Gyroscope } else { Misread::Turned };
    (
        kind,
        format!(
            "the axes of gyroscope and accelerometer are exchanged: the accelerometer's x, y, z are the gyroscope's {}, {}, {}",
            read(0),
            read(1),
            read(2)
        ),
    )
}

/// Fault of axes with the wrong sign, and the text on it.
fn flipped(flipped: [bool; 3]) -> (Misread, String) {
    let named = |state: bool| {
        let axes = ["x", "y", "z"].into_iter().zip(flipped);
        axes.filter(|(_, flipped)| *flipped == state).map(|(axis, _)| axis).collect::<Vec<_>>().join(", ")
    };
    match flipped.iter().filter(|flipped| **flipped).count() {
        1 => (Misread::Gyroscope, format!("the gyroscope's {} axis is flipped", named(true))),
        2 => {
            let (kept, flipped) = (named(false), named(true));
            let text = format!("the accelerometer's {kept} axis is flipped (or the gyroscope's {flipped})");
            (Misread::Accelerometer, text)
        }
        _ => (Misread::Gyroscope, "all axes of the gyroscope are flipped".to_owned()),
    }
}

/// Note that nothing confirms the unit of a gyroscope.
pub fn unconfirmed_unit(unit: RateUnit) -> String {
    let unit = match unit {
        RateUnit::RadiansPerSecond => "rad/s",
        RateUnit::DegreesPerSecond => "deg/s",
    };
    format!(
        "its unit, {unit}, is unconfirmed: gravity did not turn between two rests while the gyroscope could be followed. Turn \
         it over between two rests, or set gyro = {{ unit = \"{unit}\" }} in its [[imu]] if you know it"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_tells_the_unit_of_an_accelerometer_through_its_bias() {
        for (gravity, expected) in [
            (1.0, Some(ForceScale::Gravities)),
            (1000.0, Some(ForceScale::Thousandths)),
            (980.665, Some(ForceScale::Thousandths)),
            (8192.0, Some(ForceScale::Counts(8192.0))),
            (16384.0, Some(ForceScale::Counts(16384.0))),
            (256.0, Some(ForceScale::Counts(256.0))),
            (9806.65, Some(ForceScale::Millimetres)),
            (9.81, None),
            (4.9, None),
            (19.6, None),
            (0.02, None),
            (50.0, None),
        ] {
            for bias in [0.95, 1.0, 1.05] {
                assert_eq!(ForceScale::of(gravity * bias, 1.0), expected, "{gravity}");
            }
        }
        assert_eq!(ForceScale::of(G * G, G), Some(ForceScale::Metres));
        assert_eq!(ForceScale::of(1000.0 * G, G), Some(ForceScale::Thousandths));
    }

    #[test]
    fn every_unit_of_a_gyroscope_is_called_by_its_name() {
        let rad = RateUnit::RadiansPerSecond;
        for (per_radian, word) in [
            (57.0, "unit = \"deg/s\""),
            (1010.0, "mrad/s"),
            (930.0, "16.4 a °/s"),
            (7600.0, "131.0 a °/s"),
            (57_000.0, "thousandths of a deg/s"),
        ] {
            let (kind, text) = otherwise(per_radian, None, AxisOrder::RIGHT, rad);
            assert!(kind == Misread::Unit && text.contains(word), "{per_radian}: {text}");
        }
        let (_, text) = otherwise(1_f64.to_radians(), None, AxisOrder::RIGHT, RateUnit::DegreesPerSecond);
        assert!(text.contains("unit = \"rad/s\""), "{text}");
    }

    #[test]
    fn every_order_of_axes_is_called_by_what_it_is() {
        let order = |from, flipped| other_axes(AxisOrder { from, flipped });
        let right = [0, 1, 2];
        for ((kind, text), expected, words) in [
            (order(right, [true, false, false]), Misread::Gyroscope, "gyroscope's x axis is flipped"),
            (order(right, [true, true, false]), Misread::Accelerometer, "accelerometer's z axis is flipped"),
            (order(right, [true; 3]), Misread::Gyroscope, "all axes"),
            (order([1, 0, 2], [false; 3]), Misread::Gyroscope, "gyroscope's x and y axes are exchanged"),
            (order([0, 2, 1], [true; 3]), Misread::Accelerometer, "accelerometer's y and z axes are exchanged"),
            (order([1, 0, 2], [false, true, false]), Misread::Turned, "gyroscope's y, -x, z"),
            (order([1, 2, 0], [false; 3]), Misread::Turned, "gyroscope's y, z, x"),
        ] {
            assert!(kind == expected && text.contains(words), "{text}");
        }
    }
}
