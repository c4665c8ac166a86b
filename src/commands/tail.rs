//! `stillpoint tail`: follows a recording while it is recorded.

use std::time::Duration;

use stillpoint::Error;
use stillpoint::run::{self, Ending, Following, Notice, Options, Stop, Written};

use super::annotate::{code, result, say, say_unmet, uncalibrated};
use super::code::Code;
use super::configuration::configuration;
use super::files::reads;
use super::printing::print_json;
use super::view::View;
use super::{import, stream};
use crate::cli;

/// Time without a write after which a recorder counts as dead.
const IDLE: Duration = Duration::from_secs(60);

pub fn run(args: &cli::Tail, json: bool, stop: &Stop) -> Result<Code, Error> {
    if let Some(object) = [Some(&args.input), args.output.as_ref()].into_iter().flatten().find(|path| run::is_url(path))
    {
        let why = "an object does not grow, so there is nothing to follow; annotate takes it once it is complete";
        return Err(Error::Usage(format!("{}: {why}", object.display())));
    }
    let config = configuration(&args.configuration)?;
    let earlier = import::against(&args.against)?;
    // A missing path counts as a folder, unless it ends in `.mcap`.
    let file = args.input.extension().is_some_and(|ending| ending == "mcap");
    let folder = args.input.is_dir() || !args.input.exists() && !file;
    let output = args.output.clone().unwrap_or_else(|| run::default_output(&args.input, folder, None, false));
    let reads = reads([], &[&args.configuration.config, &args.against.against]);
    reads.refuse(&output)?;
    reads.refuse(&run::sidecar_of(&output))?;
    let following = Following {
        poll: args.poll,
        idle: args.idle_timeout.unwrap_or(IDLE),
        patience: args.idle_timeout,
        keep_sidecar: args.keep_sidecar,
        options: Options { force: args.force, allow_no_imu: args.allow_no_imu, sync: args.sync, ..Options::default() },
    };
    let mut view = View::new(args.input.display().to_string());
    #[cfg(feature = "live")]
    let live = super::live::live(&args.viewing, &config)?;
    #[cfg(feature = "live")]
    let mut session = live.as_ref().map(|live| match earlier.clone() {
        Some(earlier) => live.session().corrected_by(earlier, &config),
        None => live.session(),
    });
    let mut failed = None;
    let mut notify = |notice: Notice<'_>| {
        #[cfg(feature = "live")]
        session.iter_mut().for_each(|session| session.show(&notice));
        if json && failed.is_none() {
            failed = stream::event(&notice).map_or(Ok(()), |event| print_json(&event)).err();
        }
        if !json {
            view.show(&notice);
        }
    };
    let tailed = run::tail(&args.input, &output, &config, &following, stop, &mut notify);
    if matches!(tailed, Err(Error::Stopped | Error::Paused)) {
        view.leave();
    }
    drop(view);
    let tailed = tailed?;
    failed.map_or(Ok(()), Err)?;
    if json {
        let mut result = result(&args.input, &tailed.output, &tailed.report, earlier.as_deref());
        result["event"] = "result".into();
        print_json(&result)?;
    }
    say(std::slice::from_ref(&tailed.output), &tailed.report, tailed.written, earlier.as_deref());
    let code = code(&tailed.report, &config, args.require_calibration, args.accept_damage);
    if tailed.written == Written::Now {
        say_unmet(code, &args.input, &uncalibrated(&tailed.report, &config));
    }
    Ok(match (tailed.written, code) {
        (Written::Before, _) => Code::Done,
        // A folder without its last file. Of a single file the result says whether anything is missing, as for annotate.
        (Written::Now, Code::Done) if tailed.ending == Ending::Idle && args.input.is_dir() && !args.accept_damage => {
            Code::Damaged
        }
        (Written::Now, code) => code,
    })
}
