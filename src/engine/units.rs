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
        (Some((unit, set)), None) => {
            let remedy = set.map_or_else(|none| format!(", {none}"), |set| format!(": {}", setting("gyro", &[set])));
            (Misread::Unit, format!("{unit}{remedy}"))
        }
        (Some((unit, set)), Some(order)) => {
            let none = set.as_ref().map_or_else(|none| format!(", {none}"), |_| String::new());
            let set: Vec<_> = set.into_iter().chain(std::iter::once(axes_setting(axes))).collect();
            (Misread::Unit, format!("{unit}{none}; {}: {}", order.text, setting("gyro", &set)))
        }
        (None, Some(OtherOrder { kind, text, accelerometer })) => {
            let gyro = setting("gyro", &[axes_setting(axes)]);
            let remedy = match accelerometer {
                None => gyro,
                Some(order) => {
                    let accel = setting("accel", &[axes_setting(order)]);
                    format!("{accel}; or, if it is the gyroscope's that are wrong, {gyro}")
                }
            };
            (
                kind,
                format!(
                    "{text}: gravity turns between rests against what the rates say. Correct it in the driver, or {remedy}"
                ),
            )
        }
        (None, None) => (Misread::Unit, String::new()),
    }
}

/// Setting of a triad, as a sentence.
fn setting(triad: &str, entries: &[String]) -> String {
    format!("set {triad} = {{ {} }} in its [[imu]]", entries.join(", "))
}

/// Setting of the axes that are the sensor's.
fn axes_setting(order: AxisOrder) -> String {
    let name = |axis: usize| format!("\"{}{}\"", if order.flipped[axis] { "-" } else { "" }, NAMES[order.from[axis]]);
    format!("axes = [{}, {}, {}]", name(0), name(1), name(2))
}

const NAMES: [&str; 3] = ["x", "y", "z"];

/// Text on rates in another unit, from the recorded number per rad/s, or else `or`, and the setting for it, or what to do
/// instead.
fn other_unit(recorded: f64, or: Option<f64>) -> (String, Result<String, &'static str>) {
    let called = |recorded: f64| match RateScale::near(recorded) {
        RateScale::Radians => "in rad/s".to_owned(),
        RateScale::Degrees => "in deg/s".to_owned(),
        RateScale::Milliradians => "in mrad/s".to_owned(),
        RateScale::Millidegrees => "in thousandths of a deg/s".to_owned(),
        RateScale::RevolutionsPerMinute => "in revolutions per minute".to_owned(),
        RateScale::Revolutions => "in revolutions per second".to_owned(),
        RateScale::Counts(a_degree) => format!("raw counts of the converter, {a_degree:.1} a °/s"),
        RateScale::Unknown(times) => format!("{} times those in rad/s", rounded(times)),
    };
    let or = or.map(|or| format!(", or {}", called(or))).unwrap_or_default();
    let set = match RateScale::near(recorded) {
        RateScale::Radians => Ok("unit = \"rad/s\"".to_owned()),
        RateScale::Degrees => Ok("unit = \"deg/s\"".to_owned()),
        RateScale::Unknown(_) => {
            Err("which is no known unit: is the full-scale range that its driver assumes the one that is set?")
        }
        _ => Err("which no setting converts: record them in rad/s or deg/s"),
    };
    (format!("between rests gravity turned as if the rates were {}{or}", called(recorded)), set)
}

/// Text of a factor that is known to a few percent.
fn rounded(times: f64) -> String {
    let digits = if times < 0.1 { 3 } else { usize::from(times < 1.0) + usize::from(times < 10.0) };
    format!("{times:.digits$}")
}

/// Axes that are not in order.
struct OtherOrder {
    kind: Misread,
    text: String,
    /// Order to set for the accelerometer, where a fault of that explains it more simply.
    accelerometer: Option<AxisOrder>,
}

impl OtherOrder {
    fn of_gyroscope(kind: Misread, text: String) -> Self {
        Self { kind, text, accelerometer: None }
    }
}

