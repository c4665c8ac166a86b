//! Command line as the user typed it. [`commands`](crate::commands) carry it out.

mod following;
mod shared;
mod values;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use stillpoint::report::{Format, RandomWalk};

pub use following::{Tail, Watch};
#[cfg(feature = "live")]
pub use shared::Viewing;
pub use shared::{Against, Configuration, Pointing};
use values::{on_disk, one_of};

/// Learns the calibration of an IMU from the moments when it rests in an MCAP recording, and writes it back.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, arg_required_else_help = true, max_term_width = 100, after_help = EXIT_CODES)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
    /// Print one machine-readable result on standard output; a simulation's is its truth
    #[arg(long, global = true)]
    pub json: bool,
    /// Say more
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
}

const EXIT_CODES: &str = "Exit codes:
  0  done; also when no calibration could be published
  1  no recording, no permission, output exists, no usable IMU topic
  2  command line or configuration
  3  done, but the input was damaged or never finished (0 with --accept-damage)
  4  done, but --require-calibration was not met
  5  passing trouble, such as a full disk or a server out of reach: the same command may succeed later
  6  of a list (--inputs-from, --shard, --manifest, a prefix) all that can be done is done; what is left no retry mends";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Find the rests, learn the calibration, and write both into a copy of the recording
    Annotate(Annotate),
    /// Annotate a recording while it is recorded
    Tail(Tail),
    /// Annotate every recording that appears in a directory, as a service
    Watch(Watch),
    /// What could be calibrated in a recording, and why not the rest
    Topics(Topics),
    /// What was learned from a recording, on the terminal or as a page to look at
    Report(Report),
    /// The calibration of a recording, for other programs
    Export(Export),
    /// One calibration per sensor out of many recordings, though no single one determines it; and how it changed over time
    Merge(Merge),
    /// A calibration that another program wrote, as our own: to compare with, or to correct by
    Import(Import),
    /// Take the annotations out again: the original, byte for byte
    Strip(Strip),
    /// Take back what a killed annotate --in-place left half done
    Repair(Repair),
    /// Make a recording with known truth
    Simulate(Simulate),
    /// Show or check the configuration
    #[command(subcommand)]
    Config(Config),
    /// Print the completions of a shell
    Completions(Completions),
    /// Write the manual pages
    Man(Man),
}

#[derive(Clone, Debug, Args)]
pub struct Annotate {
    /// The recordings: files, or rosbag2 folders, each of which is one; or objects (s3://, gs://, az://, https://), a prefix
    /// of which, with a slash at its end, stands for all recordings under it
    #[arg(required_unless_present = "inputs_from", value_name = "INPUT", value_parser = on_disk())]
    pub inputs: Vec<PathBuf>,
    /// A file that lists further recordings, one a line; - for standard input
    #[arg(long, value_name = "FILE")]
    pub inputs_from: Option<PathBuf>,
    /// Work on one part of the recordings: I of N, counted from 0; auto, or auto/N, takes I from JOB_COMPLETION_INDEX,
    /// AWS_BATCH_JOB_ARRAY_INDEX or SLURM_ARRAY_TASK_ID [default: with --inputs-from, auto where both numbers are there]
    #[arg(long, value_name = "I/N", conflicts_with_all = ["join", "output"])]
    pub shard: Option<String>,
    /// Write what became of each recording here, one line of JSON each
    #[arg(long, value_name = "FILE")]
    pub manifest: Option<PathBuf>,
    /// Where to write [default: INPUT's name with .annotated.mcap, or .stillpoint.mcap for a sidecar, as which results are
    /// put into stores]
    #[arg(short, long, value_name = "OUT", conflicts_with = "out_dir", value_parser = on_disk())]
    pub output: Option<PathBuf>,
    /// Folder, or prefix of a store, to write into, under the default names; a folder is made if it is not there. Folders below
    /// a prefix among the inputs are kept, and those that tell apart other inputs of one name
    #[arg(long, value_name = "DIR")]
    pub out_dir: Option<PathBuf>,
    /// Write the annotations into the recording itself; after a run that is killed meanwhile, the next, or repair, puts back what was there
    #[arg(long, conflicts_with_all = ["output", "out_dir", "sidecar", "force"])]
    pub in_place: bool,
    /// Write the annotations alone, into a file that viewers show beside the recording
    #[arg(long)]
    pub sidecar: bool,
    /// The inputs are the files of one recording: what is learned goes on from one to the next
    #[arg(long)]
    pub join: bool,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
    /// Also write a result when no topic is an IMU
    #[arg(long)]
    pub allow_no_imu: bool,
    /// Exit with 4 unless every IMU got an accelerometer calibration
    #[arg(long)]
    pub require_calibration: bool,
    /// Exit with 0 when the input was damaged
    #[arg(long)]
    pub accept_damage: bool,
    /// Also read, and check, the chunks in which no IMU has messages
    #[arg(long)]
    pub verify: bool,
    /// Wait until the output is on the device
    #[arg(long)]
    pub sync: bool,
    #[command(flatten)]
    pub against: Against,
    #[command(flatten)]
    pub configuration: Configuration,
}

#[derive(Debug, Args)]
pub struct Topics {
    /// The recording
    #[arg(value_parser = on_disk())]
    pub input: PathBuf,
    /// Exit with 0 when the recording was damaged or never finished
    #[arg(long)]
    pub accept_damage: bool,
    #[command(flatten)]
    pub configuration: Configuration,
}

#[derive(Debug, Args)]
pub struct Report {
    /// An annotated recording or sidecar, whose annotations are read; or a raw recording, which is calibrated first
    #[arg(value_parser = on_disk())]
    pub input: PathBuf,
    /// Exit with 0 when the recording was damaged or never finished
    #[arg(long)]
    pub accept_damage: bool,
    /// Write a page: one HTML file that needs nothing else [default: a summary on the terminal]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub against: Against,
    #[command(flatten)]
    pub configuration: Configuration,
}

