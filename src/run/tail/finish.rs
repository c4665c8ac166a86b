//! End of a followed recording: the last annotations, the annotated recording, and removal of the tail's own files.

use std::path::Path;

use super::index_log::ItemKind;
use super::location::Location;
use super::names::{set_aside, stays_as};
use super::shell::{Shell, Tailed};
use super::state::Progression;
use crate::Error;
use crate::annotate::Corrected;
use crate::pipeline::annotated_before::annotated_before;
use crate::pipeline::events::{Ending, Notice, Notify};
use crate::pipeline::learner::Learned;
use crate::pipeline::no_imu::no_imu;
use crate::record::{Damage, Event, Piece, Sidecar};
use crate::run::batch::{self, Followed, Form, Indexes, Options, OutputSet, Report};
use crate::run::input::recording::Recording;
use crate::run::input::splits::Input;
use crate::run::output::sidecar_file::SidecarFile;
use crate::run::output::written::Written;
use crate::run::store::ResultMark;
use crate::run::tail::checkpoint::{Split, State};

/// State of a recording's files at its end.
enum Remains {
    /// The bytes that were read.
    Same(Input),
    /// Other bytes, which must be read anew.
    Other(Input),
    Nothing,
}

impl Shell<'_> {
    /// Finishes a recording whose bytes have all been read.
    pub(super) fn end(
        &mut self,
        mut progression: Progression,
        ending: Ending,
        notify: Notify<'_>,
    ) -> Result<Tailed, Error> {
        if ending == Ending::Truncated {
            let what = "the file was cut off or written anew while it was followed: what stood there is lost";
            let offset = progression.scan.offset();
            let length = progression.growing.length().saturating_sub(offset);
            let damage = Damage { offset, length, what: what.to_owned() };
            progression.learner.take(Event::Damage(damage), notify);
        }
        progression.learner.close(notify);
        let last: Vec<_> = progression.learner.take_blocks().collect();
        self.append(&mut progression, &last)?;
        progression.log_indexes(&mut self.indexes);
        let indexes = self.patiently(notify, |shell| shell.indexes.flush())?.length;
        let (length, remains) = (progression.offset(), progression.remains(ending)?);
        let Progression { location, done, growing, scan, learner, sidecar, blocks, .. } = progression;
        let useless = (!learner.has_imu()).then(|| no_imu(location.path(), learner.sources(), &learner.obstacles()));
        let annotated = annotated_before(learner.sources());
        let learned = learner.finish(notify);
        let here = Split {
            name: String::new(),
            known: growing.known().clone(),
            length: growing.length(),
            inventory: scan.into_inventory(),
            topics: learned.annotator.topics().len(),
            blocks,
            indexes,
        };
        let splits: Vec<_> = done.into_iter().chain([here]).collect();
        let input = match remains {
            Remains::Other(input) => return self.annotate(&input, ending, notify),
            // The batch run does not read everything, so it may report less damage, except for files that never began;
            // and only the batch run can correct messages by the last calibration.
            Remains::Same(input)
                if learned.damages > 0
                    || learned.apart
                    || !input.blank().is_empty()
                    || self.config.output.corrected == Corrected::Final =>
            {
                return self.annotate(&input, ending, notify);
            }
            Remains::Same(input) => Some(input),
            Remains::Nothing => None,
        };
        if let Some(error) = useless.filter(|_| !self.following.options.allow_no_imu) {
            if ending != Ending::Truncated {
                return Err(error);
            }
            // Nothing was learned that could be kept, and what stands there now may be of use.
            self.tidy()?;
            let report = Report::of(splits.iter().map(|split| &split.inventory), &learned);
            return Ok(Tailed {
                report,
                length,
                output: self.sidecar_file.path().to_owned(),
                written: Written::Now,
                ending,
            });
        }
        self.patiently(notify, |shell| shell.sidecar_file.flush())?;
        let Some(input) = input else {
            let output = self.sidecar_file.path().to_owned();
            self.close(sidecar, notify)?;
            let report = Report::of(splits.iter().map(|split| &split.inventory), &learned);
            return Ok(Tailed { report, length, output, written: Written::Now, ending });
        };
        if let Some(note) = annotated {
            notify(Notice::Trouble(&format!("it {note}")));
        }
        let (report, written) = self.patiently(notify, |shell| shell.fold(&input, &splits, &learned))?;
        match self.following.keep_sidecar {
            true => self.close(sidecar, notify)?,
            false => self.tidy()?,
        }
        Ok(Tailed { report, length: input.length(), output: self.output.clone(), written, ending })
    }

    /// Hands the whole recording to the batch path.
    fn annotate(&mut self, input: &Input, ending: Ending, notify: Notify<'_>) -> Result<Tailed, Error> {
        let options = self.following.options;
        let (report, written) = self.patiently(notify, |shell| shell.leave_to_batch(input, &shell.output, options))?;
        self.leave_sidecar(input, notify)?;
        Ok(Tailed { report, length: input.length(), output: self.output.clone(), written, ending })
    }

    /// Leaves the sidecar as the batch path writes it, if it is to stay, and nothing else.
    pub(super) fn leave_sidecar(&mut self, input: &Input, notify: Notify<'_>) -> Result<(), Error> {
        if !self.following.keep_sidecar {
            return self.tidy();
        }
        let options = Options { form: Form::Sidecar, force: true, ..self.following.options };
        // It replaces the one that grew, whose lock would otherwise exclude this process itself.
        self.sidecar_file.unlock()?;
        self.patiently(notify, |shell| shell.leave_to_batch(input, shell.sidecar_file.path(), options))?;
        self.forget()
    }

    fn leave_to_batch(&self, input: &Input, output: &Path, options: Options) -> Result<(Report, Written), Error> {
        batch::annotate(input, &[output.to_owned()], self.config, options, &|_| self.stop.check())
    }

    /// Writes the annotated recording as the batch path does.
    fn fold(&mut self, input: &Input, splits: &[Split], learned: &Learned) -> Result<(Report, Written), Error> {
        let watch = |_| self.stop.check();
        let mut followed = Vec::new();
        let (mut blocks, mut at) = (0, 0);
        for Split { inventory, topics, blocks: until, indexes: end, .. } in splits {
            let mut indexes = Indexes::beside(&self.output);
            self.indexes.items(at..*end, |kind, bytes| match kind {
                kind if kind == ItemKind::Chunks as u8 => indexes.push(bytes, &[]),
                kind if kind == ItemKind::Reindexed as u8 => indexes.push(&[], bytes),
                _ => Ok(()),
            })?;
            followed.push(Followed { inventory, topics: *topics, blocks: until - blocks, indexes });
            (blocks, at) = (*until, *end);
        }
        let target =
            OutputSet::open(input, std::slice::from_ref(&self.output), self.following.options, ResultMark::default())?;
        let mut next = self.sidecar_file.blocks(learned.annotator.topics());
        batch::fold(input, followed, &mut next, learned, target, &batch::settings(self.config), &watch)
    }

    /// Completes the sidecar, which stays.
    fn close(&mut self, sidecar: Option<Sidecar>, notify: Notify<'_>) -> Result<(), Error> {
        if let Some(sidecar) = sidecar {
            self.complete(sidecar, notify)?;
        }
        self.forget()
    }

    fn complete(&mut self, sidecar: Sidecar, notify: Notify<'_>) -> Result<(), Error> {
        let logged = self.indexes.flush()?.length;
        for piece in sidecar.close() {
            match piece {
                Piece::Bytes(bytes) => self.sidecar_file.put(&bytes),
                Piece::Indexes(_) => self.indexes.items(0..logged, |kind, bytes| {
                    if kind == ItemKind::Sidecar as u8 {
                        self.sidecar_file.put(bytes);
                    }
                    Ok(())
                })?,
                Piece::Original(_) => {}
            }
        }
        self.patiently(notify, |shell| shell.sidecar_file.flush())
    }

    /// Keeps the annotations of an earlier recording under another name, since nothing else may hold them any more.
    pub(super) fn set_aside(&mut self, state: Option<State>, notify: Notify<'_>) -> Result<(), Error> {
        if self.sidecar_file.length() == 0 {
            return Ok(());
        }
        if let Some(State { sidecar: Some(mut sidecar), learner, blocks, length, indexes, .. }) = state
            && length <= self.sidecar_file.length()
            && self.indexes.resume(indexes)?
        {
            // The state does not know of blocks written after it.
            let mut next = self.sidecar_file.blocks(learner.topics());
            let (mut seen, mut later) = (0, Vec::new());
            loop {
                self.stop.check()?;
                match next() {
                    Ok(Some(block)) => {
                        seen += 1;
                        later.extend((seen > blocks).then_some(block));
                    }
                    // What cannot be read now is not cut off.
                    Err(error) if error.is_passing() => return Err(error),
                    Ok(None) | Err(_) => break,
                }
            }
            drop(next);
            self.sidecar_file.cut(length)?;
            for block in &later {
                let bytes = sidecar.block(learner.topics(), block);
                self.sidecar_file.put(&bytes.map_err(|e| Error::input(self.sidecar_file.path(), e.to_string()))?);
            }
            self.indexes.push(ItemKind::Sidecar, &sidecar.take_indexes());
            self.complete(sidecar, notify)?;
        }
        let path = self.sidecar_file.path().to_owned();
        let aside = set_aside(&path)?;
        notify(Notice::Trouble(&stays_as(&aside)));
        // Last: the next run would take a sidecar without a checkpoint for somebody else's.
        self.forget()?;
        self.sidecar_file = SidecarFile::open(&path)?;
        Ok(())
    }
}

impl Progression {
    /// Files of the recording, now that nothing more is added to it.
    fn remains(&self, ending: Ending) -> Result<Remains, Error> {
        if ending == Ending::Truncated {
            return Ok(Remains::Nothing);
        }
        let Self { location, done, growing, scan, .. } = self;
        let Location::Folder(folder) = location else {
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
        let files = input.files().filter_map(|file| location.name_of(file));
        let same = files.eq(self.files()) && input.splits.iter().map(Recording::length).eq(lengths);
        Ok(if same { Remains::Same(input) } else { Remains::Other(input) })
    }
}
