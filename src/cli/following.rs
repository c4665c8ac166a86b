//! Options of the commands that follow what grows.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

#[cfg(feature = "live")]
use super::shared::Viewing;
use super::shared::{Against, Configuration};
use super::values::{address, at_least_one, duration, on_disk};

#[derive(Debug, Args)]
pub struct Tail {
    /// The recording, a file or a rosbag2 folder; it may not be there yet
    #[arg(value_parser = on_disk())]
    pub input: PathBuf,
    /// Where to write [default: INPUT's name with .annotated.mcap]. Until then, its name with .stillpoint.mcap grows
    #[arg(short, long, value_name = "OUT", value_parser = on_disk())]
    pub output: Option<PathBuf>,
    /// A recording that does not grow for so long was given up by its recorder [default: 60s]. When given, one that
    /// does not begin for so long is an error
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub idle_timeout: Option<Duration>,
    /// How often to look whether it has grown
    #[arg(long, value_name = "DURATION", value_parser = duration, default_value = "20ms")]
    pub poll: Duration,
    #[cfg(feature = "live")]
    #[command(flatten)]
    pub viewing: Viewing,
    /// Keep the annotations as a file of their own beside the annotated recording
    #[arg(long)]
    pub keep_sidecar: bool,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
    /// Also write a result when no topic is an IMU
    #[arg(long)]
    pub allow_no_imu: bool,
    /// Exit with 4 unless every IMU got an accelerometer calibration
    #[arg(long)]
    pub require_calibration: bool,
    /// Exit with 0 when the recording was damaged or never finished
    #[arg(long)]
    pub accept_damage: bool,
    /// Wait until the output is on the device
    #[arg(long)]
    pub sync: bool,
    #[command(flatten)]
    pub against: Against,
    #[command(flatten)]
    pub configuration: Configuration,
}

#[derive(Debug, Args)]
pub struct Watch {
    /// Where recordings appear, files and rosbag2 folders, in its folders too; or a prefix of an object store
    /// (s3://bucket/prefix), where each recording that no longer changes gets a sidecar
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Folder to write into, under the same names and folders [default: beside the recordings]
    #[arg(long, value_name = "DIR")]
    pub out_dir: Option<PathBuf>,
    /// Serve /healthz, /readyz and Prometheus /metrics here; without an address, on this machine alone
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:9464", value_parser = address)]
    pub metrics: Option<SocketAddr>,
    #[cfg(feature = "live")]
    #[command(flatten)]
    pub viewing: Viewing,
    /// How often to look through the directory, or to list the prefix [default: 1s; 60s for a prefix, since listings are
    /// paid for]
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub interval: Option<Duration>,
    /// A recording that does not grow for so long was given up by its recorder
    #[arg(long, value_name = "DURATION", value_parser = duration, default_value = "60s")]
    pub idle_timeout: Duration,
    /// How often to look whether a recording has grown
    #[arg(long, value_name = "DURATION", value_parser = duration, default_value = "20ms")]
    pub poll: Duration,
    /// Growing recordings that are followed at a time
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = at_least_one)]
    pub growing: usize,
    /// Finished recordings that are worked on at a time [default: one a core]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    pub jobs: Option<usize>,
    /// A finished recording that takes longer is left alone [default: 10min, and a second more for each MiB]
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub time_limit: Option<Duration>,
    /// Keep the annotations as files of their own beside the annotated recordings
    #[arg(long)]
    pub keep_sidecar: bool,
    /// Wait until each output is on the device
    #[arg(long)]
    pub sync: bool,
    #[command(flatten)]
    pub configuration: Configuration,
}
