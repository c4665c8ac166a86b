//! Following a recording that is being recorded: annotations as they come, in a growing sidecar, and at the end the
//! annotated recording that the batch path makes of the same bytes.
//!
//! Everything is a function of the recording's bytes; when they come, and how often the tail is killed meanwhile, only
//! decides when the annotations are there.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::appending::{Appending, Said};
use super::batch::{self, Form, Kept, Options, Report};
use super::checkpoint::{Checkpoint, Found, Owner, StateOf};
use super::growing::{Growing, Look};
use super::in_place::Access;
use super::input::Input;
use super::learn::{Learned, Learner};
use super::news::{Ending, News, Progress, Tell};
use super::output::Written;
use super::recording::Recording;
use super::stop::Stop;
use crate::config::Config;
use crate::record::{Block, Damage, Event, Inventory, Piece, Scan, Sidecar, Topic};
use crate::{Error, annotate, engine};

/// Reads of less would cost more than the bytes (1 MiB).
const READ: usize = 1 << 20;
/// What is recorded under a name that is gone is waited for so long.
const UNNAMED: Duration = Duration::from_secs(2);
/// A recording that looks finished, but cannot be read to its end, is given so long to go on.
const CLOSED: Duration = Duration::from_secs(1);
/// Between two attempts at what is in the way.
const RETRY: Duration = Duration::from_millis(500);

/// How to follow.
#[derive(Clone, Debug)]
pub struct Following {
    /// Between two looks at the recording.
    pub poll: Duration,
    /// A recording that does not grow for so long was given up by its recorder.
    pub idle: Duration,
    /// How long to wait for the recording to begin; for ever if `None`.
    pub patience: Option<Duration>,
    /// Whether the sidecar stays when the annotated recording is there.
    pub keep_sidecar: bool,
    /// How to write the annotated recording.
    pub options: Options,
}

/// What a recording came to.
#[derive(Debug)]
pub struct Tailed {
    /// What was found in it.
    pub report: Report,
    /// Where it is: the annotated recording, or the sidecar of one whose bytes are lost.
    pub output: PathBuf,
    /// Whether that was there before.
    pub written: Written,
    /// Why nothing more was recorded.
    pub ending: Ending,
}

/// Follows a recording to its end.
///
/// # Errors
///
/// If it is not MCAP or has no usable IMU topic, and nothing is left behind; if the system refuses, or `stop` asks, and
/// the same call then goes on from where it was.
pub fn tail(
    input: &Path,
    output: &Path,
    config: &Config,
    following: &Following,
    stop: &Stop,
    tell: Tell<'_>,
) -> Result<Tailed, Error> {
    let sidecar = sidecar_of(output);
    let mut shell = Shell {
        output: output.to_owned(),
        config,
        following,
        stop,
        owner: Owner { version: env!("CARGO_PKG_VERSION").to_owned(), configuration: config.canonical() },
        appending: Appending::open(&sidecar)?,
        checkpoint: Checkpoint::new(sidecar.with_extension("checkpoint")),
    };
    let done = shell.run(input, tell);
    // An empty sidecar is but a lock.
    let nothing = shell.appending.length() == 0 && !shell.checkpoint.exists();
    match done {
        Ok(done) => Ok(done),
        Err(error) if nothing => shell.tidy().and(Err(error)),
        Err(error @ Error::Input { .. }) if shell.checkpoint.exists() => shell.tidy().and(Err(error)),
        Err(Error::Stopped) => Err(Error::Paused),
        Err(error) => Err(error),
    }
}

/// Where the annotations stand while a recording is followed: beside the output.
pub fn sidecar_of(output: &Path) -> PathBuf {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let stem = stem.strip_suffix(".annotated").unwrap_or(&stem);
    output.with_file_name(format!("{stem}.stillpoint.mcap"))
}

