//! What the first messages of the channels show, in words, and what that changes in the configuration that is offered.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use crate::config::Config;
use crate::imu::{AccelUnit, FirstReadings, ImuConfig, Reading, Relation, Sensor, UnitGuess};
use crate::record::Event;
use crate::run::input::recording::{Recording, Watch};
use crate::run::inspect::look::{ChannelLook, Stamped, Use, head};
use crate::run::inspect::rate::Rate;
use crate::{Error, Stamp};

/// So many accelerometers are held against each other, to tell one sensor on two topics.
const COMPARED: usize = 64;

/// Looks at the first messages, those of suggested topics as if they were mapped, and remarks on what they show.
pub(super) fn peek(
    recording: &Recording,
    config: &Config,
    watch: Watch<'_>,
    channels: &mut [Use],
) -> Result<(), Error> {
    let suggested = channels.iter().filter_map(|used| used.configuration.clone());
    let imus: Vec<_> = config.imu.iter().cloned().chain(suggested).collect();
    let mut look = ChannelLook::new(&Config { imu: imus, ..config.clone() });
    let mut peeks: BTreeMap<(usize, usize), (Sensor, FirstReadings)> = BTreeMap::new();
    let mut stamped = BTreeMap::new();
    // Of the readings that are looked at, those that have not shown enough.
    let mut open = BTreeSet::new();
    let mut rates: BTreeMap<u16, Rate> = BTreeMap::new();
    head(recording, watch, |event| {
        let Event::Message(message) = event else {
            look.take(event);
            return false;
        };
        rates.entry(message.channel).or_default().push(message.log_time);
        let mut measured = None;
        look.sources.intake.message(message.channel, message.log_time, message.data, &mut |imu, sensor, reading| {
            if let Reading::Sample(sample) = reading {
                measured = Some(sample.stamp);
                let place = (imu.index(), sensor.index());
                let peek = &mut peeks.entry(place).or_insert((sensor, FirstReadings::default())).1;
                peek.push(sample);
                if peek.wants_more() {
                    open.insert(place)
                } else {
                    open.remove(&place)
                };
            }
        });
        if let (Some(measured), Entry::Vacant(new)) = (measured, stamped.entry(message.channel)) {
            let logged = Stamp::from_log_time(message.log_time);
            let is_near = |stamp: Stamp| stamp.seconds_since(logged).abs() < 3600.0;
            let messages = look.stamp(&message).is_some_and(is_near);
            new.insert(Stamped { samples: is_near(measured), messages });
        }
        // A topic that begins later is not waited for.
        !peeks.is_empty() && open.is_empty()
    })?;
    for used in channels.iter_mut() {
        used.stamped = stamped.get(&used.channel.id).copied().unwrap_or_default();
        used.hz = rates.get(&used.channel.id).and_then(Rate::hz);
    }
    let named = peeks.into_iter().filter_map(|((imu, _), (sensor, peek))| {
        let triads = &look.sources.intake.imus().get(imu)?.triads;
        let topic = triads.iter().find(|triad| triad.sensor == sensor)?.topic.clone();
        Some(Peeked { topic, imu, sensor, peek })
    });
    let peeks: Vec<_> = named.collect();
    let mut places = BTreeMap::new();
    for (place, used) in channels.iter().enumerate() {
        places.entry(used.channel.topic.clone()).or_insert(place);
    }
    for peeked in &peeks {
        if let Some(used) = places.get(&peeked.topic).and_then(|&place| channels.get_mut(place)) {
            remark_on_unit(peeked, config, used);
        }
    }
    // Each is held against each.
    let accelerometers = peeks.iter().filter(|peeked| peeked.sensor == Sensor::Accelerometer).take(COMPARED);
    for (i, one) in accelerometers.clone().enumerate() {
        for other in accelerometers.clone().skip(i + 1).filter(|other| other.imu != one.imu) {
            if let Some(relation) = one.peek.relation(&other.peek) {
                remark_on_twins(&one.topic, &other.topic, relation, channels);
            }
        }
    }
    Ok(())
}

/// The first readings of one triad.
struct Peeked {
    topic: String,
    imu: usize,
    sensor: Sensor,
    peek: FirstReadings,
}

