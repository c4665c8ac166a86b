//! What the user typed. What it means is left to the [`commands`](crate::commands).

use std::path::PathBuf;

use clap::{Parser, Subcommand};

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
  1  no recording, no permission, output exists, disk full, no usable IMU topic
  2  command line or configuration
  3  done, but the input was damaged or never finished (0 with --accept-damage)
  4  done, but --require-calibration was not met";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show or check the configuration
    #[command(subcommand)]
    Config(Config),
}

#[derive(Debug, Subcommand)]
pub enum Config {
    /// Print the default configuration, every key with its unit and meaning
    Show,
    /// Check a configuration file
    Check {
        /// The file
        file: PathBuf,
    },
}
