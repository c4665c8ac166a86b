//! `stillpoint topics`: topics of a recording that can be calibrated, and why others cannot.

use console::{Term, style};
use serde_json::{Value, json};
use stillpoint::imu::{ChannelRole, ImuConfig};
use stillpoint::run::{self, Access, Channels, Input, Stop, Use};
use stillpoint::{Error, printable, printable_json};

use super::code::{Code, damaged};
use super::configuration::configuration;
use super::printing::print;
use super::progress::Progress;
use super::table::Table;
use crate::cli;

pub fn run(args: &cli::Topics, json: bool, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let recording = Input::open_original(&args.input, Access::Read)?;
    recording.edits().for_each(|edit| tracing::warn!("{edit}"));
    let channels = {
        let progress = Progress::new(&recording, stop);
        run::channels(&recording, &config, &|done| progress.watch(done))?
    };
    match json {
        true => print_machine(&channels)?,
        false => print(&people(&channels))?,
    }
    if channels.damages > 0 {
        tracing::warn!("the recording is damaged: annotate it to see where");
    }
    Ok(damaged(channels.damages, args.accept_damage))
}

/// Prints the channels as one line of JSON, piece by piece, since there may be many.
fn print_machine(channels: &Channels) -> Result<(), Error> {
    let mut text = format!("{{\"notes\":{},\"topics\":[", json!(channels.notes));
    for (at, used) in channels.channels.iter().enumerate() {
        text.push_str(if at > 0 { "," } else { "" });
        text.push_str(&machine(channels, used).to_string());
        if text.len() > PIECE {
            print(&printable_json(&text))?;
            text.clear();
        }
    }
    text.push_str("]}");
    print(&format!("{}\n", printable_json(&text)))
}

fn machine(channels: &Channels, used: &Use) -> Value {
    json!({
        "topic": used.channel.topic,
        "type": used.schema,
        "encoding": used.channel.message_encoding,
        "messages": used.messages,
        "hz": channels.rate(used),
        "used": is_used(&used.verdict),
        "verdict": used.verdict.to_string(),
        "remarks": used.remarks,
        "configuration": used.configuration.as_ref().map(ImuConfig::lines),
    })
}

/// Whether something is read from a channel.
fn is_used(role: &ChannelRole) -> bool {
    let beside = matches!(role, ChannelRole::Temperature { .. } | ChannelRole::Heading { .. } | ChannelRole::Position);
    beside || matches!(role, ChannelRole::Used(_))
}

/// Length of a piece of JSON, in bytes (64 KiB).
const PIECE: usize = 64 << 10;
/// Topics that are shown whatever they are.
const SHOWN: usize = 50;
/// Topics that are shown if there is something to say of them: no one reads more.
const READ: usize = 2000;

/// Whether there is nothing to say of a topic but that it is no IMU.
fn is_dull(used: &Use) -> bool {
    let plain = matches!(&used.verdict, ChannelRole::Other { vectors, suggestion: None, .. } if vectors.is_empty());
    plain && used.remarks.is_empty() && used.configuration.is_none()
}

/// A text of the recording, on one line.
fn said(text: &str) -> String {
    printable(text).into_owned()
}

fn people(channels: &Channels) -> String {
    let mut table = Table::default();
    table.row(["topic", "messages", "rate", "encoding", "type"].map(str::to_owned));
    let (mut shown, mut further) = (0, 0);
    for (at, used) in channels.channels.iter().enumerate() {
        if at >= SHOWN && is_dull(used) || shown >= READ && !is_used(&used.verdict) {
            further += 1;
            continue;
        }
        shown += 1;
        let verdict = match &used.verdict {
            _ if is_used(&used.verdict) => style(said(&used.verdict.to_string())).green(),
            ChannelRole::Skipped(_) => style(said(&used.verdict.to_string())).yellow(),
            _ => style(said(&used.verdict.to_string())).dim(),
        };
        let rate = channels.rate(used).map_or_else(|| "-".to_owned(), |hz| format!("{hz:.1} Hz"));
        let [topic, encoding, schema] =
            [&used.channel.topic, &used.channel.message_encoding, &used.schema].map(|text| said(text));
        table.row([topic, used.messages.to_string(), rate, encoding, schema]);
        table.heading(format!("    {verdict}"));
        for remark in &used.remarks {
            table.heading(format!("    {}", style(said(remark)).yellow()));
        }
    }
    if further > 0 {
        table.heading(format!("and {further} more that are no IMUs; --json lists them all"));
    }
    let term = Term::stdout();
    // Piped output is cut and searched line by line.
    let columns = if term.is_term() { crate::console::columns(&term) } else { usize::MAX };
    let mut lines = table.lines("", columns);
    lines.extend(channels.notes.iter().map(|note| said(note)));
    if !term.is_term() {
        // What is put into a file is a configuration.
        lines.iter_mut().for_each(|line| *line = format!("# {line}").trim_end().to_owned());
    }
    for (topics, imu) in offered(channels) {
        lines.push(String::new());
        lines.push(format!(
            "# To calibrate {}, put these lines into a file and pass it with -c:",
            said(&topics.join(" and "))
        ));
        lines.extend(imu.lines().lines().map(str::to_owned));
    }
    lines.push(String::new());
    lines.join("\n")
}

/// The offered configurations, one table for each IMU, and the topics that it is offered for.
fn offered(channels: &Channels) -> Vec<(Vec<&str>, ImuConfig)> {
    let mut offered: Vec<(Vec<&str>, ImuConfig)> = Vec::new();
    for used in &channels.channels {
        let Some(imu) = &used.configuration else { continue };
        let topic = used.channel.topic.as_str();
        match offered.iter_mut().find(|(_, known)| known.topic == imu.topic && known.name == imu.name) {
            Some((topics, known)) => {
                topics.push(topic);
                known.accel = known.accel.take().or_else(|| imu.accel.clone());
                known.gyro = known.gyro.take().or_else(|| imu.gyro.clone());
                let new: Vec<_> = imu.secondary.iter().filter(|s| !known.secondary.contains(s)).cloned().collect();
                known.secondary.extend(new);
            }
            None => offered.push((vec![topic], imu.clone())),
        }
    }
    offered
}
