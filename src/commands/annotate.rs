//! `stillpoint annotate`: each recording is finished or refused on its own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::json;
use stillpoint::config::Config;
use stillpoint::report::{self, Earlier, Findings};
use stillpoint::run::{self, Access, EarlierResult, Form, Input, Options, Reads, Report, Stop, Written};
use stillpoint::{Error, imu::ChannelRole};
use tracing::{info, warn};

use super::code::Code;
use super::configuration::configuration;
use super::files::{make_folder, reads};
use super::manifest::Manifest;
use super::outputs::{self, Output};
use super::printing::{name, print_json};
use super::progress::Progress;
use super::shard::Shard;
use super::text::Look;
use super::{import, listing, summary};
use crate::cli;
use crate::console::COMPOSED;

pub fn run(args: &cli::Annotate, json: bool, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let earlier = import::against(&args.against)?;
    let is_listed = args.inputs_from.is_some() || args.inputs.iter().any(|input| run::is_prefix(input));
    let is_list = is_listed || args.shard.is_some() || args.manifest.is_some();
    let named = listing::named(&args.inputs, args.inputs_from.as_deref(), run::recordings_under)?;
    let shard = Shard::choose(args.shard.as_deref(), is_listed)?;
    let recordings = outputs::recordings(args, named)?;
    let inputs: Vec<_> = recordings.iter().map(|named| named.path.clone()).collect();
    let works = works(args, &inputs, outputs::outputs(args, &recordings, is_list)?);
    refuse_itself(args, &inputs, &works).map_err(Error::of_annotating)?;
    let mut manifest = Manifest::open(args.manifest.as_deref(), &read(args, &inputs))?;
    let (mut gravest, mut passing) = (Code::Done, false);
    for work in works.into_iter().enumerate().filter(|(i, _)| shard.holds(*i)).map(|(_, work)| work) {
        let code = match work.run(args, &config, stop) {
            Ok(Done::Before(finished)) => {
                if json {
                    print_json(&json!({"input": name(work.input()), "output": name(work.output()), "finished": true}))?;
                }
                info!("{} is already the result of this: nothing to do", work.output().display());
                let (damages, calibrated) = finished.outcome.unwrap_or((0, true));
                let code = code_of(damages, calibrated, args.require_calibration, args.accept_damage);
                say_unmet(code, work.input(), &[]);
                manifest.skipped(work.input(), work.output(), code)?;
                code
            }
            Ok(Done::Now(report, written)) => {
                if json {
                    print_json(&work.result(&report, earlier.as_deref()))?;
                }
                if inputs.len() > 1 {
                    info!("{}", work.input().display());
                }
                work.say(&report, written, earlier.as_deref());
                let code = code(&report, &config, args.require_calibration, args.accept_damage);
                say_unmet(code, work.input(), &uncalibrated(&report, &config));
                manifest.done(work.input(), work.output(), &report, written, code)?;
                code
            }
            Err(error) => {
                if json {
                    print_json(&json!({"input": name(work.input()), "error": error.to_string()}))?;
                }
                let code = Code::of(&error);
                // The process that works on it may be done at the next attempt.
                let again = code == Code::Passing || matches!(error, Error::Busy(_) | Error::Stopped);
                passing |= again;
                manifest.failed(work.input(), &error, again)?;
                code
            }
        };
        gravest = gravest.max(code);
        if stop.check().is_err() {
            break;
        }
    }
    Ok(match gravest {
        // Of a list, passing trouble is left to the next attempt.
        Code::Refused if is_list && passing => Code::Passing,
        Code::Refused if is_list => Code::Hopeless,
        gravest => gravest,
    })
}

/// One recording and the paths of its result.
struct Work<'a> {
    /// One file, or the files that are one recording.
    inputs: &'a [PathBuf],
    outputs: Vec<PathBuf>,
    /// Reason why nothing may be written there.
    refusal: Option<String>,
}

/// Finished work.
enum Done {
    Now(Report, Written),
    /// A store had the result already.
    Before(EarlierResult),
}

