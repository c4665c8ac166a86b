//! Remarks on the first messages of the channels, and their effect on the suggested configuration.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use super::units::{self, Peeked};
use crate::config::Config;
use crate::engine::UnitProbe;
use crate::imu::{FirstReadings, Reading, RefusalCount, Relation, Sensor};
use crate::record::Event;
use crate::run::input::recording::{Recording, Watch};
use crate::run::inspect::look::{ChannelLook, Stamped, Use, head};
use crate::run::inspect::rate::Rate;
use crate::{Error, Stamp};

/// Most accelerometers that are compared in pairs, to recognise one sensor on two topics.
const COMPARED: usize = 64;

/// Looks at the first messages, mapping suggested topics too, and adds remarks on them.
pub(super) fn peek(
    recording: &Recording,
    config: &Config,
    watch: Watch<'_>,
    channels: &mut [Use],
) -> Result<(), Error> {
    // No more than a recording may have.
    let suggested = channels.iter().filter_map(|used| used.configuration.clone()).take(config.limits.imus);
    let imus: Vec<_> = config.imu.iter().cloned().chain(suggested).collect();
    let mut look = ChannelLook::new(&Config { imu: imus, ..config.clone() });
    let mut peeks: BTreeMap<(usize, usize), (Sensor, FirstReadings)> = BTreeMap::new();
    let mut probes: BTreeMap<usize, UnitProbe> = BTreeMap::new();
    // IMUs whose gyroscope unit no turn has confirmed yet.
    let (mut untold, mut settled) = (BTreeSet::new(), BTreeSet::new());
    let mut stamped = BTreeMap::new();
    // Triads whose readings have not shown enough yet.
    let mut open = BTreeSet::new();
    let mut rates: BTreeMap<u16, Rate> = BTreeMap::new();
    let mut looked_at: BTreeMap<u16, u64> = BTreeMap::new();
    head(recording, config.limits.of_recordings(), watch, |event| {
        let Event::Message(message) = event else {
            look.take(event);
            return false;
        };
        rates.entry(message.channel).or_default().push(message.log_time);
        *looked_at.entry(message.channel).or_default() += 1;
        let mut measured = None;
        let mut told = None;
        look.sources.intake.message(message.channel, message.log_time, message.data, &mut |imu, sensor, reading| {
            if let Reading::Sample(sample) = reading {
                measured = Some(sample.stamp);
                let place = (imu.index(), sensor.index());
                let probe = probes.entry(imu.index()).or_insert_with(|| UnitProbe::new(&config.still));
                probe.push(sensor, &sample);
                if sensor == Sensor::Gyroscope {
                    told = Some(imu.index());
                }
                let peek = &mut peeks.entry(place).or_insert((sensor, FirstReadings::default())).1;
                peek.push(sample);
                if peek.wants_more() {
                    open.insert(place)
                } else {
                    open.remove(&place)
                };
            }
        });
        if let Some(imu) = told {
            let unit = look.sources.intake.imus().get(imu).and_then(|imu| imu.gyro_unit).unwrap_or_default();
            if probes.get_mut(&imu).is_some_and(|probe| probe.is_settled(unit)) {
                settled.insert(imu);
            }
            if settled.contains(&imu) {
                untold.remove(&imu)
            } else {
                untold.insert(imu)
            };
        }
        if let (Some(measured), Entry::Vacant(new)) = (measured, stamped.entry(message.channel)) {
            let logged = Stamp::from_log_time(message.log_time);
            let is_near = |stamp: Stamp| stamp.seconds_since(logged).abs() < 3600.0;
            let messages = look.stamp(&message).is_some_and(is_near);
            new.insert(Stamped { samples: is_near(measured), messages });
        }
        // A topic that begins later is not waited for.
        !peeks.is_empty() && open.is_empty() && untold.is_empty()
    })?;
    for used in channels.iter_mut() {
        used.stamped = stamped.get(&used.channel.id).copied().unwrap_or_default();
        used.hz = rates.get(&used.channel.id).and_then(Rate::hz);
    }
    probes.values_mut().for_each(UnitProbe::finish);
    remark_on_refusals(&look.sources.intake.faults(), &looked_at, channels);
    let named = peeks.into_iter().filter_map(|((imu, _), (sensor, peek))| {
        let known = look.sources.intake.imus().get(imu)?;
        let topic = known.triads.iter().find(|triad| triad.sensor == sensor)?.topic.clone();
        let units = (known.accel_unit, known.gyro_unit);
        Some(Peeked { topic, imu_topic: known.topic.clone(), imu, sensor, peek, units, probe: probes.get(&imu)? })
    });
    let peeks: Vec<_> = named.collect();
    let mut places = BTreeMap::new();
    for (place, used) in channels.iter().enumerate() {
        places.entry(used.channel.topic.clone()).or_insert(place);
    }
    for peeked in &peeks {
        let remarks = units::remarks(peeked);
        if let Some(used) = places.get(&peeked.topic).and_then(|&place| channels.get_mut(place)) {
            used.remarks.extend(remarks.said(used.configuration.is_some()));
        }
        if let Some(used) = places.get(&peeked.imu_topic).and_then(|&place| channels.get_mut(place)) {
            remarks.offer(peeked, config, used);
        }
    }
    // Each is compared with each.
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

/// Remarks that readings are refused, and why.
fn remark_on_refusals(faults: &[RefusalCount], looked_at: &BTreeMap<u16, u64>, channels: &mut [Use]) {
    for fault @ RefusalCount { topic, sensor, count, .. } in faults {
        let why = fault.why();
        let Some(used) = channels.iter_mut().find(|used| used.channel.topic == *topic) else { continue };
        let of = looked_at.get(&used.channel.id).copied().unwrap_or_default();
        // A message may hold several readings.
        let of = if of < *count { String::new() } else { format!(" of the first {of}") };
        used.remarks.push(match sensor {
            Some(sensor) => format!("{sensor}: {count}{of} readings are refused: {why}"),
            None => format!("{count}{of} messages are refused: {why}"),
        });
    }
}

/// Remarks which of two topics of one sensor to use.
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