/// Says in which unit a triad seems to be, and puts it into the configuration that is offered.
fn remark_on_unit(Peeked { topic, sensor, peek, .. }: &Peeked, config: &Config, used: &mut Use) {
    let Some(rest) = peek.at_rest() else { return };
    let name = if *sensor == Sensor::Gyroscope { "gyroscope" } else { "accelerometer" };
    let offered = used.configuration.is_some();
    let says = |text: String| format!("{name}: {text}");
    if peek.alternates() {
        let turns = "each reading is far from the one before and near the one before that: two sensors take turns; give them topics, or frame_ids, of their own";
        used.remarks.push(says(turns.to_owned()));
    }
    let is_set = config
        .imu
        .iter()
        .any(|imu| imu.gyro.as_ref().is_some_and(|gyro| gyro.topic.as_ref().unwrap_or(&imu.topic) == topic));
    let remark = match peek.looks(*sensor) {
        UnitGuess::Right if offered => says(format!("reads {rest:.2} m/s² at rest, as it should")),
        UnitGuess::Right => return,
        UnitGuess::Accel(unit) => {
            let unit_name = if unit == AccelUnit::StandardGravity { "g" } else { "m/s^2" };
            set_unit(used, config, |imu| imu.accel.get_or_insert_default().unit = unit);
            says(format!(
                "reads {rest:.2} at rest: not m/s² but g, or the other way round; the lines below say {unit_name}"
            ))
        }
        UnitGuess::Unconfirmed if is_set => return,
        UnitGuess::Unconfirmed => says(format!(
            "reads {rest:.2} where it is quietest: the unit is unconfirmed, a turn and a wrong unit look alike; turns between \
             two rests tell (annotate), or set gyro = {{ unit = \"…\" }}"
        )),
        UnitGuess::Thousandths(unit) => {
            let unit = if unit == AccelUnit::StandardGravity { "g" } else { "m/s²" };
            says(format!(
                "reads {rest:.0} at rest: thousandths of {unit}, which no setting converts; record it in m/s² or g"
            ))
        }
        UnitGuess::Unknown if *sensor == Sensor::Gyroscope => return,
        UnitGuess::Unknown => says(format!(
            "reads {rest:.2} where it is quietest, which is no unit of gravity: moving all the time, or gravity removed?"
        )),
    };
    used.remarks.push(remark);
}

/// Changes the configuration that is offered, that which is there, or that of a topic that has needed none.
fn set_unit(used: &mut Use, config: &Config, change: impl FnOnce(&mut ImuConfig)) {
    let topic = &used.channel.topic;
    let present = config.imu.iter().find(|imu| imu.topic == *topic).cloned();
    let imu = used
        .configuration
        .get_or_insert_with(|| present.unwrap_or_else(|| ImuConfig { topic: topic.clone(), ..ImuConfig::default() }));
    change(imu);
}

/// Says which of two topics of one sensor to use.
fn remark_on_twins(one: &str, other: &str, relation: Relation, channels: &mut [Use]) {
    let is_raw = |topic: &str| topic.to_lowercase().contains("raw");
    let is_corrected = |topic: &str| ["correct", "calib"].iter().any(|word| topic.to_lowercase().contains(word));
    let corrects = |twin: &str, raw: &str| is_raw(raw) && !is_raw(twin) || is_corrected(twin) && !is_corrected(raw);
    let (raw, twin) = if corrects(one, other) { (other, one) } else { (one, other) };
    let known = corrects(twin, raw) && !corrects(raw, twin);
    let (of_raw, of_twin) = match (relation, known) {
        (Relation::Same, true) => (
            format!("{twin} repeats it, value for value: use this one"),
            format!("repeats {raw}, value for value: use {raw}"),
        ),
        (Relation::Same, false) => (
            format!("{twin} repeats it, value for value: one of them suffices"),
            format!("repeats {raw}, value for value: one of them suffices"),
        ),
        (Relation::Affine, true) => (
            format!("the raw readings of {twin}: use this one, its calibration is the sensor's"),
            format!("{raw} corrected (same stamps, a matrix and an offset apart): use {raw}"),
        ),
        (Relation::Affine, false) => (
            format!("the same sensor as {twin}, a matrix and an offset apart: use the one that is not corrected"),
            format!("the same sensor as {raw}, a matrix and an offset apart: use the one that is not corrected"),
        ),
    };
    for used in channels {
        if used.channel.topic == raw {
            used.remarks.push(of_raw.clone());
        } else if used.channel.topic == twin {
            used.remarks.push(of_twin.clone());
        }
    }
}