/// The work to do, recording by recording.
fn works<'a>(args: &cli::Annotate, inputs: &'a [PathBuf], outputs: Vec<Output>) -> Vec<Work<'a>> {
    if args.join {
        let most = if args.sidecar { 1 } else { outputs.len() };
        let refusal = outputs.iter().find_map(|output| output.refusal.clone());
        let outputs = outputs.into_iter().take(most).map(|output| output.path).collect();
        return vec![Work { inputs, outputs, refusal }];
    }
    let each = inputs.chunks(1).zip(outputs);
    each.map(|(inputs, Output { path, refusal })| Work { inputs, outputs: vec![path], refusal }).collect()
}

/// Refuses outputs that are also read. An existing output that is not replaced is only compared.
fn refuse_itself(args: &cli::Annotate, inputs: &[PathBuf], works: &[Work<'_>]) -> Result<(), Error> {
    if args.in_place || !args.force && !args.sidecar {
        return Ok(());
    }
    let reads = read(args, inputs);
    works.iter().flat_map(|work| &work.outputs).try_for_each(|output| reads.refuse(output))
}

/// Files that are read.
fn read(args: &cli::Annotate, inputs: &[PathBuf]) -> Reads {
    reads(inputs, &[&args.configuration.config, &args.against.against, &args.inputs_from])
}

impl Work<'_> {
    fn run(&self, args: &cli::Annotate, config: &Config, stop: &Stop) -> Result<Done, Error> {
        if let Some(why) = &self.refusal {
            return Err(Error::input(self.input(), why));
        }
        if !args.force
            && let [output] = self.outputs.as_slice()
            && let Some(finished) = run::finished(self.input(), output, config)?
        {
            return Ok(Done::Before(finished));
        }
        let access = if args.in_place { Access::Change } else { Access::Read };
        let mut outputs = self.outputs.clone();
        let input = match self.inputs {
            [one] => Input::open_original(one, access)?,
            several => {
                let input = Input::join(several, access)?;
                // Reorders the outputs like the files, which are in time order.
                let place = |file: &Path| several.iter().position(|given| given == file);
                if outputs.len() == several.len() {
                    outputs = input.files().filter_map(place).filter_map(|i| outputs.get(i).cloned()).collect();
                }
                input
            }
        };
        if args.out_dir.as_ref().is_some_and(|folder| !run::is_url(folder)) {
            outputs.iter().filter_map(|output| output.parent()).try_for_each(make_folder)?;
        }
        let progress = Progress::new(&input, stop);
        let form = match (args.in_place, outputs::is_sidecar(args, self.input())) {
            (true, _) => Form::InPlace,
            (_, true) => Form::Sidecar,
            _ => Form::Annotated,
        };
        let cli::Annotate { force, allow_no_imu, verify, sync, .. } = *args;
        let options = Options { form, force, allow_no_imu, verify, sync };
        let done = run::annotate(&input, &outputs, config, options, &|done| progress.watch(done));
        done.map(|(report, written)| Done::Now(report, written)).map_err(|error| match error {
            Error::Exists(path) if input.reads().contains(&path) => Error::ItselfAnnotated(path),
            error => error.of_annotating(),
        })
    }

    fn input(&self) -> &Path {
        self.inputs.first().map_or(Path::new(""), PathBuf::as_path)
    }

    fn output(&self) -> &Path {
        self.outputs.first().map_or(Path::new(""), PathBuf::as_path)
    }

    fn result(&self, report: &Report, earlier: Option<&[Findings]>) -> serde_json::Value {
        let mut result = result(self.input(), self.output(), report, earlier);
        if self.inputs.len() > 1 {
            let names = |paths: &[PathBuf]| paths.iter().map(|path| name(path)).collect::<serde_json::Value>();
            result["inputs"] = names(self.inputs);
            result["outputs"] = names(&self.outputs);
        }
        result
    }

    fn say(&self, report: &Report, written: Written, earlier: Option<&[Findings]>) {
        say(&self.outputs, report, written, earlier);
    }
}