/// Tells of axes that are not in order.
fn other_axes(axes: AxisOrder) -> OtherOrder {
    if axes.is_in_order() {
        return flipped(axes.flipped);
    }
    let exchanged = |order: AxisOrder| {
        let moved: Vec<_> = (0..3).filter(|&axis| order.from[axis] != axis).map(|axis| NAMES[axis]).collect();
        (order.flipped == [false; 3] && moved.len() == 2).then(|| moved.join(" and "))
    };
    if let Some(pair) = exchanged(axes) {
        return OtherOrder::of_gyroscope(Misread::Gyroscope, format!("the gyroscope's {pair} axes are exchanged"));
    }
    if let Some(pair) = exchanged(axes.reversed()) {
        return OtherOrder {
            kind: Misread::Accelerometer,
            text: format!(
                "the accelerometer's {pair} axes are exchanged (or the gyroscope's, and all of its axes flipped)"
            ),
            accelerometer: Some(axes.reversed()),
        };
    }
    let read = |axis: usize| format!("{}{}", if axes.flipped[axis] { "-" } else { "" }, NAMES[axes.from[axis]]);
    let kind = if axes.is_mirrored() { Misread::Gyroscope } else { Misread::Turned };
    OtherOrder::of_gyroscope(
        kind,
        format!(
            "the axes of gyroscope and accelerometer are exchanged: the accelerometer's x, y, z are the gyroscope's {}, {}, {}",
            read(0),
            read(1),
            read(2)
        ),
    )
}

/// Tells of axes with the wrong sign.
fn flipped(flipped: [bool; 3]) -> OtherOrder {
    let named = |state: bool| {
        let axes = NAMES.into_iter().zip(flipped);
        axes.filter(|(_, flipped)| *flipped == state).map(|(axis, _)| axis).collect::<Vec<_>>()
    };
    let of_gyroscope = |text| OtherOrder::of_gyroscope(Misread::Gyroscope, text);
    match flipped.iter().filter(|flipped| **flipped).count() {
        1 => of_gyroscope(format!("the gyroscope's {} axis is flipped", named(true).join(", "))),
        2 => {
            let (kept, turned) = (named(false).join(", "), named(true).join(" and "));
            OtherOrder {
                kind: Misread::Accelerometer,
                text: format!(
                    "the accelerometer's {kept} axis is flipped, or the gyroscope's {turned} are, as in another frame (FRD beside FLU, \
                     say)"
                ),
                accelerometer: Some(AxisOrder { flipped: flipped.map(|flipped| !flipped), ..AxisOrder::RIGHT }),
            }
        }
        _ => of_gyroscope("all axes of the gyroscope are flipped".to_owned()),
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
            (9.5, "revolutions per minute"),
            (4.1, "4.1 times those in rad/s"),
            (0.25, "0.25 times those in rad/s"),
        ] {
            let (kind, text) = otherwise(per_radian, None, AxisOrder::RIGHT, rad);
            assert!(kind == Misread::Unit && text.contains(word), "{per_radian}: {text}");
        }
        let (_, text) = otherwise(1_f64.to_radians(), None, AxisOrder::RIGHT, RateUnit::DegreesPerSecond);
        assert!(text.contains("unit = \"rad/s\""), "{text}");
    }

    #[test]
    fn every_order_of_axes_is_called_by_what_it_is() {
        let order = |from, flipped| {
            let OtherOrder { kind, text, .. } = other_axes(AxisOrder { from, flipped });
            (kind, text)
        };
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

    #[test]
    fn what_is_to_be_set_is_said_once_with_unit_and_axes() {
        let degrees = 1_f64.to_degrees();
        let order = |from, flipped| AxisOrder { from, flipped };
        for (per_radian, axes, expected) in [
            (1.0, order([1, 0, 2], [false; 3]), &["gyro = { axes = [\"y\", \"x\", \"z\"] }"][..]),
            (
                degrees,
                order([1, 0, 2], [false, false, true]),
                &["gyro = { unit = \"deg/s\", axes = [\"y\", \"x\", \"-z\"] }"],
            ),
            (
                1.0,
                order([0, 1, 2], [false, true, true]),
                &["accel = { axes = [\"-x\", \"y\", \"z\"] }", "gyro = { axes = [\"x\", \"-y\", \"-z\"] }"],
            ),
            (
                1.0,
                order([0, 2, 1], [true; 3]),
                &["accel = { axes = [\"x\", \"z\", \"y\"] }", "gyro = { axes = [\"-x\", \"-z\", \"-y\"] }"],
            ),
        ] {
            let (_, text) = otherwise(per_radian, None, axes, RateUnit::RadiansPerSecond);
            assert_eq!(text.matches(" = {").count(), expected.len(), "{text}");
            assert!(expected.iter().all(|set| text.contains(set)), "no {expected:?} in {text}");
        }
    }
}
