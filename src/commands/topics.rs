//! `stillpoint topics`: what could be calibrated in a recording, and why not the rest.

use console::style;
use serde_json::{Value, json};
use stillpoint::Error;
use stillpoint::imu::Verdict;
use stillpoint::run::{self, Channels, Recording, Stop, Use};

use super::progress::Progress;
use super::table::Table;
use super::{Code, configuration, print, print_json};
use crate::cli;

pub fn run(args: &cli::Topics, json: bool, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let recording = Recording::open_original(&args.input)?;
    let channels = {
        let progress = Progress::new(&recording, stop);
        run::channels(&recording, &config, &|done| progress.watch(done))?
    };
    match json {
        true => print_json(&machine(&channels))?,
        false => print(&people(&channels))?,
    }
    Ok(Code::Done)
}

fn machine(channels: &Channels) -> Value {
    let channel = |used: &Use| {
        let suggestion = match &used.verdict {
            Verdict::Other { suggestion, .. } => suggestion.as_deref(),
            _ => None,
        };
        json!({
            "topic": used.channel.topic,
            "type": used.schema,
            "encoding": used.channel.message_encoding,
            "messages": used.messages,
            "hz": channels.rate(used),
            "used": matches!(used.verdict, Verdict::Used(_)),
            "verdict": used.verdict.to_string(),
            "configuration": suggestion,
        })
    };
    json!({"topics": channels.channels.iter().map(channel).collect::<Value>(), "notes": channels.notes})
}

fn people(channels: &Channels) -> String {
    let mut table = Table::default();
    table.row(["topic", "messages", "rate", "encoding", "type"].map(str::to_owned));
    for used in &channels.channels {
        let verdict = match used.verdict {
            Verdict::Used(_) => style(used.verdict.to_string()).green(),
            Verdict::Skipped(_) => style(used.verdict.to_string()).yellow(),
            _ => style(used.verdict.to_string()).dim(),
        };
        let rate = channels.rate(used).map_or_else(|| "-".to_owned(), |hz| format!("{hz:.1} Hz"));
        let encoding = used.channel.message_encoding.clone();
        table.row([used.channel.topic.clone(), used.messages.to_string(), rate, encoding, used.schema.clone()]);
        table.heading(format!("    {verdict}"));
    }
    let mut lines = table.lines("");
    for used in &channels.channels {
        if let Verdict::Other { suggestion: Some(suggestion), .. } = &used.verdict {
            lines.push(String::new());
            lines.push(format!(
                "# To calibrate {}, put these lines into a file and pass it with -c:",
                used.channel.topic
            ));
            lines.extend(suggestion.lines().map(str::to_owned));
        }
    }
    lines.extend(channels.notes.iter().map(|note| format!("{note}")));
    lines.push(String::new());
    lines.join("\n")
}