/// The exit code of a finished recording. A configured IMU that is missing counts as not calibrated.
pub fn code(report: &Report, config: &Config, require_calibration: bool, accept_damage: bool) -> Code {
    code_of(report.damages, report.is_calibrated(config), require_calibration, accept_damage)
}

fn code_of(damages: u64, calibrated: bool, require_calibration: bool, accept_damage: bool) -> Code {
    if require_calibration && !calibrated {
        Code::Uncalibrated
    } else if damages > 0 && !accept_damage {
        Code::Damaged
    } else {
        Code::Done
    }
}

/// IMUs without an accelerometer calibration, and topics of configured ones that are missing.
pub fn uncalibrated(report: &Report, config: &Config) -> Vec<String> {
    let is_there = |topic: &str| report.channels.iter().any(|(channel, _)| channel.topic == topic);
    let missing = config.imu.iter().map(|imu| imu.topic.as_str()).filter(|topic| !is_there(topic));
    let undetermined = report.imus.iter().filter(|imu| !imu.is_calibrated()).map(|imu| imu.name.as_str());
    undetermined.chain(missing).map(str::to_owned).collect()
}

/// Says that a required calibration is missing, if that is the outcome: last of all, since the exit code says no more.
pub fn say_unmet(code: Code, what: &Path, uncalibrated: &[String]) {
    if code == Code::Uncalibrated {
        let of = if uncalibrated.is_empty() { String::new() } else { format!(" for {}", uncalibrated.join(", ")) };
        warn!("{}: no accelerometer calibration{of}, and --require-calibration asks for one", what.display());
    }
}

pub fn result(input: &Path, output: &Path, report: &Report, earlier: Option<&[Findings]>) -> serde_json::Value {
    let damage = report
        .damage
        .iter()
        .map(|damage| json!({"offset": damage.offset, "bytes": damage.length, "what": damage.what}));
    let mut result = json!({
        "input": name(input),
        "output": name(output),
        "imus": report::imus(&report.imus),
        "rests": report::rests(&report.imus),
        "messages": report.messages,
        "damage": {"count": report.damages, "found": damage.collect::<serde_json::Value>()},
    });
    if let Some(earlier) = earlier {
        let earlier = &Earlier::new(earlier, &report.imus);
        result["drift"] = report.imus.iter().map(|imu| report::drifts(imu, earlier)).collect();
    }
    result
}

/// Most topics that are named with the reason why they could not be read.
const NAMED: usize = 20;

pub fn say(outputs: &[PathBuf], report: &Report, written: Written, earlier: Option<&[Findings]>) {
    for (reason, topics) in skipped(report) {
        let further = match topics.len().saturating_sub(NAMED) {
            0 => String::new(),
            further => format!(" and {further} more topics"),
        };
        let named: Vec<_> = topics.into_iter().take(NAMED).collect();
        warn!("{}{further}: {reason}", named.join(", "));
    }
    report.notes.iter().for_each(|note| warn!("{note}"));
    report.damage.iter().for_each(|damage| warn!("damaged {damage}"));
    if report.damages > report.damage.len() as u64 {
        warn!("{} damages in all", report.damages);
    }
    let look = Look::of(&console::Term::stderr());
    let earlier = earlier.map(|earlier| Earlier::new(earlier, &report.imus));
    report.imus.iter().for_each(|imu| info!(target: COMPOSED, "{}", summary::imu(imu, earlier.as_ref(), look)));
    for output in outputs {
        match written {
            Written::Now => info!("wrote {}", output.display()),
            Written::Before => info!("{} is already the result of this: nothing to do", output.display()),
        }
    }
    // Last, since another IMU was calibrated in its place.
    report.missing.iter().for_each(|missing| warn!("{missing}"));
}

/// Topics that could not be read, by reason.
pub fn skipped(report: &Report) -> BTreeMap<&str, Vec<&str>> {
    let mut skipped = BTreeMap::<_, Vec<_>>::new();
    for (channel, verdict) in &report.channels {
        if let ChannelRole::Skipped(reason) = verdict {
            skipped.entry(reason.as_str()).or_default().push(channel.topic.as_str());
        }
    }
    skipped
}