/// What stays the same while a recording is followed, and the files that belong to it.
struct Shell<'a> {
    output: PathBuf,
    config: &'a Config,
    following: &'a Following,
    stop: &'a Stop,
    owner: Owner,
    appending: Appending,
    checkpoint: Checkpoint,
}

/// What changes with every byte.
struct Course {
    growing: Growing,
    scan: Scan,
    learner: Learner,
    sidecar: Option<Sidecar>,
    profile: String,
}

/// How far reading went.
enum Reached {
    /// All that is there.
    Here,
    End,
    /// What was there is gone.
    Loss,
}

impl Course {
    /// Takes in what a killed run had learned.
    fn recall(&mut self, sidecar: &Appending, stop: &Stop) -> Result<(), Error> {
        let Self { learner, .. } = self;
        sidecar.read(&|_| stop.check(), |said| {
            if let Said::Annotation { topic, schema, encoding, message } = said
                && let Ok(said) = annotate::read(schema, encoding, message.data)
            {
                learner.recall(topic, &engine::Event { log_time: message.log_time, message: said });
            }
            Ok(())
        })?;
        learner.recall_open();
        Ok(())
    }
}

impl Shell<'_> {
    fn run(&mut self, input: &Path, tell: Tell<'_>) -> Result<Tailed, Error> {
        if !self.following.options.force {
            if self.output.exists() {
                return self.already(input);
            }
            if self.appending.length() > 0 && !self.checkpoint.exists() {
                return Err(Error::Exists(self.appending.path().to_owned()));
            }
        }
        let growing = self.await_beginning(input, tell)?;
        self.follow(growing, tell)
    }

    /// The output exists: it must be the result of the recording as it is.
    fn already(&mut self, input: &Path) -> Result<Tailed, Error> {
        let recording = Recording::open_original(input, Access::Read)?;
        let (report, written) = batch::annotate(
            &Input::of(recording),
            std::slice::from_ref(&self.output),
            self.config,
            Options { force: false, ..self.following.options },
            &|_| self.stop.check(),
        )?;
        // A tail may have been killed just before it removed them.
        if self.checkpoint.exists() {
            self.tidy()?;
        } else if self.appending.length() == 0 {
            self.remove_sidecar()?;
        }
        Ok(Tailed { report, output: self.output.clone(), written, ending: Ending::Finished })
    }

    fn await_beginning(&mut self, input: &Path, tell: Tell<'_>) -> Result<Growing, Error> {
        let began = Instant::now();
        let mut told = false;
        loop {
            if let Some(growing) = Growing::open(input)? {
                return Ok(growing);
            }
            if !std::mem::replace(&mut told, true) {
                tell(News::Awaited);
            }
            if self.following.patience.is_some_and(|patience| began.elapsed() >= patience) {
                let why = "nothing was recorded: it is still missing or empty; was its recorder ever started?";
                return Err(Error::input(input, why));
            }
            self.pause(self.following.poll)?;
        }
    }

    fn follow(&mut self, growing: Growing, tell: Tell<'_>) -> Result<Tailed, Error> {
        let mut course = self.begin(growing, tell)?;
        let ending = match self.record(&mut course, tell) {
            Err(error) => {
                // What was done so far need not be done again; that the tail is to stop is worth more than a full disk.
                let _ = self.save(&mut course).and_then(|()| self.checkpoint.settle());
                return Err(error);
            }
            Ok(ending) => ending,
        };
        tell(News::Ended(ending));
        self.end(course, ending, tell)
    }

    /// Takes up what a killed run had done, or begins.
    fn begin(&mut self, mut growing: Growing, tell: Tell<'_>) -> Result<Course, Error> {
        match self.checkpoint.load(&self.owner)? {
            Found::State(state) if state.length <= self.appending.length() && growing.recognise(&state.known) => {
                let mut course = Course {
                    profile: state.position.profile().to_owned(),
                    scan: Scan::resume(state.position),
                    learner: state.learner.resume(self.config),
                    sidecar: state.sidecar,
                    growing,
                };
                self.appending.cut(state.length)?;
                course.recall(&self.appending, self.stop)?;
                course.learner.tell_channels(tell);
                tell(News::Opened(course.scan.offset()));
                return Ok(course);
            }
            Found::State(_) => tell(News::Trouble("the checkpoint is of another recording: starting anew")),
            Found::Useless(why) => tell(News::Trouble(&format!("the checkpoint {why}: starting anew"))),
            Found::Nothing => {}
        }
        growing.recognise(&(0, Vec::new()));
        growing.passed(growing.length().min(64))?;
        self.appending.cut(0)?;
        let (scan, learner) = (Scan::new(), Learner::new(self.config));
        let course = Course { growing, scan, learner, sidecar: None, profile: String::new() };
        tell(News::Opened(0));
        Ok(course)
    }

    /// Follows to the end.
    fn record(&mut self, course: &mut Course, tell: Tell<'_>) -> Result<Ending, Error> {
        let mut last = Instant::now();
        let mut unnamed = None;
        loop {
            course.scan.extend(course.growing.length());
            match self.read(course, tell)? {
                Reached::Here => {}
                Reached::End => return Ok(Ending::Finished),
                Reached::Loss => return Ok(Ending::Truncated),
            }
            self.save_if_due(course, tell);
            loop {
                self.tell_progress(course, tell);
                self.pause(self.following.poll)?;
                match course.growing.look()? {
                    Look::Grown => {
                        last = Instant::now();
                        break;
                    }
                    Look::Lost => return Ok(Ending::Truncated),
                    Look::Unnamed(ending) => unnamed = Some(ending),
                    Look::Same => {}
                }
                let idle = last.elapsed();
                let ending = match unnamed {
                    Some(ending) if idle >= UNNAMED => ending,
                    _ if idle >= self.following.idle => Ending::Idle,
                    _ if idle >= CLOSED && course.growing.is_closed() => Ending::Finished,
                    _ => {
                        self.save_if_due(course, tell);
                        continue;
                    }
                };
                course.scan.finish();
                return match self.read(course, tell)? {
                    Reached::Loss => Ok(Ending::Truncated),
                    Reached::Here | Reached::End => Ok(ending),
                };
            }
        }
    }

    /// Reads what is there, and writes what it teaches.
    fn read(&mut self, course: &mut Course, tell: Tell<'_>) -> Result<Reached, Error> {
        let before = course.scan.offset();
        let reached = loop {
            match course.scan.next_event().map_err(|e| Error::input(course.growing.path(), e.to_string()))? {
                Event::Read { offset, length } => {
                    self.stop.check()?;
                    self.tell_progress(course, tell);
                    let there = course.growing.length().saturating_sub(offset);
                    let ahead = there.min(length.max(READ) as u64) as usize;
                    if !course.growing.read(course.scan.insert(ahead), offset)? {
                        break Reached::Loss;
                    }
                    course.scan.notify_read(ahead);
                }
                Event::Wait => break Reached::Here,
                Event::End => break Reached::End,
                event => {
                    if let Event::Header { profile, .. } = &event {
                        course.profile = (*profile).to_owned();
                    }
                    let ends = matches!(event, Event::ChunkEnd);
                    course.learner.take(event, tell);
                    if ends {
                        self.write(course, tell)?;
                        self.save_if_due(course, tell);
                    }
                }
            }
        };
        self.write(course, tell)?;
        if course.scan.offset() > before && !course.growing.passed(course.scan.offset())? {
            return Ok(Reached::Loss);
        }
        Ok(reached)
    }

    fn tell_progress(&self, course: &Course, tell: Tell<'_>) {
        course.learner.tell_imus(tell);
        let (read, length) = (course.scan.offset(), course.growing.length());
        tell(News::Read(Progress { read, length, sidecar: self.appending.length() }));
    }

    /// Writes the blocks that were closed. A full disk is waited for.
    fn write(&mut self, course: &mut Course, tell: Tell<'_>) -> Result<(), Error> {
        let blocks: Vec<_> = course.learner.take_blocks().collect();
        if blocks.is_empty() {
            return Ok(());
        }
        if course.sidecar.is_none() && !self.checkpoint.exists() {
            // A sidecar without a checkpoint is somebody else's.
            self.patiently(tell, |shell| shell.checkpoint.mark(&shell.owner))?;
        }
        let Course { growing, learner, sidecar, profile, .. } = course;
        self.append(sidecar, profile, learner.annotator().topics(), blocks, growing.path())?;
        self.patiently(tell, |shell| shell.appending.flush())
    }

    /// Does what a full disk may hinder, again and again for as long as an idle recorder would be waited for.
    fn patiently<T>(&mut self, tell: Tell<'_>, mut act: impl FnMut(&mut Self) -> Result<T, Error>) -> Result<T, Error> {
        let began = Instant::now();
        let mut told = false;
        loop {
            match act(self) {
                Err(error) if error.is_full() && began.elapsed() < self.following.idle => {
                    if !std::mem::replace(&mut told, true) {
                        tell(News::Trouble(&format!("{error}; waiting for room")));
                    }
                    self.pause(RETRY)?;
                }
                done => return done,
            }
        }
    }

    fn save_if_due(&mut self, course: &mut Course, tell: Tell<'_>) {
        if self.checkpoint.is_due()
            && let Err(error) = self.save(course)
        {
            tell(News::Trouble(&error.to_string()));
        }
    }

    /// Saves where it stands, if that is a place to go on from: all that was learned is written.
    fn save(&mut self, course: &mut Course) -> Result<(), Error> {
        if course.learner.has_blocks() || self.appending.has_pending() {
            return Ok(());
        }
        let Some(position) = course.scan.position() else { return Ok(()) };
        if !course.growing.passed(course.scan.offset())? {
            // It was written anew, which the next look at it will find out.
            return Ok(());
        }
        let state = StateOf {
            known: course.growing.known(),
            position: &position,
            learner: &course.learner,
            sidecar: &course.sidecar,
            length: self.appending.length(),
        };
        self.checkpoint.save(&self.owner, &state, &self.appending)
    }

    /// Everything has been read: the last annotations, the annotated recording, and no more of what belongs to a tail.
    fn end(&mut self, mut course: Course, ending: Ending, tell: Tell<'_>) -> Result<Tailed, Error> {
        if ending == Ending::Truncated {
            let what = "the file was cut off or written anew while it was followed: what stood there is lost";
            let offset = course.scan.offset();
            let length = course.growing.length().saturating_sub(offset);
            let damage = Damage { offset, length, what: what.to_owned() };
            course.learner.take(Event::Damage(damage), tell);
        }
        let Course { growing, mut scan, learner, mut sidecar, profile } = course;
        let mut learned = learner.finish(tell);
        let indexes = scan.take_indexes();
        let inventory = scan.into_inventory();
        let file = growing.file().try_clone().map_err(Error::io("read", growing.path()))?;
        let recording = Recording::of_file(file, growing.path(), growing.length());
        if ending != Ending::Truncated {
            if let Some(original) = recording.original_in_it(&inventory)? {
                return self.annotate(&original, ending);
            }
            // The batch run does not read everything, so that it may know of less damage; and what is corrected by the last
            // calibration is written by it alone.
            if learned.damages > 0 || self.config.output.corrected == annotate::Corrected::Final {
                return self.annotate(&recording, ending);
            }
        }
        if learned.imus.is_empty() && !self.following.options.allow_no_imu {
            let kind = |id| inventory.schemas().get(&id).map_or("", |schema| &*schema.name);
            let channels =
                learned.channels.iter().map(|(channel, verdict)| (channel, verdict, kind(channel.schema_id)));
            return Err(batch::no_imu(growing.path(), channels));
        }
        let last = std::mem::take(&mut learned.blocks);
        self.append(&mut sidecar, &profile, learned.annotator.topics(), last, growing.path())?;
        self.patiently(tell, |shell| shell.appending.flush())?;
        let report = Report::of(&inventory, &learned);
        if ending == Ending::Truncated {
            let output = self.appending.path().to_owned();
            self.close(sidecar, tell)?;
            return Ok(Tailed { report, output, written: Written::Now, ending });
        }
        let (report, written) = self.patiently(tell, |shell| shell.fold(&recording, &inventory, &learned, &indexes))?;
        match self.following.keep_sidecar {
            true => self.close(sidecar, tell)?,
            false => self.tidy()?,
        }
        Ok(Tailed { report, output: self.output.clone(), written, ending })
    }

    /// Leaves the whole recording to the batch path.
    fn annotate(&mut self, recording: &Recording, ending: Ending) -> Result<Tailed, Error> {
        let options = self.following.options;
        let watch = |_| self.stop.check();
        let input = Input::of(recording.again()?);
        let (report, written) =
            batch::annotate(&input, std::slice::from_ref(&self.output), self.config, options, &watch)?;
        if self.following.keep_sidecar {
            let options = Options { form: Form::Sidecar, force: true, ..options };
            batch::annotate(&input, &[self.appending.path().to_owned()], self.config, options, &watch)?;
            self.checkpoint.remove()?;
        } else {
            self.tidy()?;
        }
        Ok(Tailed { report, output: self.output.clone(), written, ending })
    }

    /// Writes the annotated recording as the batch path does.
    fn fold(
        &mut self,
        recording: &Recording,
        inventory: &Inventory,
        learned: &Learned,
        indexes: &[u8],
    ) -> Result<(Report, Written), Error> {
        let watch = |_| self.stop.check();
        let mut kept = Kept::beside(&self.output);
        self.appending.blocks(learned.annotator.topics(), &watch, |block| kept.block(block))?;
        kept.indexes(indexes)?;
        batch::fold(recording, (inventory, learned), kept, &self.output, self.config, self.following.options, &watch)
    }

    /// Encodes blocks, to be written next.
    fn append(
        &mut self,
        sidecar: &mut Option<Sidecar>,
        profile: &str,
        topics: &[Topic],
        blocks: Vec<Block>,
        input: &Path,
    ) -> Result<(), Error> {
        let sidecar = match sidecar {
            Some(sidecar) => sidecar,
            None => {
                let (begun, head) = Sidecar::open(profile, &batch::settings(self.config));
                self.appending.put(&head);
                sidecar.insert(begun)
            }
        };
        for block in blocks {
            let bytes = sidecar.block(topics, &block).map_err(|e| Error::input(input, e.to_string()))?;
            self.appending.put(&bytes);
        }
        Ok(())
    }

    /// Makes a recording of the sidecar, to stay.
    fn close(&mut self, sidecar: Option<Sidecar>, tell: Tell<'_>) -> Result<(), Error> {
        if let Some(sidecar) = sidecar {
            for piece in sidecar.close() {
                if let Piece::Bytes(bytes) = piece {
                    self.appending.put(&bytes);
                }
            }
            self.patiently(tell, |shell| shell.appending.flush())?;
        }
        self.checkpoint.remove()
    }

    fn pause(&self, time: Duration) -> Result<(), Error> {
        self.stop.check()?;
        std::thread::sleep(time);
        self.stop.check()
    }

    fn tidy(&mut self) -> Result<(), Error> {
        self.remove_sidecar()?;
        self.checkpoint.remove()
    }

    fn remove_sidecar(&mut self) -> Result<(), Error> {
        std::fs::remove_file(self.appending.path()).map_err(Error::io("remove", self.appending.path()))
    }
}
