//! `stillpoint watch`: serves a directory until it is stopped.

use std::path::Path;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use serde_json::json;
use stillpoint::Error;
use stillpoint::config::Config;
use stillpoint::run::{self, Following, Metrics, Notice, Options, Stop, Verdict, Watching, WatchingPrefix};
use tokio::signal::unix::{SignalKind, signal};
use tracing::{debug, error, info, warn};

use super::code::Code;
use super::configuration::configuration;
use super::printing::{self, print_json};
use crate::cli;

/// Interval between two looks through a directory, and between two listings of a prefix, each of which is paid for.
const INTERVALS: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(60)];

pub fn run(args: &cli::Watch, json: bool, stop: &Stop) -> Result<Code, Error> {
    if run::is_url(&args.folder) {
        return run_prefix(args, json, stop);
    }
    if args.folder.is_file() {
        let why = "is a file; watch takes the folder that recordings appear in, tail or annotate take one recording";
        return Err(Error::input(&args.folder, why));
    }
    std::fs::read_dir(&args.folder).map_err(Error::io("read", &args.folder))?;
    let read = configuration(&args.configuration)?;
    #[cfg(feature = "live")]
    let live = super::live::live(&args.viewing, &read)?;
    let config = Arc::new(RwLock::new(read));
    reload_on_hangup(args.configuration.clone(), config.clone())?;
    let metrics = Arc::new(Metrics::default());
    if let Some(address) = args.metrics {
        info!("metrics at http://{}/metrics", run::serve(address, metrics.clone())?);
    }
    let show = || -> Box<dyn FnMut(&Notice<'_>)> {
        #[cfg(feature = "live")]
        if let Some(mut session) = live.as_ref().map(run::Live::session) {
            return Box::new(move |notice| session.show(notice));
        }
        Box::new(|_| {})
    };
    let following = Following {
        poll: args.poll,
        idle: args.idle_timeout,
        patience: None,
        keep_sidecar: args.keep_sidecar,
        options: Options { sync: args.sync, ..Options::default() },
    };
    let watching = Watching {
        folder: args.folder.clone(),
        out: args.out_dir.clone(),
        interval: args.interval.unwrap_or(INTERVALS[0]),
        growing: args.growing,
        finished: jobs(args),
        following,
        time_limit: args.time_limit,
    };
    let current = || config.read().unwrap_or_else(PoisonError::into_inner).clone();
    info!("watching {}", args.folder.display());
    run::watch(&watching, &current, stop, &metrics, &show, &|path, verdict| say(path, &verdict, json))?;
    info!("stopped; what was being followed goes on with the next watch");
    // A stop request is the normal end of a service.
    stop.answered();
    Ok(Code::Done)
}

fn jobs(args: &cli::Watch) -> usize {
    args.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

/// Serves a prefix of an object store.
fn run_prefix(args: &cli::Watch, json: bool, stop: &Stop) -> Result<Code, Error> {
    if let Some(out) = args.out_dir.as_ref().filter(|out| !run::is_url(out)) {
        let why = "the sidecars of a prefix are put into a store; name a prefix, or leave --out-dir away";
        return Err(Error::Usage(format!("{}: {why}", out.display())));
    }
    let config = Arc::new(RwLock::new(configuration(&args.configuration)?));
    reload_on_hangup(args.configuration.clone(), config.clone())?;
    let metrics = Arc::new(Metrics::default());
    if let Some(address) = args.metrics {
        info!("metrics at http://{}/metrics", run::serve(address, metrics.clone())?);
    }
    let watching = WatchingPrefix {
        prefix: args.folder.clone(),
        out: args.out_dir.clone(),
        interval: args.interval.unwrap_or(INTERVALS[1]),
        jobs: jobs(args),
        time_limit: args.time_limit,
    };
    let current = || config.read().unwrap_or_else(PoisonError::into_inner).clone();
    run::watch_prefix(&watching, &current, stop, &metrics, &|path, verdict| say(path, &verdict, json))?;
    info!("stopped; what is new by then is annotated by the next watch");
    stop.answered();
    Ok(Code::Done)
}

fn say(path: &Path, verdict: &Verdict<'_>, json: bool) {
    let name = path.display();
    match verdict {
        Verdict::Begun(false) => info!("{name}: is being recorded; following it"),
        Verdict::Begun(true) => debug!("{name}: is finished; annotating it"),
        Verdict::Annotated(tailed) => {
            let rests: usize = tailed.report.imus.iter().map(|imu| imu.rests.len()).sum();
            let calibrated = tailed.report.imus.iter().filter(|imu| imu.is_calibrated()).count();
            let imus = tailed.report.imus.len();
            info!(
                "{name}: annotated: {rests} rests, {calibrated} of {imus} IMUs calibrated: {}",
                tailed.output.display()
            );
            for (imu, why) in tailed.report.imus.iter().filter_map(|imu| Some((imu, imu.reason()?))) {
                info!("{name}: {} is not calibrated: {why}", imu.name);
            }
        }
        Verdict::Quarantined(reason) => {
            warn!("left alone until it or the configuration changes: {reason}");
        }
        Verdict::Again(error, wait) => warn!("{error}; again in {} s", wait.as_secs()),
    }
    if json {
        let event = match verdict {
            Verdict::Begun(_) => return,
            Verdict::Annotated(tailed) => {
                let mut event = super::annotate::result(path, &tailed.output, &tailed.report, None);
                event["event"] = "annotated".into();
                event
            }
            Verdict::Quarantined(reason) => {
                json!({"event": "quarantined", "input": printing::name(path), "reason": reason})
            }
            Verdict::Again(error, wait) => {
                json!({"event": "again", "input": printing::name(path), "error": error.to_string(), "seconds": wait.as_secs_f64()})
            }
        };
        // A service goes on even if standard output is gone.
        let _ = print_json(&event);
    }
}

/// Reloads the configuration on SIGHUP; recordings that begin later use it.
fn reload_on_hangup(typed: cli::Configuration, config: Arc<RwLock<Config>>) -> Result<(), Error> {
    let refused = |error| Error::io("listen for", "SIGHUP".as_ref())(error);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(refused)?;
    let mut hangups = {
        let _inside = runtime.enter();
        signal(SignalKind::hangup()).map_err(refused)?
    };
    let listen = move || {
        runtime.block_on(async {
            while hangups.recv().await.is_some() {
                match configuration(&typed) {
                    Ok(read) => {
                        *config.write().unwrap_or_else(PoisonError::into_inner) = read;
                        info!("the configuration was read again; recordings begun from now on use it");
                    }
                    Err(error) => error!("{error}; the configuration stays as it was"),
                }
            }
        });
    };
    std::thread::Builder::new().spawn(listen).map(drop).map_err(refused)
}
