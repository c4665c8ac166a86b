//! `stillpoint report`: the findings, as a page or on the terminal.

use console::style;
use serde_json::{Value, json};
use stillpoint::report::{self, Earlier, Findings, Page, Timeline};
use stillpoint::run::{self, Input, Stop};
use stillpoint::{Error, printable};

use super::code::{Code, damaged};
use super::configuration::configuration;
use super::files::{reads, write};
use super::printing::{print, print_json};
use super::progress::Progress;
use super::table::Table;
use super::text::Look;
use super::{import, summary, unapplied};
use crate::cli;

pub fn run(args: &cli::Report, json: bool, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let earlier = import::against(&args.against)?;
    let earlier = earlier.as_deref();
    let recording = Input::open(&args.input)?;
    let data = {
        let progress = Progress::new(&recording, stop);
        run::report_data(&recording, &config, &|done| progress.watch(done))?
    };
    let annotated = data.is_annotated.then_some((args.input.as_path(), data.settings.as_str()));
    unapplied::say(&args.configuration, annotated, |change| change.key.starts_with("output."))?;
    if json {
        print_json(&machine(&data.imus, earlier))?;
    }
    if let Some(output) = &args.output {
        let name = args.input.file_name().unwrap_or_default().to_string_lossy();
        let (imus, notes, settings) = (&data.imus, &data.notes, &data.settings);
        let page = Page { recording: &name, timelines: imus, notes, settings, earlier };
        let reads = reads([&args.input], &[&args.configuration.config, &args.against.against]);
        write(&page.html(), Some(output), args.force, &reads)?;
    } else if !json {
        let look = Look::of(&console::Term::stdout());
        let recorded = data.imus.iter().map(|timeline| &timeline.findings);
        let earlier = earlier.map(|earlier| Earlier::new(earlier, recorded));
        let text: Vec<_> = data.imus.iter().map(|timeline| people(timeline, earlier.as_ref(), look)).collect();
        let notes: String = data.notes.iter().map(|note| format!("{}\n", printable(note))).collect();
        let text = format!("{}\n{notes}", text.join("\n\n"));
        // The summary is coloured for standard error; piped output has no colours.
        let plain = !console::colors_enabled();
        print(&if plain { console::strip_ansi_codes(&text).into_owned() } else { text })?;
    }
    Ok(damaged(data.damages, args.accept_damage))
}

fn machine(timelines: &[Timeline], earlier: Option<&[Findings]>) -> Value {
    let mut result = json!({"imus": report::imus(timelines.iter().map(|timeline| &timeline.findings))});
    if let Some(earlier) = earlier {
        let earlier = &Earlier::new(earlier, timelines.iter().map(|timeline| &timeline.findings));
        result["drift"] = timelines.iter().map(|timeline| report::drifts(&timeline.findings, earlier)).collect();
    }
    result
}

fn people(timeline: &Timeline, earlier: Option<&Earlier<'_>>, look: Look) -> String {
    let mut lines = vec![summary::imu(&timeline.findings, earlier, look)];
    lines.extend(bar(timeline, look.columns.min(MOST_COLUMNS) - 2));
    lines.extend(rests(&timeline.findings, look));
    lines.join("\n")
}

/// Largest width of the bar, in columns.
const MOST_COLUMNS: usize = 78;

/// The recording as one bar of blocks: rests on a face, rejected rests, motion.
fn bar(timeline: &Timeline, columns: usize) -> Vec<String> {
    let rests = &timeline.findings.rests;
    let Some((from, until)) = timeline.span().filter(|(from, until)| from < until && !rests.is_empty()) else {
        return Vec::new();
    };
    let seconds = until.seconds_since(from);
    let mut marks = vec!['·'; columns];
    let mut names = vec![' '; columns];
    let mut free_from = 0;
    for rest in rests.values() {
        let (start, end) = (report::seconds(&rest.start, from), report::seconds(&rest.end, from));
        let column = |at: f64| ((at / seconds * columns as f64).max(0.0) as usize).min(columns - 1);
        let (first, last) = (column(start), column(end));
        let mark = if rest.accepted { '█' } else { '░' };
        marks.iter_mut().take(last + 1).skip(first).for_each(|place| *place = mark);
        if rest.accepted && first >= free_from {
            printable(&rest.face).chars().zip(names.iter_mut().skip(first)).for_each(|(letter, place)| *place = letter);
            free_from = first + rest.face.chars().count() + 1;
        }
    }
    let text = |letters: Vec<char>| letters.into_iter().collect::<String>();
    vec![
        format!("  {}", style(format!("{seconds:.0} s: █ accepted rest, ░ rejected, · motion")).dim()),
        format!("  {}", text(marks)),
        format!("  {}", text(names).trim_end()),
    ]
}

/// The accepted rests, as many as fit a terminal.
fn rests(findings: &Findings, look: Look) -> Vec<String> {
    const LISTED: usize = 40;
    let accelerometer = findings.calibration.as_ref().and_then(|found| found.accelerometer.as_ref());
    let known = accelerometer.and_then(report::calibration);
    let gravity = findings.calibration.as_ref().map_or(9.80665, |found| found.gravity);
    let mut table = Table::default();
    table.row(["rest", "length", "face", "tilt", "‖a‖ − g", "corrected"].map(str::to_owned));
    let accepted = || findings.rests.values().enumerate().filter(|(_, rest)| rest.accepted);
    for (i, rest) in accepted().take(LISTED) {
        let mean = rest.means.iter().find(|mean| mean.sensor == "accelerometer").and_then(|mean| mean.mean.as_ref());
        let mean = mean.map(|mean| nalgebra::Vector3::new(mean.x, mean.y, mean.z));
        let signed =
            |value: Option<f64>, decimals: usize| value.map(|v| format!("{v:+.decimals$}")).unwrap_or_default();
        table.row([
            format!("{}", i + 1),
            format!("{:.1} s", report::length(rest)),
            printable(&rest.face).into_owned(),
            rest.tilt_deg.map(|tilt| format!("{tilt:.1}°")).unwrap_or_default(),
            signed(mean.map(|mean| mean.norm() - gravity), 3),
            signed(mean.zip(known).map(|(mean, known)| known.correct(&mean).norm() - gravity), 4),
        ]);
    }
    match accepted().count() {
        0 => Vec::new(),
        count => {
            let more = (count > LISTED).then(|| format!("  … and {} more", count - LISTED));
            table.lines("  ", look.columns).into_iter().chain(more).collect()
        }
    }
}
