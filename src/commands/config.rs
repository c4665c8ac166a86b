//! `stillpoint config`: the commented default, the check of a file, and a layout for viewers.

use serde_json::json;
use stillpoint::Error;
use stillpoint::config::Config;
use stillpoint::imu::{ChannelRole, Sensor};
use stillpoint::report::{self, LayoutImu};
use stillpoint::run::{self, Input, Stop};
use stillpoint::topic;

use super::code::Code;
use super::configuration::{configuration, layer};
use super::files::{reads, write};
use super::printing::{print, print_json};
use super::progress::Progress;
use crate::cli;

pub fn run(verb: cli::Config, json: bool, stop: &Stop) -> Result<Code, Error> {
    match verb {
        cli::Config::Show if json => print_json(&json!(Config::default()))?,
        cli::Config::Show => print(Config::COMMENTED)?,
        cli::Config::Layout(args) => layout(&args, stop)?,
        cli::Config::Check { file } => {
            let config = Config::load(&[layer(&file)?])?;
            match json {
                true => print_json(&json!(config))?,
                false => tracing::info!("{}: valid", file.display()),
            }
        }
    }
    Ok(Code::Done)
}

fn layout(args: &cli::Layout, stop: &Stop) -> Result<(), Error> {
    let config = configuration(&args.configuration)?;
    let recording = Input::open(&args.input)?;
    let channels = {
        let progress = Progress::new(&recording, stop);
        run::channels(&recording, &config, &|done| progress.watch(done))?
    };
    let imus: Vec<_> = channels.channels.iter().flat_map(|used| imus(used, &channels.channels)).collect();
    if imus.is_empty() {
        return Err(Error::input(&args.input, "no usable IMU topic; see stillpoint topics"));
    }
    let reads = reads([&args.input], &[&args.configuration.config]);
    write(&format!("{:#}\n", report::layout(&imus)), args.output.as_deref(), args.force, &reads)
}

/// The IMUs whose accelerometer is read from a channel, each with the message paths of its axes. Corrected messages are
/// left out where the recording was annotated without.
fn imus(used: &run::Use, all: &[run::Use]) -> Vec<LayoutImu> {
    let ChannelRole::Used(uses) = &used.verdict else { return Vec::new() };
    let accelerometers = uses.iter().filter(|part| part.sensor == Sensor::Accelerometer);
    accelerometers
        .map(|part| {
            let at = |topic: &str| part.axes.clone().map(|axis| format!("{}.{axis}", report::quoted(topic)));
            let has = |kind| {
                let topic = topic::of(&part.imu, kind);
                all.iter().any(|other| other.channel.topic == topic)
            };
            let may_be_corrected = has(topic::Kind::Corrected) || !has(topic::Kind::Stillness);
            LayoutImu {
                name: part.imu.clone(),
                acceleration: at(&used.channel.topic),
                corrected: may_be_corrected.then(|| at(&topic::of(&part.imu, topic::Kind::Corrected))),
                frame_id: String::new(),
                is_stamped: used.stamped.samples,
                are_readings_stamped: used.stamped.messages,
            }
        })
        .collect()
}