#[derive(Debug, Args)]
pub struct Completions {
    /// Which shell
    pub shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub struct Man {
    /// Folder to write into
    pub dir: PathBuf,
    /// Replace pages that exist
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct Export {
    /// An annotated recording or sidecar, whose annotations are read; or a raw recording, which is calibrated first
    #[arg(value_parser = on_disk())]
    pub input: PathBuf,
    /// Exit with 0 when the recording was damaged or never finished
    #[arg(long)]
    pub accept_damage: bool,
    /// What to write
    #[arg(long, value_parser = one_of(Format::ALL.iter().map(|format| (*format, format.name, format.help))))]
    pub format: Format,
    #[command(flatten)]
    pub convention: Convention,
    /// Where to write [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub configuration: Configuration,
}

/// What a format of others has to be told.
#[derive(Debug, Args)]
pub struct Convention {
    /// Which IMU, where a format holds one and there are several; of merge, the name or key of a sensor
    #[arg(long, value_name = "NAME")]
    pub imu: Option<String>,
    /// A secondary accelerometer instead of the primary one (imu-calib, px4, ardupilot)
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// The recording holds raw readings, which PX4 and ArduPilot apply their parameters to
    #[arg(long)]
    pub raw: bool,
    /// The parameters that the autopilot had corrected the recorded readings with, to be composed with
    #[arg(long, value_name = "FILE", conflicts_with = "raw")]
    pub in_force: Option<PathBuf>,
    #[command(flatten)]
    pub pointing: Pointing,
    /// Which of the autopilot's sensors
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub slot: u8,
    /// What to write for random walks that the rests do not show: "bound", the most that they can be; or, for kalibr-input,
    /// yours in m/s³/√Hz and rad/s²/√Hz
    #[arg(long, value_name = "bound|ACCEL,GYRO")]
    pub random_walk: Option<RandomWalk>,
}

#[derive(Debug, Args)]
pub struct Merge {
    /// Recordings of one sensor or several: annotated ones and sidecars, whose rests are read; or raw ones, which are looked
    /// through first. A prefix of a store (s3://bucket/prefix/) stands for the results under it
    #[arg(value_name = "INPUT", required_unless_present = "inputs_from", value_parser = on_disk())]
    pub inputs: Vec<PathBuf>,
    /// A file that lists further recordings, one a line; - for standard input
    #[arg(long, value_name = "FILE")]
    pub inputs_from: Option<PathBuf>,
    /// What tells sensors apart: topic, name, frame-id, folder (that the recording is in), serial, or metadata:KEY (an entry of
    /// the metadata of the IMU's channel, of which serial is one); several, separated by commas, together
    #[arg(long, value_name = "KEY", default_value = "topic")]
    pub by: String,
    /// What to write [default: a report on the terminal]
    #[arg(long, value_parser = one_of(Format::ALL.iter().map(|format| (*format, format.name, format.help))))]
    pub format: Option<Format>,
    #[command(flatten)]
    pub convention: Convention,
    /// Where to write; - is standard output, as without
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// A page with each sensor's parameters over time, beside what is written otherwise
    #[arg(long, value_name = "HTML")]
    pub report: Option<PathBuf>,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
    /// Exit with 4 unless every sensor got an accelerometer calibration
    #[arg(long)]
    pub require_calibration: bool,
    /// Exit with 0 when an input was damaged
    #[arg(long)]
    pub accept_damage: bool,
    #[command(flatten)]
    pub configuration: Configuration,
}

#[derive(Debug, Args)]
pub struct Import {
    /// JSON or YAML of export, Kalibr's imu0: layout, imu_calib, or parameters of PX4 or ArduPilot
    pub calibration: PathBuf,
    /// Topic of the IMU that it is of, if the file does not say
    #[arg(long)]
    pub topic: Option<String>,
    #[command(flatten)]
    pub pointing: Pointing,
    /// Where to write; - is standard output, as without
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct Strip {
    /// The annotated recording
    #[arg(value_parser = on_disk())]
    pub input: PathBuf,
    /// Where to write the original
    #[arg(short, long, value_name = "OUT", value_parser = on_disk())]
    pub output: PathBuf,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
    /// Wait until the output is on the device
    #[arg(long)]
    pub sync: bool,
}

#[derive(Debug, Args)]
pub struct Repair {
    /// The recordings, each beside the backup that says how it was
    #[arg(required = true, value_name = "FILE", value_parser = on_disk())]
    pub inputs: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub struct Simulate {
    /// A built-in scenario (demo, six-faces, rate-table, thesis-sequence-1 or thesis-sequence-3), or a scenario file (TOML)
    #[arg(default_value = "demo")]
    pub scenario: String,
    /// Where to write the recording
    #[arg(short, long, value_name = "OUT", required_unless_present = "show", value_parser = on_disk())]
    pub output: Option<PathBuf>,
    /// Print the scenario instead, to be edited
    #[arg(long, conflicts_with = "output")]
    pub show: bool,
    /// One setting over the scenario, for example recording.seed=7; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct Layout {
    /// The recording, annotated or not yet
    #[arg(value_parser = on_disk())]
    pub input: PathBuf,
    /// Where to write; - is standard output, as without
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace an output that exists
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub configuration: Configuration,
}

#[derive(Debug, Subcommand)]
pub enum Config {
    /// Print the default configuration, every key with its unit and meaning
    Show,
    /// A layout for Foxglove and Lichtblick, for the topics of a recording
    Layout(Layout),
    /// Check a configuration file
    Check {
        /// The file
        file: PathBuf,
    },
}
