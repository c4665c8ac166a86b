//! The end of a recording that was followed: the last annotations, the annotated recording, and no more of what belongs
//! to a tail. How the recording is written is left to the [batch path](crate::run::batch).

use std::path::Path;

use super::location::Trail;
use super::state::Course;
use super::{Shell, Tailed, set_aside};
use crate::Error;
use crate::annotate::Corrected;
use crate::pipeline::events::{Ending, News, Tell};
use crate::pipeline::learner::Learned;
use crate::record::{Damage, Event, Piece, Sidecar};
use crate::run::batch::{self, Followed, Form, Options, Report};
use crate::run::input::recording::Recording;
use crate::run::input::splits::Input;
use crate::run::inspect::topics;
use crate::run::output::file::Written;
use crate::run::output::sidecar_file::Appending;
use crate::run::tail::checkpoint::{Split, State};

/// What is there of a recording at its end.
enum Remains {
    /// All that was read.
    Same(Input),
    /// Something else, which is to be read anew.
    Other(Input),
    Nothing,
}

impl Shell<'_> {
    /// Everything has been read.
    pub(super) fn end(&mut self, mut course: Course, ending: Ending, tell: Tell<'_>) -> Result<Tailed, Error> {
        if ending == Ending::Truncated {
            let what = "the file was cut off or written anew while it was followed: what stood there is lost";
            let offset = course.scan.offset();
            let length = course.growing.length().saturating_sub(offset);
            let damage = Damage { offset, length, what: what.to_owned() };
            course.learner.take(Event::Damage(damage), tell);
        }
        course.learner.close(tell);
        let last: Vec<_> = course.learner.take_blocks().collect();
        self.append(&mut course, &last)?;
        let (length, remains) = (course.offset(), course.remains(ending)?);
        let Course { trail, done, growing, scan, learner, sidecar, blocks, .. } = course;
        let learned = learner.finish(tell);
        let here = Split {
            name: String::new(),
            known: growing.known().clone(),
            length: growing.length(),
            inventory: scan.into_inventory(),
            topics: learned.annotator.topics().len(),
            blocks,
        };
        let splits: Vec<_> = done.into_iter().chain([here]).collect();
        let input = match remains {
            Remains::Other(input) => return self.annotate(&input, ending, tell),
            // The batch run does not read everything, so that it may know of less damage, but of files that never began; and
            // what is corrected by the last calibration is written by it alone.
            Remains::Same(input)
                if learned.damages > 0
                    || !input.blank().is_empty()
                    || self.config.output.corrected == Corrected::Final =>
            {
                return self.annotate(&input, ending, tell);
            }
            Remains::Same(input) => Some(input),
            Remains::Nothing => None,
        };
        if learned.imus.is_empty() && !self.following.options.allow_no_imu {
            return Err(no_imu(&trail, &splits, &learned));
        }
        self.patiently(tell, |shell| shell.appending.flush())?;
        let Some(input) = input else {
            let output = self.appending.path().to_owned();
            self.close(sidecar, tell)?;
            let report = Report::of(splits.iter().map(|split| &split.inventory), &learned);
            return Ok(Tailed { report, length, output, written: Written::Now, ending });
        };
        let (report, written) = self.patiently(tell, |shell| shell.fold(&input, &splits, &learned))?;
        match self.following.keep_sidecar {
            true => self.close(sidecar, tell)?,
            false => self.tidy()?,
        }
        Ok(Tailed { report, length: input.length(), output: self.output.clone(), written, ending })
    }

    /// Leaves the whole recording to the batch path.
    fn annotate(&mut self, input: &Input, ending: Ending, tell: Tell<'_>) -> Result<Tailed, Error> {
        let options = self.following.options;
        let (report, written) = self.patiently(tell, |shell| shell.leave_to_batch(input, &shell.output, options))?;
        if self.following.keep_sidecar {
            let options = Options { form: Form::Sidecar, force: true, ..options };
            self.patiently(tell, |shell| shell.leave_to_batch(input, shell.appending.path(), options))?;
            self.checkpoint.remove()?;
        } else {
            self.tidy()?;
        }
        Ok(Tailed { report, length: input.length(), output: self.output.clone(), written, ending })
    }

    fn leave_to_batch(&self, input: &Input, output: &Path, options: Options) -> Result<(Report, Written), Error> {
        batch::annotate(input, &[output.to_owned()], self.config, options, &|_| self.stop.check())
    }

    /// Writes the annotated recording as the batch path does.
    fn fold(&mut self, input: &Input, splits: &[Split], learned: &Learned) -> Result<(Report, Written), Error> {
        let watch = |_| self.stop.check();
        let topics = learned.annotator.topics();
        let mut followed: Vec<_> =
            splits.iter().map(|split| Followed::new(&split.inventory, split.topics, &self.output)).collect();
        let (mut blocks, mut at) = (0, 0);
        self.appending.blocks(topics, &watch, |block| {
            while splits.get(at).is_some_and(|split| split.blocks <= blocks) {
                at += 1;
            }
            blocks += 1;
            followed.get_mut(at).map_or(Ok(()), |split| split.keep(topics, block))
        })?;
        batch::fold(input, followed, learned, &self.output, self.config, self.following.options, &watch)
    }

    /// Makes a recording of the sidecar, to stay.
    fn close(&mut self, sidecar: Option<Sidecar>, tell: Tell<'_>) -> Result<(), Error> {
        if let Some(sidecar) = sidecar {
            self.complete(sidecar, tell)?;
        }
        self.checkpoint.remove()
    }

    fn complete(&mut self, sidecar: Sidecar, tell: Tell<'_>) -> Result<(), Error> {
        for piece in sidecar.close() {
            if let Piece::Bytes(bytes) = piece {
                self.appending.put(&bytes);
            }
        }
        self.patiently(tell, |shell| shell.appending.flush())
    }

    /// Keeps the annotations of a recording that is not the one to be followed, since nothing else may hold them any more.
    pub(super) fn set_aside(&mut self, state: Option<State>, tell: Tell<'_>) -> Result<(), Error> {
        if self.appending.length() == 0 {
            return Ok(());
        }
        if let Some(State { sidecar: Some(mut sidecar), learner, blocks, length, .. }) = state
            && length <= self.appending.length()
        {
            // Of later ones it knows nothing yet.
            let (mut seen, mut later) = (0, Vec::new());
            self.appending.blocks(learner.topics(), &|_| self.stop.check(), |block| {
                seen += 1;
                later.extend((seen > blocks).then(|| block.clone()));
                Ok(())
            })?;
            self.appending.cut(length)?;
            for block in &later {
                let bytes = sidecar.block(learner.topics(), block);
                self.appending.put(&bytes.map_err(|e| Error::input(self.appending.path(), e.to_string()))?);
            }
            self.complete(sidecar, tell)?;
        }
        let path = self.appending.path().to_owned();
        let aside = set_aside(&path)?;
        tell(News::Trouble(&format!("what was learned of the recording before stays as {}", aside.display())));
        // Last: the next run would take what has no checkpoint for somebody else's.
        self.checkpoint.remove()?;
        self.appending = Appending::open(&path)?;
        Ok(())
    }
}

