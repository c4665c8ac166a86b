//! Remarks on units by the first messages, and their effect on the suggested configuration.

use crate::config::Config;
use crate::engine::{UnitFinding, UnitProbe, unconfirmed_unit, unit_of_gravity};
use crate::imu::{AccelUnit, ChannelRole, FirstReadings, ImuConfig, RateUnit, Sensor};
use crate::run::inspect::look::Use;

/// The first readings of one triad.
pub(super) struct Peeked<'a> {
    pub(super) topic: String,
    /// Topic of the accelerometer of its IMU.
    pub(super) imu_topic: String,
    /// Index of that IMU.
    pub(super) imu: usize,
    pub(super) sensor: Sensor,
    pub(super) peek: FirstReadings,
    /// Configured units of accelerometer and gyroscope.
    pub(super) units: (Option<AccelUnit>, Option<RateUnit>),
    pub(super) probe: &'a UnitProbe,
}

/// Remarks on one triad.
#[derive(Debug, Default)]
pub(super) struct Remarks {
    /// Lines to print in any case; `offered` only with a suggested mapping.
    always: Vec<String>,
    offered: Option<String>,
    accel: Option<AccelUnit>,
    gyro: Option<RateUnit>,
    /// Whether the accelerometer's readings are of no use, so that no mapping of it is offered.
    without_gravity: bool,
}

/// Remarks on the readings of a triad.
pub(super) fn remarks(peeked: &Peeked<'_>) -> Remarks {
    let mut remarks = Remarks::default();
    let gyroscope = peeked.sensor == Sensor::Gyroscope;
    let name = if gyroscope { "gyroscope" } else { "accelerometer" };
    if peeked.peek.alternates() {
        remarks.always.push(format!(
            "{name}: each reading is far from the one before and near the one before that: two sensors take turns; give them \
             topics, or frame_ids, of their own"
        ));
    }
    match peeked.sensor {
        Sensor::Gyroscope => of_gyroscope(peeked, &mut remarks),
        Sensor::Accelerometer => of_accelerometer(peeked, peeked.probe.gravity(), &mut remarks),
        _ => of_accelerometer(peeked, None, &mut remarks),
    }
    remarks
}

fn of_gyroscope(peeked: &Peeked<'_>, remarks: &mut Remarks) {
    let (_, set) = peeked.units;
    match peeked.probe.gyroscope(set.unwrap_or_default()) {
        UnitFinding::Confirmed => {
            remarks.offered = Some(format!(
                "gyroscope: reads in {}, as the turns between rests show",
                set.unwrap_or_default().name()
            ));
        }
        UnitFinding::Other(text, unit) => {
            remarks.always.push(format!("gyroscope: {text}"));
            remarks.gyro = unit;
        }
        // A configured unit is not asked for.
        UnitFinding::Unknown if set.is_some() => {}
        UnitFinding::Unknown => remarks.always.push(format!("gyroscope: {}", unconfirmed_unit(RateUnit::default()))),
    }
}

/// Standard gravity, m/s², and how far off readings are as they should be.
const STANDARD: f64 = 9.80665;
const AS_IT_SHOULD: f64 = 0.35;
/// Readings at rest, relative to gravity, that a large bias or another range explains, and no other unit.
const PLAUSIBLE: std::ops::Range<f64> = 0.45..2.2;

fn of_accelerometer(peeked: &Peeked<'_>, gravity: Option<f64>, remarks: &mut Remarks) {
    let Some((quietest, quiet)) = peeked.peek.at_rest() else { return };
    let set = peeked.units.0.filter(|_| peeked.sensor == Sensor::Accelerometer);
    let rest = gravity.unwrap_or(quietest);
    let finding = match quiet || gravity.is_some() {
        true => unit_of_gravity(rest, set.unwrap_or_default()),
        false => UnitFinding::Unknown,
    };
    match finding {
        UnitFinding::Confirmed if (rest - STANDARD).abs() < AS_IT_SHOULD => {
            remarks.offered = Some(format!("accelerometer: reads {rest:.2} m/s² at rest, as it should"));
        }
        UnitFinding::Confirmed => {
            remarks.offered = Some(format!(
                "accelerometer: reads {rest:.2} m/s² at rest, where gravity is {STANDARD:.2}: in m/s², with a bias or a scale that \
                 is off by as much"
            ));
        }
        UnitFinding::Other(text, unit) => {
            remarks.always.push(format!("accelerometer: {text}"));
            remarks.accel = unit.filter(|_| peeked.sensor == Sensor::Accelerometer);
        }
        UnitFinding::Unknown if is_without_gravity(rest) => {
            remarks.without_gravity = true;
            remarks.always.push(format!(
                "accelerometer: reads {rest:.2} where it is quietest: gravity was removed before it was recorded, so nothing can \
                 be calibrated by it. Record the accelerometer as it reads, gravity included"
            ));
        }
        UnitFinding::Unknown if quiet && PLAUSIBLE.contains(&(rest / STANDARD)) => remarks.always.push(format!(
            "accelerometer: reads {rest:.2} m/s² where it is quietest, and gravity is {STANDARD:.2}: no other unit would read so; a \
             large bias or scale, which annotate tells, or another range than its driver assumes"
        )),
        UnitFinding::Unknown => remarks.always.push(format!(
            "accelerometer: reads {rest:.2} where it is quietest, which is no unit of gravity: moving all the time, gravity \
             removed, or a large bias (that of a high-g sensor may be 8 m/s²)?"
        )),
    }
}

/// Whether a reading at rest, m/s² or g, has no gravity in it.
fn is_without_gravity(rest: f64) -> bool {
    rest < 0.6
}

impl Remarks {
    /// Lines to print for a topic whose mapping is suggested or not.
    pub(super) fn said(&self, offered: bool) -> Vec<String> {
        self.always.iter().chain(self.offered.iter().filter(|_| offered)).cloned().collect()
    }

    /// Puts the units into the suggested configuration for the topic of the IMU; without a suggestion, into a copy of
    /// the existing configuration or a new one.
    pub(super) fn offer(&self, peeked: &Peeked<'_>, config: &Config, used: &mut Use) {
        if self.without_gravity && matches!(used.verdict, ChannelRole::Other { .. }) {
            used.configuration = None;
            return;
        }
        if self.accel.is_none() && self.gyro.is_none() {
            return;
        }
        let topic = &peeked.imu_topic;
        let present = || config.imu.iter().find(|imu| imu.topic == *topic).cloned();
        let imu = used.configuration.get_or_insert_with(|| {
            present().unwrap_or_else(|| ImuConfig { topic: topic.clone(), ..ImuConfig::default() })
        });
        if let Some(unit) = self.accel {
            imu.accel.get_or_insert_default().unit = Some(unit);
        }
        if let Some(unit) = self.gyro {
            let gyro = imu.gyro.get_or_insert_default();
            gyro.unit = Some(unit);
            if peeked.topic != *topic {
                gyro.topic = Some(peeked.topic.clone());
            }
        }
    }
}
