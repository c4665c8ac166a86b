//! Options that several commands share.

#[cfg(feature = "live")]
use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use stillpoint::report::Axes;

#[cfg(feature = "live")]
use super::values::address;
use super::values::one_of;

#[derive(Clone, Debug, Args)]
pub struct Configuration {
    /// Configuration file (TOML)
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// One setting over the file, for example still.min_fit_s=2; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

#[derive(Clone, Debug, Args)]
pub struct Against {
    /// An earlier calibration in any format of export: say how far the sensor has moved since. What tail and watch show
    /// live is corrected by it until there is a new one
    #[arg(long, value_name = "FILE")]
    pub against: Option<PathBuf>,
    #[command(flatten)]
    pub pointing: Pointing,
}

#[derive(Clone, Copy, Debug, Args)]
pub struct Pointing {
    /// Which way the axes of the recording point, for parameters of an autopilot, which has its own
    #[arg(long, value_parser = one_of(Axes::ALL.iter().copied()))]
    pub axes: Option<Axes>,
}

#[cfg(feature = "live")]
#[derive(Debug, Args)]
pub struct Viewing {
    /// Show what grows to Foxglove and Lichtblick as it comes; without an address, on this machine alone
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8765", value_parser = address)]
    pub live: Option<SocketAddr>,
    /// Also serve viewers on pages of this origin (https://viewer.example), or by this host name (robot.example)
    #[arg(long, value_name = "NAME", requires = "live")]
    pub live_allow: Vec<String>,
}
