//! A recording while it is followed, on a terminal: each IMU's state, faces, next step and calibration, drawn over
//! itself. Where standard error is no terminal, one plain line for each thing worth knowing.

use std::io::Write as _;
use std::time::{Duration, Instant};

use console::{Term, measure_text_width, style, truncate_str};
use indicatif::HumanBytes;
use stillpoint::engine::Message;
use stillpoint::messages::foxglove::log::Level;
use stillpoint::printable;
use stillpoint::run::{Ending, News, Progress};
use tracing::{info, warn};

use super::summary;
use super::text::Look;

/// Between two drawings; people read no faster.
const FRAME: Duration = Duration::from_millis(150);

/// Shows what is told of a recording.
pub struct View {
    /// `None` where there is no terminal to draw on.
    term: Option<Term>,
    name: String,
    /// Lines on the screen that are ours.
    drawn: usize,
    next: Instant,
    /// What the next drawing shows.
    lines: Vec<String>,
    waiting: bool,
}

impl View {
    /// A view of the recording of that name; `quiet` shows nothing but troubles.
    pub fn new(name: String) -> Self {
        let term = Some(Term::stderr()).filter(|term| term.is_term() && tracing::enabled!(tracing::Level::INFO));
        let name = printable(&name).into_owned();
        Self { term, name, drawn: 0, next: Instant::now(), lines: Vec::new(), waiting: false }
    }

    /// Shows what happened.
    pub fn show(&mut self, news: &News<'_>) {
        match news {
            News::Awaited => {
                self.waiting = true;
                self.say(|name| info!("{name}: waiting for the recording to begin"));
            }
            News::Opened(0) if self.waiting => self.say(|name| info!("{name}: recording")),
            News::Opened(0) => {}
            News::Opened(offset) => self.say(|name| info!("{name}: going on at byte {offset}, where it was stopped")),
            News::Split(file) => self.say(|name| info!("{name}: goes on in {file}")),
            News::Trouble(what) => self.say(|name| warn!("{name}: {what}")),
            News::Annotation { event, .. } if self.term.is_none() => line(&event.message),
            News::Imu { findings, status } if self.is_due() => {
                let look = Look::of(&Term::stderr());
                self.lines.extend(summary::live(findings, status, look));
            }
            News::Read(progress) if self.is_due() => self.draw(progress),
            News::Ended(ending) => {
                self.clear();
                let name = &self.name;
                match ending {
                    Ending::Finished => info!("{name}: the recorder has finished; writing the annotated recording"),
                    Ending::Idle => warn!("{name}: nothing more is recorded, and the recorder has not finished it"),
                    Ending::Deleted => warn!("{name}: was deleted; what had been recorded is annotated"),
                    Ending::Replaced => {
                        warn!("{name}: was replaced by another file; what had been recorded before is annotated");
                    }
                    Ending::Truncated => warn!("{name}: was cut off or written anew; its annotations are kept"),
                }
            }
            _ => {}
        }
    }

    /// Takes the drawing off the screen.
    pub fn clear(&mut self) {
        if let Some(term) = self.term.as_ref().filter(|_| self.drawn > 0) {
            // Nobody is left to tell if the terminal is gone.
            let _ = term.clear_last_lines(std::mem::take(&mut self.drawn));
        }
    }

    /// Leaves the drawing where it is: it is the last that will be known.
    pub fn leave(&mut self) {
        self.drawn = 0;
    }

    fn is_due(&self) -> bool {
        self.term.is_some() && Instant::now() >= self.next
    }

    /// Says something that stays, above the drawing.
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

/// What is worth a line where nothing can be drawn: the log says refusals and calibrations, the coverage what to do.
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
