//! `stillpoint merge`: the combined calibration of each sensor from many recordings.

use std::ops::Range;

use console::style;
use stillpoint::config::{Change, Config};
use stillpoint::merge::{self, History, Merge, Merged, Point};
use stillpoint::report::{self, Findings, Page, Timeline};
use stillpoint::run::{self, Gathered, Input, SensorKey, Stop};
use stillpoint::{Error, printable};

use super::code::{Code, damaged};
use super::configuration::configuration;
use super::files::{reads, write};
use super::printing::{print, print_json};
use super::progress::Progress;
use super::table::Table;
use super::text::Look;
use super::{annotate, export, listing, summary, unapplied};
use crate::cli;

pub fn run(args: &cli::Merge, json: bool, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let options = export::options(&args.convention)?;
    let by = SensorKey::parse(&args.by)?;
    if json && args.format.is_some() {
        return Err(Error::Usage("--json prints everything, --format one format: choose one of them".to_owned()));
    }
    let inputs = listing::inputs(&args.inputs, args.inputs_from.as_deref(), run::results_under)?;
    let (mut all, mut code, mut passing) = (Merge::default(), Code::Done, 0);
    let mut annotated = Vec::new();
    for path in &inputs {
        let gathered = Input::open(path).and_then(|recording| {
            let progress = Progress::new(&recording, stop);
            run::gather(&recording, &config, &by, &|done| progress.watch(done))
        });
        code = code.max(match gathered {
            Ok(Gathered { evidence, annotated_with, damages }) => {
                annotated.extend(annotated_with.map(|stored| (path.as_path(), stored)));
                if damages > 0 {
                    tracing::warn!("{}: damaged in {damages} places; what is whole is used", path.display());
                }
                all.join(evidence);
                damaged(damages, args.accept_damage)
            }
            Err(error) => {
                passing += usize::from(error.is_passing());
                Code::of(&error)
            }
        });
        stop.check()?;
    }
    if passing > 0 {
        // A merge without them would stand in the way of the one with them.
        tracing::error!("nothing is merged while {passing} of {} inputs cannot be read; try again", inputs.len());
        return Ok(code);
    }
    if all.sensors.is_empty() {
        return Ok(code);
    }
    unapplied::say(&args.configuration, annotated.iter().map(|(path, stored)| (*path, stored.as_str())), |change| {
        applies(change, &config)
    })?;
    let merged = chosen(merge::outcome(&all, &config), args.convention.imu.as_deref())?;
    // The one that was chosen, by whatever it goes.
    let options = report::Options { imu: None, ..options };
    let uncalibrated = merged.iter().filter(|merged| !merged.findings.is_calibrated()).map(|merged| merged.key.clone());
    let uncalibrated: Vec<_> = uncalibrated.collect();
    if args.require_calibration && !uncalibrated.is_empty() {
        code = code.max(Code::Uncalibrated);
    }
    let read = reads(&inputs, &[&args.configuration.config, &args.convention.in_force, &args.inputs_from]);
    if let Some(output) = &args.report {
        write(&page(&merged, inputs.len(), &config), Some(output), args.force, &read)?;
    }
    match args.format {
        Some(format) if format.name == "json" => {
            write(&format!("{:#}\n", merge::document(&merged)), args.output.as_deref(), args.force, &read)?;
        }
        Some(format) => {
            let findings: Vec<Findings> = merged.iter().map(|merged| merged.findings.clone()).collect();
            if let Some(names) = namesakes(&merged) {
                return Err(Error::Usage(format!(
                    "{names}, which {} cannot tell apart: choose one with --imu KEY, or --format json",
                    format.name
                )));
            }
            let refused = export::refused("the merged calibration".as_ref());
            let exported = report::export(&findings, format, &options).map_err(refused)?;
            write(&exported.text, args.output.as_deref(), args.force, &read)?;
            exported.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
        }
        None if json => print_json(&merge::document(&merged))?,
        None => {
            let look = Look::of(&console::Term::stdout());
            let text: Vec<_> = merged.iter().map(|merged| people(merged, look)).collect();
            let text = format!("{}\n", text.join("\n\n"));
            match &args.output {
                Some(output) => write(&console::strip_ansi_codes(&text), Some(output), args.force, &read)?,
                None if console::colors_enabled() => print(&text)?,
                None => print(&console::strip_ansi_codes(&text))?,
            }
        }
    }
    annotate::say_unmet(code, "the merged calibration".as_ref(), &uncalibrated);
    Ok(code)
}

/// The sensor that is asked for by its key, or by a name that it has alone; all if none is.
fn chosen(merged: Vec<Merged>, imu: Option<&str>) -> Result<Vec<Merged>, Error> {
    let Some(imu) = imu else { return Ok(merged) };
    let keys: Vec<_> = merged.iter().map(|merged| merged.key.clone()).collect();
    let (by_key, others): (Vec<_>, Vec<_>) = merged.into_iter().partition(|merged| merged.key == imu);
    let named = others.into_iter().filter(|merged| merged.findings.name == imu || merged.findings.topic == imu);
    let found = if by_key.is_empty() { named.collect() } else { by_key };
    match found.len() {
        1 => Ok(found),
        0 => Err(Error::Usage(format!("no sensor {imu}; there are: {}", keys.join(", ")))),
        several => {
            let keys: Vec<_> = found.iter().map(|merged| merged.key.clone()).collect();
            Err(Error::Usage(format!("{several} sensors are called {imu}; choose one by its key: {}", keys.join(", "))))
        }
    }
}

