//! Where the result of a recording goes: one file or folder, a file for each of several, or the recording itself.
//!
//! What the files consist of is left to [`annotate`](crate::run::annotate()).

use std::path::{Path, PathBuf};

use crate::Error;
use crate::record::Topic;
use crate::run::input::recording::Recording;
use crate::run::input::rosbag2::{Contents, METADATA, ORIGINAL};
use crate::run::input::splits::Input;
use crate::run::output::file::{Output, Written};
use crate::run::output::folder::{self, Folder};
use crate::run::output::options::{Form, Options};
use crate::run::output::partial::Partial;
use crate::run::output::reads::Reads;

/// Takes the annotated splits of a recording, or its sidecar, one after the other.
pub(crate) struct OutputSet<'a> {
    input: &'a Input,
    path: PathBuf,
    sync: bool,
    in_place: bool,
    place: Place,
    written: Written,
}

enum Place {
    /// Files that appear when all of them are whole.
    Files { next: std::vec::IntoIter<Output>, whole: Vec<Output> },
    /// A folder that appears when all in it is whole.
    Folder(Folder),
}

impl<'a> OutputSet<'a> {
    /// For a sidecar, a single file or a folder there is one path, for several files one for each.
    pub(crate) fn open(input: &'a Input, paths: &[PathBuf], options: Options) -> Result<Self, Error> {
        let path = paths.first().map_or(input.path(), PathBuf::as_path).to_owned();
        let reads = input.reads();
        let files = |outputs: Vec<Output>| Place::Files { next: outputs.into_iter(), whole: Vec::new() };
        let place = match (options.form, &input.bag) {
            (Form::InPlace, _) => files(input.splits.iter().map(Output::itself).collect::<Result<_, _>>()?),
            (Form::Annotated, Some(_)) => Place::Folder(Folder::open(&path, options.force, reads)?),
            _ => {
                let open = |path: &PathBuf| Output::open(path, options.force, &reads);
                files(paths.iter().map(open).collect::<Result<_, _>>()?)
            }
        };
        let in_place = options.form == Form::InPlace;
        let sync = options.sync || in_place;
        Ok(Self { input, path, sync, in_place, place, written: Written::Before })
    }

    /// A place on the disk that the result is written to.
    pub(crate) fn beside(&self) -> &Path {
        &self.path
    }

    /// Where the next file goes.
    pub(crate) fn next(&mut self, index: usize) -> Result<Output, Error> {
        match &mut self.place {
            Place::Files { next, .. } => {
                next.next().ok_or_else(|| Error::Usage("each file needs an output".to_owned()))
            }
            Place::Folder(folder) => {
                let name = self.input.bag.as_ref().and_then(|bag| bag.names().nth(index)).unwrap_or_default();
                folder.output(name)
            }
        }
    }

    /// A file is complete.
    pub(crate) fn put(&mut self, output: Output, split: &Recording) -> Result<(), Error> {
        match &mut self.place {
            Place::Files { whole, .. } => whole.push(output),
            Place::Folder(_) => self.written = self.written.and(output.finish(split, self.sync)?),
        }
        Ok(())
    }

    /// All files are complete, and this is what is in them.
    pub(crate) fn finish(self, contents: &[Contents], own: &[Topic]) -> Result<Written, Error> {
        let Self { input, sync, in_place, place, mut written, .. } = self;
        let described = input.bag.as_ref().and_then(|bag| Some((bag, bag.original()?, bag.annotated(contents, own)?)));
        match place {
            Place::Files { whole, .. } => {
                let described = described.filter(|_| in_place);
                if in_place {
                    // All of them, or none.
                    input.splits.iter().try_for_each(Recording::check_unchanged)?;
                }
                // Once the splits are annotated, nothing else tells what stood there.
                if let Some((bag, original, _)) = &described {
                    let original_of = bag.folder().join(ORIGINAL);
                    folder::write(Partial::create(&original_of, &Reads::default())?, original, sync)?;
                }
                for (output, split) in whole.into_iter().zip(&input.splits) {
                    written = written.and(output.finish(split, sync)?);
                }
                if let Some((bag, _, metadata)) = &described {
                    let place = bag.folder().join(METADATA);
                    folder::write(Partial::create(&place, &Reads::default())?, metadata, sync)?;
                }
                Ok(written)
            }
            Place::Folder(folder) => {
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
