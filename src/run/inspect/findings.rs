//! Findings of a recording: read from its annotations where it has some, else learned. Nothing is fitted again.

use std::collections::BTreeMap;

use crate::Error;
use crate::annotate;
use crate::config::Config;
use crate::engine;
use crate::record::{Damage, Event};
use crate::report::Findings;
use crate::run::batch::calibrate;
use crate::run::input::recording::Watch;
use crate::run::input::splits::{Input, Read};

/// What is known of a recording or sidecar.
#[derive(Debug, Default)]
pub struct Found {
    /// Its IMUs.
    pub imus: Vec<Findings>,
    /// The first thing that is wrong with it.
    pub damage: Option<Damage>,
    /// How many damages there are.
    pub damages: u64,
}

/// Reads what is known of the IMUs of a recording or sidecar.
///
/// # Errors
///
/// If it cannot be read, or has neither annotations nor a usable IMU topic.
pub fn findings(input: &Input, config: &Config, watch: Watch<'_>) -> Result<Found, Error> {
    let mut found = read_annotations(input, watch)?;
    if found.imus.is_empty() {
        found.imus = calibrate(input, config, watch)?.imus;
    }
    Ok(found)
}

fn read_annotations(input: &Input, watch: Watch<'_>) -> Result<Found, Error> {
    let mut schemas = BTreeMap::new();
    let mut channels = BTreeMap::new();
    let mut types = BTreeMap::new();
    let Found { mut imus, mut damage, mut damages } = Found::default();
    input.scan(watch, |read| {
        match read {
            Read::Event(Event::Schema(schema)) => {
                schemas.insert(schema.id, schema.name.clone());
            }
            Read::Event(Event::Channel(channel)) => {
                let schema: String = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                types.insert(channel.topic.clone(), schema.clone());
                if let Some((imu, _)) = channel.topic.split_once("/stillpoint/").filter(|(imu, _)| !imu.is_empty()) {
                    channels.insert(channel.id, (imu.to_owned(), schema, channel.message_encoding.clone()));
                }
            }
            Read::Event(Event::Message(message)) => {
                let Some((name, schema, encoding)) = channels.get(&message.channel) else { return Ok(()) };
                // What cannot be read is not an annotation of this version, such as a corrected reading.
                let Ok(said) = annotate::read(schema, encoding, message.data) else { return Ok(()) };
                let known = imus.iter().position(|imu| imu.name == *name).unwrap_or_else(|| {
                    imus.push(Findings::new(name, name));
                    imus.len() - 1
                });
                if let Some(imu) = imus.get_mut(known) {
                    imu.note(&engine::Event { log_time: message.log_time, message: said });
                }
            }
            Read::Event(Event::Damage(found)) => {
                damages += 1;
                damage.get_or_insert(found);
            }
            Read::Event(_) => {}
            Read::SplitEnd => {
                schemas.clear();
                channels.clear();
            }
        }
        Ok(())
    })?;
    for imu in &mut imus {
        let accelerometer = imu.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
        imu.topic = accelerometer.map_or_else(|| imu.name.clone(), |triad| triad.topic.clone());
        imu.source_type = types.get(&imu.topic).cloned().unwrap_or_default();
    }
    Ok(Found { imus, damage, damages })
}
