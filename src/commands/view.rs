//! Live view of a followed recording on a terminal: each IMU's state, faces, next step and calibration, redrawn in
//! place. If standard error is not a terminal, one plain line per notable event.

use std::io::Write as _;
use std::time::{Duration, Instant};

use console::{Term, measure_text_width, style, truncate_str};
use indicatif::HumanBytes;
use stillpoint::engine::Message;
use stillpoint::messages::foxglove::{Log, log::Level};
use stillpoint::printable;
use stillpoint::run::{Ending, Notice, Progress};
use tracing::{info, warn};

use super::summary;
use super::text::Look;

/// Interval between two drawings; people read no faster.
const FRAME: Duration = Duration::from_millis(150);

/// Number of warnings about a recording as a whole that are said one by one. Further ones are only counted.
const SAID: u64 = 100;

/// View of a followed recording.
pub struct View {
    /// `None` without a terminal to draw on.
    term: Option<Term>,
    name: String,
    /// Number of lines drawn on the screen.
    drawn: usize,
    next: Instant,
    /// Lines of the next drawing.
    lines: Vec<String>,
    waiting: bool,
    /// Number of warnings about the recording as a whole.
    warnings: u64,
}

impl View {
    /// A view of the recording of that name; at quiet log levels it draws nothing.
    pub fn new(name: String) -> Self {
        let term = Some(Term::stderr()).filter(|term| term.is_term() && tracing::enabled!(tracing::Level::INFO));
        let name = printable(&name).into_owned();
        Self { term, name, drawn: 0, next: Instant::now(), lines: Vec::new(), waiting: false, warnings: 0 }
    }

    /// Shows a notice.
    pub fn show(&mut self, notice: &Notice<'_>) {
        match notice {
            Notice::Awaited => {
                self.waiting = true;
                self.say(|name| info!("{name}: waiting for the recording to begin"));
            }
            Notice::Opened(0) if self.waiting => self.say(|name| info!("{name}: recording")),
            Notice::Opened(0) => {}
            Notice::Opened(offset) => self.say(|name| info!("{name}: going on at byte {offset}, where it was stopped")),
            Notice::Split(file) => self.say(|name| info!("{name}: goes on in {file}")),
            Notice::Trouble(what) => self.say(|name| warn!("{name}: {what}")),
            Notice::Annotation { imu, event, .. } if self.term.is_none() => {
                let is_warning = |log: &Log| imu.is_empty() && log.level() != Level::Info;
                self.warnings += u64::from(matches!(&event.message, Message::Log(log) if is_warning(log)));
                match &event.message {
                    Message::Log(log) if is_warning(log) && self.warnings > SAID => {}
                    message => line(message),
                }
            }
            Notice::Imu { findings, status } if self.is_due() => {
                let look = Look::of(&Term::stderr());
                self.lines.extend(summary::live(findings, status, look));
            }
            Notice::Read(progress) if self.is_due() => self.draw(progress),
            Notice::Ended(ending) => {
                self.clear();
                let name = &self.name;
                let further = std::mem::take(&mut self.warnings).saturating_sub(SAID);
                if further > 0 {
                    warn!("{name}: {further} further warnings, which are in the log of its annotations");
                }
                match ending {
                    Ending::Finished => info!("{name}: the recorder has finished; writing the annotated recording"),
                    Ending::Idle => warn!("{name}: nothing more is recorded, and the recorder has not finished it"),
                    Ending::Deleted => warn!("{name}: was deleted; what had been recorded is annotated"),
                    Ending::Replaced => {
                        warn!("{name}: was replaced by another file; what had been recorded before is annotated");
                    }
                    Ending::Truncated => {
                        warn!("{name}: was cut off or written anew; what is there now is followed");
                    }
                }
            }
            _ => {}
        }
    }

    /// Removes the drawing from the screen.
    pub fn clear(&mut self) {
        if let Some(term) = self.term.as_ref().filter(|_| self.drawn > 0) {
            // Nobody can be informed if the terminal is gone.
            let _ = term.clear_last_lines(std::mem::take(&mut self.drawn));
        }
    }

    /// Leaves the drawing where it is: the last state that will be known.
    pub fn leave(&mut self) {
        self.drawn = 0;
    }

    fn is_due(&self) -> bool {
        self.term.is_some() && Instant::now() >= self.next
    }

    /// Logs a lasting line above the drawing.
    fn say(&mut self, say: impl FnOnce(&str)) {
        self.clear();
        say(&self.name);
    }

    fn draw(&mut self, progress: &Progress) {
        let behind = progress.length.saturating_sub(progress.read);
        let mut lines = std::mem::take(&mut self.lines);
        let read = HumanBytes(progress.read);
        let footer = match (lines.is_empty(), behind) {
            (true, _) => format!("{}  {read} read, no IMU yet", self.name),
            (_, 0) => format!("{}  {read} read", self.name),
            (..) => format!("{}  {read} read, {} not whole yet", self.name, HumanBytes(behind)),
        };
        lines.push(style(footer).for_stderr().dim().to_string());
        let Some(term) = self.term.clone() else { return };
        let (rows, columns) = term.size();
        lines.truncate(usize::from(rows).saturating_sub(1));
        let mut frame = String::new();
        if self.drawn > 0 {
            frame.push_str(&format!("\x1b[{}A", self.drawn));
        }
        for line in &lines {
            let line = truncate_str(line, columns.into(), "…");
            debug_assert!(measure_text_width(&line) <= columns.into());
            frame.push_str(&format!("\r{line}\x1b[K\n"));
        }
        frame.push_str("\x1b[J");
        let _ = (&term).write_all(frame.as_bytes());
        self.drawn = lines.len();
        self.next = Instant::now() + FRAME;
    }
}

impl Drop for View {
    fn drop(&mut self) {
        self.clear();
    }
}

/// Logs a notable message without a terminal: refusals and calibrations from the log, the next step from the coverage.
fn line(message: &Message) {
    match message {
        Message::Log(log) if log.level() == Level::Info => info!("{}: {}", log.name, log.message),
        Message::Log(log) => warn!("{}: {}", log.name, log.message),
        Message::Segment(rest) if rest.accepted => {
            let seconds = summary::seconds(rest);
            info!("rest of {seconds:.1} s on {} accepted", rest.face);
        }
        Message::Coverage(coverage) => info!("next: {}", coverage.next_step),
        Message::Segment(_)
        | Message::Turn(_)
        | Message::Noise(_)
        | Message::Stillness(_)
        | Message::Calibration(_) => {}
    }
}
