//! Destination of a recording's result: one file or folder, a file for each of several, or the recording itself.
//! [`annotate`](crate::run::annotate()) makes the content.

use std::path::{Path, PathBuf};

use crate::Error;
use crate::record::Topic;
use crate::run::input::recording::Recording;
use crate::run::input::rosbag2::{Contents, METADATA, ORIGINAL};
use crate::run::input::splits::Input;
use crate::run::limits::check_files;
use crate::run::output::file::Output;
use crate::run::output::folder::{self, Folder};
use crate::run::output::options::{Form, Options};
use crate::run::output::partial::Partial;
use crate::run::output::reads::Reads;
use crate::run::output::written::Written;
use crate::run::store::{ResultMark, is_url};

/// Receiver of the annotated splits of a recording, or of its sidecar, one after the other.
pub(crate) struct OutputSet<'a> {
    input: &'a Input,
    path: PathBuf,
    sync: bool,
    in_place: bool,
    place: Destination,
    mark: ResultMark,
    written: Written,
}

enum Destination {
    /// Files that appear when all of them are complete.
    Files { next: std::vec::IntoIter<Output>, whole: Vec<Output> },
    /// A folder that appears when all its files are complete.
    Folder(Folder),
}

impl<'a> OutputSet<'a> {
    /// Opens the outputs: one path for a sidecar, a single file or a folder, one path each for several files.
    pub(crate) fn open(input: &'a Input, paths: &[PathBuf], options: Options, mark: ResultMark) -> Result<Self, Error> {
        let path = paths.first().map_or(input.path(), PathBuf::as_path).to_owned();
        let reads = input.reads();
        let mark = ResultMark { input: input.identity(), ..mark };
        let files = |outputs: Vec<Output>| Destination::Files { next: outputs.into_iter(), whole: Vec::new() };
        if options.form == Form::InPlace {
            // Each file, and what is to be written behind it.
            check_files(input.path(), input.splits.len(), 2)?;
        }
        let place = match (options.form, &input.bag) {
            (Form::InPlace, _) => files(input.splits.iter().map(Output::itself).collect::<Result<_, _>>()?),
            (Form::Annotated, Some(_)) if is_url(&path) => {
                let why = "the annotated folder of a folder cannot be put there; --sidecar puts its annotations there";
                return Err(Error::Usage(format!("{}: {why}", path.display())));
            }
            (Form::Annotated, Some(_)) => Destination::Folder(Folder::open(&path, options.force, reads)?),
            _ => {
                let open = |path: &PathBuf| {
                    let mut output = Output::open(path, options.force, &reads)?;
                    // Annotations alone are short.
                    output.mark(&mark, if options.form == Form::Sidecar { 0 } else { input.length() });
                    Ok(output)
                };
                files(paths.iter().map(open).collect::<Result<_, Error>>()?)
            }
        };
        let in_place = options.form == Form::InPlace;
        let sync = options.sync || in_place;
        Ok(Self { input, path, sync, in_place, place, mark, written: Written::Before })
    }

    /// A path on the disk that the result is written to.
    pub(crate) fn beside(&self) -> &Path {
        &self.path
    }

    /// Output of the next file.
    pub(crate) fn next(&mut self, index: usize) -> Result<Output, Error> {
        match &mut self.place {
            Destination::Files { next, .. } => {
                next.next().ok_or_else(|| Error::Usage("each file needs an output".to_owned()))
            }
            Destination::Folder(folder) => {
                let name = self.input.bag.as_ref().and_then(|bag| bag.names().nth(index)).unwrap_or_default();
                folder.output(name)
            }
        }
    }

    /// Takes a complete file.
    pub(crate) fn put(&mut self, output: Output, split: &Recording) -> Result<(), Error> {
        match &mut self.place {
            Destination::Files { whole, .. } => whole.push(output),
            Destination::Folder(_) => self.written = self.written.and(output.finish(split, self.sync)?),
        }
        Ok(())
    }

    /// Completes all files, whose contents are given. The outcome is the number of damages, and whether all IMUs are
    /// calibrated.
    pub(crate) fn finish(self, contents: &[Contents], own: &[Topic], outcome: (u64, bool)) -> Result<Written, Error> {
        let Self { input, sync, in_place, place, mut written, mark, .. } = self;
        let mark = ResultMark { outcome: Some(outcome), ..mark };
        let described = input.bag.as_ref().and_then(|bag| Some((bag, bag.original()?, bag.annotated(contents, own)?)));
        match place {
            Destination::Files { whole, .. } => {
                let described = described.filter(|_| in_place);
                if in_place {
                    // All of them, or none.
                    input.splits.iter().try_for_each(Recording::check_unchanged)?;
                }
                // Once the splits are annotated, nothing else tells the old metadata.
                if let Some((bag, original, _)) = &described {
                    let original_of = bag.folder().join(ORIGINAL);
                    folder::write(Partial::create(&original_of, &Reads::default())?, original, sync)?;
                }
                for (mut output, split) in whole.into_iter().zip(&input.splits) {
                    output.mark(&mark, 0);
                    written = written.and(output.finish(split, sync)?);
                }
                if let Some((bag, _, metadata)) = &described {
                    let place = bag.folder().join(METADATA);
                    folder::write(Partial::create(&place, &Reads::default())?, metadata, sync)?;
                }
                Ok(written)
            }
            Destination::Folder(folder) => {
                if let Some(bag) = &input.bag {
                    bag.blank().try_for_each(|name| folder.copy(bag, name, sync))?;
                }
                if let Some((_, original, metadata)) = &described {
                    folder.put(METADATA, metadata, sync)?;
                    folder.put(ORIGINAL, original, sync)?;
                }
                folder.finish(sync)
            }
        }
    }
}
