//! Findings of a recording: read from its annotations where it has some, else learned. Nothing is fitted again.

use std::collections::BTreeMap;

use crate::Error;
use crate::config::Config;
use crate::pipeline::annotations;
use crate::pipeline::channel_table::ChannelTable;
use crate::pipeline::damages::Damages;
use crate::record::{Damage, Event, Limits};
use crate::report::Findings;
use crate::run::batch::calibrate;
use crate::run::input::recording::Watch;
use crate::run::input::splits::{Input, Read};

/// Findings of a recording or sidecar.
#[derive(Debug, Default)]
pub struct Found {
    /// Its IMUs.
    pub imus: Vec<Findings>,
    /// Notes of the recorder on the channels of their topics, by topic.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Configuration that its annotations were made with, as TOML, if they were read; empty if they do not tell.
    pub annotated_with: Option<String>,
    /// Topics that the configuration names and the recording lacks, one line each, if it was calibrated.
    pub missing: Vec<String>,
    /// Its first damage.
    pub damage: Option<Damage>,
    /// Number of damaged places.
    pub damages: u64,
}

/// Reads the findings of the IMUs of a recording or sidecar.
///
/// # Errors
///
/// If it cannot be read, or has neither annotations nor a usable IMU topic.
pub fn findings(input: &Input, config: &Config, watch: Watch<'_>) -> Result<Found, Error> {
    let mut found = read_annotations(input, config.limits.of_recordings(), watch)?;
    if found.imus.is_empty() {
        let learned = calibrate(input, config, watch)?;
        let channels = learned.channels.iter().map(|(channel, _)| channel);
        found.metadata = metadata(&learned.imus, channels.map(|channel| (channel.topic.as_str(), &channel.metadata)));
        found.imus = learned.imus;
        found.missing = learned.missing;
    } else {
        let settings = input.settings()?.and_then(|mut settings| settings.remove("configuration"));
        found.annotated_with = Some(settings.unwrap_or_default());
    }
    Ok(found)
}

fn read_annotations(input: &Input, limits: Limits, watch: Watch<'_>) -> Result<Found, Error> {
    let (mut imus, mut damages, mut split): (Vec<Findings>, _, _) = (Vec::new(), Damages::default(), 0);
    let mut table = ChannelTable::default();
    input.scan_annotations(limits, watch, |read| {
        match read {
            Read::Event(Event::Message(message)) => {
                let Some((name, event)) = annotations::read(&table, &message) else { return Ok(()) };
                if !name.is_empty() {
                    let known = imus.iter().position(|imu| imu.name == name).unwrap_or_else(|| {
                        imus.push(Findings::new(name, name));
                        imus.len() - 1
                    });
                    imus.get_mut(known).into_iter().for_each(|imu| imu.note(&event));
                }
            }
            Read::Event(Event::Damage(found)) => {
                damages.add(split, found);
            }
            Read::Event(event) => {
                table.take(&event);
            }
            Read::SplitEnd => {
                split += 1;
                table.begin_split();
            }
        }
        Ok(())
    })?;
    for imu in &mut imus {
        let accelerometer = imu.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
        imu.topic = accelerometer.map_or_else(|| imu.name.clone(), |triad| triad.topic.clone());
        let source = table.iter().filter(|entry| entry.channel.topic == imu.topic).last();
        imu.source_type = source.map(|entry| entry.schema_name().to_owned()).unwrap_or_default();
    }
    let channels = table.iter().map(|entry| (entry.channel.topic.as_str(), &entry.channel.metadata));
    let metadata = metadata(&imus, channels);
    let mut hidden = Damages::default();
    input.hidden_damages(limits, watch, |split, damage| hidden.add(split, damage))?;
    damages.or_more(hidden);
    Ok(Found { imus, metadata, damage: damages.first().cloned(), damages: damages.count(), ..Found::default() })
}

/// Metadata of the channels on the topics of these IMUs.
fn metadata<'a>(
    imus: &[Findings],
    channels: impl Iterator<Item = (&'a str, &'a BTreeMap<String, String>)>,
) -> BTreeMap<String, BTreeMap<String, String>> {
    let mut all: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    for (topic, entries) in channels.filter(|(topic, _)| imus.iter().any(|imu| imu.topic == *topic)) {
        let known = all.entry(topic.to_owned()).or_default();
        known.extend(entries.iter().map(|(key, value)| (key.clone(), value.clone())));
    }
    all
}
