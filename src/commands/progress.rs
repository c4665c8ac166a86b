//! Progress bar on a terminal, and the check for stop requests everywhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use stillpoint::run::{Input, Stop};
use stillpoint::{Error, printable};

/// Progress of reading a recording, with the check for stop requests.
pub struct Progress<'a> {
    bar: ProgressBar,
    stop: &'a Stop,
}

impl<'a> Progress<'a> {
    /// A bar for a recording; hidden if standard error is not a terminal or should be quiet.
    pub fn new(recording: &Input, stop: &'a Stop) -> Self {
        let target = match tracing::enabled!(tracing::Level::INFO) {
            true => ProgressDrawTarget::stderr(),
            false => ProgressDrawTarget::hidden(),
        };
        let name = recording.path().file_name().unwrap_or_default().to_string_lossy();
        let name = printable(&name).into_owned();
        let style = ProgressStyle::with_template("{msg}  {wide_bar}  {bytes} of {total_bytes}, {eta} left");
        let bar = ProgressBar::with_draw_target(Some(recording.length()), target)
            .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
            .with_message(name);
        Self { bar, stop }
    }

    /// Updates the bar with the number of bytes that are done.
    ///
    /// # Errors
    ///
    /// Once a signal requested to stop.
    pub fn watch(&self, done: u64) -> Result<(), Error> {
        self.bar.set_position(done);
        self.stop.check()
    }
}

impl Drop for Progress<'_> {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
