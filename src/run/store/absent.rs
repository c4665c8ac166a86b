//! Object stores where the program was built without them: every URL is refused.

use std::convert::Infallible;
use std::io;
use std::ops::Range;
use std::path::Path;

use super::listed::Listed;
use super::mark::ResultMark;
use crate::Error;
use crate::run::output::written::Written;

fn refused(path: &Path) -> Error {
    let what = "this stillpoint was built without object stores; take the wheel (pip install stillpoint) or the released \
                program, build with `--features object-store`, or copy the recording here";
    Error::Usage(format!("{}: {what}", path.display()))
}

/// An object in a store.
#[derive(Debug)]
pub(crate) struct NoObject(Infallible);

impl NoObject {
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        Err(refused(path))
    }

    pub(crate) fn length(&self) -> u64 {
        match self.0 {}
    }

    pub(crate) fn identity(&self) -> String {
        match self.0 {}
    }

    pub(crate) fn read_exact_at(&self, _: &mut [u8], _: u64) -> io::Result<()> {
        match self.0 {}
    }

    pub(crate) fn announce(&self, _: &Range<u64>) {
        match self.0 {}
    }

    pub(crate) fn fetch(&self, _: &Range<u64>) {
        match self.0 {}
    }

    pub(crate) fn at_hand(&self, _: u64) -> usize {
        match self.0 {}
    }

    pub(crate) fn forget_before(&self, _: u64) {
        match self.0 {}
    }

    pub(crate) fn read_in_blocks(&self) {
        match self.0 {}
    }
}

/// A result on its way into a store.
#[derive(Debug)]
pub(crate) struct NoUpload(Infallible);

impl NoUpload {
    pub(crate) fn begin(path: &Path, _: bool) -> Result<Self, Error> {
        Err(refused(path))
    }

    pub(crate) fn mark(&mut self, _: &ResultMark, _: u64) {
        match self.0 {}
    }

    pub(crate) fn put(&mut self, _: &[u8]) -> Result<(), Error> {
        match self.0 {}
    }

    pub(crate) fn finish(self) -> Result<Written, Error> {
        match self.0 {}
    }
}

pub(crate) fn check(path: &Path) -> Result<(), Error> {
    Err(refused(path))
}

pub(crate) fn list(prefix: &Path) -> Result<Vec<Listed>, Error> {
    Err(refused(prefix))
}

pub(crate) fn marked(path: &Path) -> Result<Option<Option<ResultMark>>, Error> {
    Err(refused(path))
}

pub(crate) fn known_identity(_: &Path) -> Option<String> {
    None
}
