//! Data of a report: the timelines of a recording's IMUs. Annotations are not fitted again.

use crate::Error;
use crate::config::{Config, Layer};
use crate::pipeline::damages::Damages;
use crate::pipeline::learner::Learner;
use crate::pipeline::no_imu::no_imu;
use crate::pipeline::time_order::Apart;
use crate::pipeline::timelines::Timelines;
use crate::report::Timeline;
use crate::run::input::recording::Watch;
use crate::run::input::splits::{Input, Read};
use crate::run::output::spill::Spill;

/// Data of a report.
#[derive(Debug, Default)]
pub struct ReportData {
    /// The IMUs.
    pub imus: Vec<Timeline>,
    /// Settings that were used, as TOML.
    pub settings: String,
    /// Whether these are those of annotations, which were read.
    pub is_annotated: bool,
    /// Missing or wrong parts, one line each.
    pub notes: Vec<String>,
    /// Number of damaged places.
    pub damages: u64,
}

/// Reads the data of a recording, annotated or not, or of a sidecar.
///
/// # Errors
///
/// If it cannot be read, or has neither annotations nor a usable IMU topic.
pub fn report_data(input: &Input, config: &Config, watch: Watch<'_>) -> Result<ReportData, Error> {
    report_data_in_order(input, config, watch, None)
}

/// The same, with messages of these channels in log-time order.
fn report_data_in_order(
    input: &Input,
    config: &Config,
    watch: Watch<'_>,
    order: Option<Apart>,
) -> Result<ReportData, Error> {
    let settings = input.settings()?.and_then(|mut settings| settings.remove("configuration"));
    // A configuration of another version may not parse; it is shown nevertheless.
    let used = settings.as_ref().and_then(|text| Config::load(&[Layer::file("the recording", text)]).ok());
    let config = used.as_ref().unwrap_or(config);
    let mut timelines = Timelines::new(config, settings.is_some());
    let mut learner = settings.is_none().then(|| match order {
        Some(channels) => Learner::new(config).in_time_order(channels, Box::new(Spill::temporary())),
        None => Learner::new(config),
    });
    let mut splits = input.split_names();
    learner.iter_mut().for_each(|learner| learner.begin_split(splits.next(), true));
    input.scan(config.limits.of_recordings(), watch, |read| {
        match read {
            Read::Event(event) => {
                timelines.take(&event);
                if let Some(learner) = &mut learner {
                    learner.take(event, &mut |_| {});
                }
            }
            Read::SplitEnd => {
                timelines.begin_split();
                if let Some(learner) = &mut learner {
                    learner.end_split();
                    learner.begin_split(splits.next(), false);
                }
            }
        }
        learner.iter_mut().for_each(|learner| timelines.learned(learner));
        learner.as_mut().and_then(Learner::take_failure).map_or(Ok(()), Err)
    })?;
    let mut hidden = Damages::default();
    input.hidden_damages(config.limits.of_recordings(), watch, |split, damage| hidden.add(split, damage))?;
    timelines.damages.or_more(hidden);
    if let Some(apart) = learner.as_ref().and_then(Learner::apart) {
        return report_data_in_order(input, config, watch, Some(apart));
    }
    if let Some(mut learner) = learner {
        learner.close(&mut |_| {});
        if let Some(failure) = learner.take_failure() {
            return Err(failure);
        }
        timelines.learned(&mut learner);
        if !learner.has_imu() {
            return Err(no_imu(input.path(), learner.sources(), &learner.obstacles()));
        }
        let learned = learner.finish(&mut |_| {});
        timelines.notes.extend(learned.notes.into_iter().chain(learned.missing));
    }
    let why_none = timelines.why_no_imu();
    let (imus, notes, damages) = timelines.finish();
    if imus.is_empty() {
        let why = format!("was annotated, but no IMU was found in it: {why_none}");
        return Err(Error::input(input.path(), why));
    }
    let is_annotated = settings.is_some();
    Ok(ReportData { imus, settings: settings.unwrap_or_else(|| config.canonical()), is_annotated, notes, damages })
}
