//! Names of a result's files, and of results that give way to the next recording of the same name.

use std::io;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::run::output::names::{with_ending, without_ending};
use crate::run::output::partial::rename_new;

/// Most results of one name that are kept after their recordings lost it.
const KEPT: u32 = 100;

/// Path of the annotations while a recording is followed: beside the output.
pub fn sidecar_of(output: &Path) -> PathBuf {
    let name = output.file_name().unwrap_or_default();
    // Only these endings are removed, so that two outputs share no sidecar.
    let stem = without_ending(name, &[".annotated.mcap", ".mcap", ".annotated"]).unwrap_or(name);
    output.with_file_name(with_ending(stem, ".stillpoint.mcap"))
}

/// Path of the checkpoint: beside the sidecar.
pub(crate) fn checkpoint_of(sidecar: &Path) -> PathBuf {
    sidecar.with_extension("checkpoint")
}

/// Path of the index log: beside the sidecar.
pub(crate) fn index_log_of(sidecar: &Path) -> PathBuf {
    sidecar.with_extension("indexes")
}

/// News that a result was renamed.
pub(super) fn stays_as(aside: &Path) -> String {
    format!("what was learned of the recording before stays as {}", aside.display())
}

/// Renames a result whose recording lost its name.
pub(crate) fn set_aside(result: &Path) -> Result<PathBuf, Error> {
    let name = result.file_name().unwrap_or_default();
    let endings = [".annotated.mcap", ".stillpoint.mcap", ".annotated"];
    let ending = endings.into_iter().find(|ending| without_ending(name, &[ending]).is_some()).unwrap_or_default();
    let stem = without_ending(name, &[ending]).unwrap_or(name);
    let aside = |n| result.with_file_name(with_ending(stem, &format!(".before-{n}{ending}")));
    let mut names = (1..=KEPT).map(aside);
    loop {
        let Some(aside) = names.find(|path| path.symlink_metadata().is_err()) else {
            let why =
                format!("{KEPT} results of earlier recordings of this name are kept already: move them elsewhere");
            return Err(Error::input(result, why));
        };
        match rename_new(result, &aside) {
            // The name has been taken just now.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            done => return done.map(|()| aside).map_err(Error::io("rename", result)),
        }
    }
}
