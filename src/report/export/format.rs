//! One format of another program: its name, and what writes it.

use super::error::ExportError;
use super::options::{Options, RandomWalk};
use crate::report::Findings;

/// A format: name, help text and writer. Each has a file of its own.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Name by which it is chosen.
    pub name: &'static str,
    /// Help text.
    pub help: &'static str,
    /// Random-walk options that apply to it.
    pub(super) random_walks: RandomWalks,
    pub(super) write: fn(&[Findings], &Options) -> Result<Exported, ExportError>,
}

impl Format {
    pub(super) fn takes(self, walk: RandomWalk) -> bool {
        match walk {
            RandomWalk::Bound => self.random_walks != RandomWalks::None,
            RandomWalk::Given(_) => self.random_walks == RandomWalks::Any,
        }
    }
}

/// Random-walk options that apply to a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RandomWalks {
    /// The format has no random walk, or only one that the rests show.
    None,
    /// The upper bound.
    Bound,
    /// The upper bound, and given numbers.
    Any,
}

/// A written calibration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The file.
    pub text: String,
    /// Warnings for the user, one line each.
    pub warnings: Vec<String>,
}

impl Exported {
    /// A file without warnings.
    pub(super) fn plain(text: String) -> Self {
        Self { text, warnings: Vec::new() }
    }
}