impl Course {
    /// What is there of the recording, now that nothing more is added to it.
    fn remains(&self, ending: Ending) -> Result<Remains, Error> {
        if ending == Ending::Truncated {
            return Ok(Remains::Nothing);
        }
        let Self { trail, done, growing, scan, .. } = self;
        let Trail::Folder(folder) = trail else {
            // The open file, since it may have lost its name.
            let file = growing.file().try_clone().map_err(Error::io("read", growing.path()))?;
            let recording = Recording::of_file(file, growing.path(), growing.length());
            return Ok(match recording.original_in_it(scan.inventory())? {
                Some(original) => Remains::Other(Input::of(original)),
                None => Remains::Same(Input::of(recording)),
            });
        };
        if !folder.exists() {
            return Ok(Remains::Nothing);
        }
        let input = Input::as_it_is(folder)?;
        let lengths = done.iter().map(|split| split.length).chain([growing.length()]);
        let files = input.files().filter_map(|file| trail.name_of(file));
        let same = files.eq(self.files()) && input.splits.iter().map(Recording::length).eq(lengths);
        Ok(if same { Remains::Same(input) } else { Remains::Other(input) })
    }
}

fn no_imu(trail: &Trail, splits: &[Split], learned: &Learned) -> Error {
    let kind =
        |id| splits.iter().find_map(|split| split.inventory.schemas().get(&id)).map_or("", |schema| &schema.name);
    let of_channels = learned.channels.iter().map(|(channel, verdict)| (channel, verdict, kind(channel.schema_id)));
    topics::no_imu(trail.path(), &learned.missing, of_channels)
}
