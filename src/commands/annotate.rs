//! `stillpoint annotate`: each recording is finished or refused on its own.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::json;
use stillpoint::config::Config;
use stillpoint::report::{self, Earlier, Findings};
use stillpoint::run::{self, Access, EarlierResult, Form, Input, Made, Options, Reads, Report, Stop, Written};
use stillpoint::{Error, imu::ChannelRole};
use tracing::{info, warn};

use super::code::Code;
use super::configuration::configuration;
use super::files::{make_folder, reads};
use super::manifest::Manifest;
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
    let listed = listing::inputs(&args.inputs, args.inputs_from.as_deref(), run::recordings_under)?;
    let args = &cli::Annotate { inputs: listed, ..args.clone() };
    let shard = Shard::choose(args.shard.as_deref(), is_listed)?;
    let inputs = inputs(args);
    let works = works(args, &inputs)?;
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
}

/// Finished work.
enum Done {
    Now(Report, Written),
    /// A store had the result already.
    Before(EarlierResult),
}

/// The recordings among the inputs, without results of an earlier run on one of them, as when all files of a folder are
/// named a second time.
fn inputs(args: &cli::Annotate) -> Vec<PathBuf> {
    if args.inputs.len() < 2 {
        return args.inputs.clone();
    }
    let folder = args.out_dir.as_deref();
    let results: BTreeSet<_> = args
        .inputs
        .iter()
        .flat_map(|input| {
            let is_folder = input.is_dir();
            [None, folder]
                .map(|folder| run::default_output(input, is_folder, folder, false))
                .into_iter()
                .filter(move |output| output != input)
        })
        .collect();
    let is_result = |input: &&PathBuf| match (!run::is_url(input)).then(|| run::made(input)).flatten() {
        // To look into each object would be a request.
        _ if run::is_url(input) => run::is_sidecar_name(input) || results.contains(*input),
        Some(Made::Sidecar) => true,
        Some(Made::Annotated) => results.contains(*input),
        None => false,
    };
    let (made, recordings): (Vec<_>, Vec<_>) = args.inputs.iter().partition(is_result);
    if recordings.is_empty() {
        return args.inputs.clone();
    }
    if let Some(first) = made.first() {
        let more = if made.len() > 1 { format!(" and {} more", made.len() - 1) } else { String::new() };
        info!("left out, as results of Stillpoint: {}{more}", first.display());
    }
    recordings.into_iter().cloned().collect()
}

/// The work to do, recording by recording.
fn works<'a>(args: &cli::Annotate, inputs: &'a [PathBuf]) -> Result<Vec<Work<'a>>, Error> {
    let outputs = outputs(args, inputs)?;
    if args.join {
        let outputs = if args.sidecar { outputs.into_iter().take(1).collect() } else { outputs };
        return Ok(vec![Work { inputs, outputs }]);
    }
    let inputs = inputs.chunks(1);
    Ok(inputs.zip(outputs).map(|(inputs, output)| Work { inputs, outputs: vec![output] }).collect())
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

/// Paths of the results, one for each input.
fn outputs(args: &cli::Annotate, inputs: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    if args.in_place {
        return match inputs.iter().find(|input| run::is_url(input)) {
            None => Ok(inputs.to_owned()),
            Some(object) => {
                let why = "an object cannot be changed in place; without --in-place a sidecar is put beside it";
                Err(Error::Usage(format!("{}: {why}", object.display())))
            }
        };
    }
    let mut seen = BTreeMap::new();
    for input in inputs {
        if let Some(other) = seen.insert(whole(input, args.join), input) {
            let spelled = if other == input { String::new() } else { format!(" (and as {})", input.display()) };
            let why = format!("{}: is named twice{spelled}; name each recording once", other.display());
            return Err(Error::Usage(why));
        }
    }
    if let Some(output) = &args.output {
        return match inputs {
            [_] => Ok(vec![output.clone()]),
            _ if args.join && args.sidecar => Ok(vec![output.clone()]),
            _ if args.join => {
                let output = output.display();
                Err(Error::Usage(format!(
                    "-o {output}: each of the joined files keeps a file of its own; --out-dir {output} names a folder for \
                     them, or --sidecar -o {output} one file for all annotations"
                )))
            }
            _ => Err(Error::Usage("-o names one output; use --out-dir for several inputs".to_owned())),
        };
    }
    let mut taken = BTreeMap::new();
    let mut outputs = Vec::new();
    for input in inputs {
        let output = run::default_output(input, input.is_dir(), args.out_dir.as_deref(), is_sidecar(args, input));
        if let Some(other) = taken.insert(output.clone(), input).filter(|_| !(args.join && args.sidecar)) {
            let (other, input, output) = (other.display(), input.display(), output.display());
            return Err(Error::Usage(format!("{other} and {input} would both be written to {output}")));
        }
        outputs.push(output);
    }
    Ok(outputs)
}

/// Path of an input, however it is spelled. A link is an input of its own, unless it would be joined with what it leads to.
fn whole(input: &Path, joined: bool) -> PathBuf {
    let folder = input.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let whole = match input.file_name().filter(|_| !joined) {
        _ if run::is_url(input) => None,
        Some(name) => folder.canonicalize().ok().map(|folder| folder.join(name)),
        None => input.canonicalize().ok(),
    };
    whole.unwrap_or_else(|| input.to_owned())
}

/// Whether the annotations of an input are written alone: in a store unless an output is named, since it would have to
/// hold the recording a second time.
fn is_sidecar(args: &cli::Annotate, input: &Path) -> bool {
    match &args.output {
        Some(output) => args.sidecar || run::is_url(output) && run::is_sidecar_name(output),
        None => args.sidecar || run::is_url(input) || args.out_dir.as_deref().is_some_and(run::is_url),
    }
}

impl Work<'_> {
    fn run(&self, args: &cli::Annotate, config: &Config, stop: &Stop) -> Result<Done, Error> {
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
        if let Some(folder) = args.out_dir.as_ref().filter(|folder| !run::is_url(folder)) {
            make_folder(folder)?;
        }
        let progress = Progress::new(&input, stop);
        let form = match (args.in_place, is_sidecar(args, self.input())) {
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

pub fn say(outputs: &[PathBuf], report: &Report, written: Written, earlier: Option<&[Findings]>) {
    for (reason, topics) in skipped(report) {
        warn!("{}: {reason}", topics.join(", "));
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