/// Sensors that share a name, in words.
fn namesakes(merged: &[Merged]) -> Option<String> {
    let shares = |one: &Merged| merged.iter().filter(|other| other.findings.name == one.findings.name).count() > 1;
    let name = &merged.iter().find(|merged| shares(merged))?.findings.name;
    let keys = merged.iter().filter(|merged| merged.findings.name == *name).map(|merged| merged.key.as_str());
    let keys: Vec<_> = keys.collect();
    Some(format!("{} sensors are called {name} ({})", keys.len(), keys.join(", ")))
}

/// Whether a merge follows a setting though the rests and turns are read as they were found.
fn applies(change: &Change, config: &Config) -> bool {
    /// Settings that rests and turns are found by.
    const FOUND_BY: [&str; 16] = [
        "still.detector",
        "still.window_s",
        "still.enter",
        "still.settle_s",
        "still.leave",
        "still.min_rest_s",
        "still.max_duration_s",
        "still.gap_s",
        "still.late_s",
        "still.max_creep",
        "still.accel_ceiling",
        "still.gyro_ceiling",
        "fit.heading",
        "fit.rotations",
        "fit.whole_turns",
        "fit.fix_topic",
    ];
    match change.key.as_str() {
        // A preset applies to the merge, paths and units to the reading.
        "imu" => config.imu.iter().all(|imu| {
            let secondaries = imu.secondary.iter().all(|secondary| secondary.accel.is_none());
            imu.accel.is_none() && imu.gyro.is_none() && imu.temperature.is_none() && secondaries
        }),
        key => !FOUND_BY
            .iter()
            .any(|known| key == *known || key.strip_prefix(known).is_some_and(|rest| rest.starts_with('.'))),
    }
}

fn people(merged: &Merged, look: Look) -> String {
    let mut lines = Vec::new();
    if merged.key != merged.findings.name {
        lines.push(format!("{}", style(printable(&merged.key)).for_stderr().bold()));
    }
    lines.push(summary::imu(&merged.findings, None, look));
    let course = merged.history.course();
    let names = std::iter::once("  merged   ").chain(std::iter::repeat("  note     "));
    for (line, name) in course.notes.iter().zip(names) {
        lines.extend(look.sentence(name, line));
    }
    for jump in &course.jumps {
        let label = format!("  {}   ", style("change").for_stderr().yellow());
        let when = format!("between {} and {}", report::day(jump.after), report::day(jump.before));
        lines.extend(look.sentence(&label, &format!("{when}, {}", jump.what)));
    }
    lines.extend(curve(&merged.history, look));
    lines.join("\n")
}

/// A page with the course of each sensor.
fn page(merged: &[Merged], inputs: usize, config: &Config) -> String {
    let timeline =
        |merged: &Merged| Timeline { course: Some(merged.history.course()), ..Timeline::new(merged.findings.clone()) };
    let timelines: Vec<_> = merged.iter().map(timeline).collect();
    let recording = format!("{inputs} recording{}", if inputs == 1 { "" } else { "s" });
    Page { recording: &recording, timelines: &timelines, notes: &[], settings: &config.canonical(), earlier: None }
        .html()
}

/// The parameters over time: those that read alike share a line, and of the lines as many are evenly chosen as fit a
/// terminal; nothing where there is only one.
fn curve(history: &History, look: Look) -> Vec<String> {
    const LISTED: usize = 24;
    let Some(first) = history.curve.first() else { return Vec::new() };
    let days = |point: &Point| point.time.seconds_since(first.time) / 86_400.0;
    let mut runs: Vec<(Range<f64>, usize, [[String; 3]; 2])> = Vec::new();
    for point in &history.curve {
        let numbers = [&point.bias, &point.scale]
            .map(|[value, std]| [0, 1, 2].map(|i| report::estimate(value[i], 1.96 * std[i])));
        match runs.last_mut() {
            Some((span, count, known)) if *known == numbers => (span.end, *count) = (days(point), *count + 1),
            _ => runs.push((days(point)..days(point), 1, numbers)),
        }
    }
    if runs.len() < 2 {
        return Vec::new();
    }
    let (step, last) = (runs.len().div_ceil(LISTED), runs.len() - 1);
    let mut tables = [Table::default(), Table::default()];
    for (table, name) in tables.iter_mut().zip(["bias x m/s²", "scale x"]) {
        table.row(["days", "times", name, "y", "z"].map(str::to_owned));
    }
    for (_, (span, count, numbers)) in runs.iter().enumerate().filter(|(i, _)| i % step == 0 || *i == last) {
        let [from, until] = [span.start, span.end].map(|days| format!("{days:.2}"));
        let when = if from == until { from } else { format!("{from} to {until}") };
        for (table, axes) in tables.iter_mut().zip(numbers) {
            table.row([when.clone(), format!("{count}×")].into_iter().chain(axes.iter().cloned()));
        }
    }
    let title = style("  over time, with 95 % intervals").for_stderr().dim().to_string();
    [title].into_iter().chain(tables.iter().flat_map(|table| table.lines("  ", look.columns))).collect()
}
