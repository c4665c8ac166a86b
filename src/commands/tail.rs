//! `stillpoint tail`: a recording, while it is recorded.

use std::time::Duration;

use stillpoint::Error;
use stillpoint::run::{self, Following, News, Options, Stop, Written};

use super::annotate::{code, default_output, result, say};
use super::view::View;
use super::{Code, configuration, print_json, stream};
use crate::cli;

/// A recorder that writes nothing for so long is taken to be dead.
const IDLE: Duration = Duration::from_secs(60);

pub fn run(args: &cli::Tail, json: bool, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.input, false, None, false));
    let following = Following {
        poll: args.poll,
        idle: args.idle_timeout.unwrap_or(IDLE),
        patience: args.idle_timeout,
        keep_sidecar: args.keep_sidecar,
        options: Options { force: args.force, allow_no_imu: args.allow_no_imu, sync: args.sync, ..Options::default() },
    };
    let mut view = View::new(args.input.display().to_string());
    let mut failed = None;
    let mut tell = |news: News<'_>| {
        if json && failed.is_none() {
            failed = stream::event(&news).map_or(Ok(()), |event| print_json(&event)).err();
        }
        if !json {
            view.show(&news);
        }
    };
    let tailed = run::tail(&args.input, &output, &config, &following, stop, &mut tell)?;
    drop(view);
    failed.map_or(Ok(()), Err)?;
    if json {
        let mut result = result(&args.input, &tailed.output, &tailed.report, None);
        result["event"] = "result".into();
        print_json(&result)?;
    }
    say(std::slice::from_ref(&tailed.output), &tailed.report, tailed.written, None);
    Ok(match tailed.written {
        Written::Before => Code::Done,
        Written::Now => code(&tailed.report, args.require_calibration, args.accept_damage),
    })
}
