//! Files that a command reads and writes. `-` is standard input or output.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use stillpoint::run::{self, Partial, Reads};
use stillpoint::{Error, printable_json};

use super::printing::print;

/// Most bytes that are read from standard input (64 MiB).
const LONGEST_TEXT: u64 = 64 << 20;

/// Whether a path means standard input or output.
pub fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Writes a text to its destination: a new file, which is said, or standard output. An equal file is left as it is.
pub fn write(text: &str, output: Option<&Path>, force: bool, reads: &Reads) -> Result<(), Error> {
    // The formats written here that contain names have strings with JSON's escapes.
    let text = &*printable_json(text);
    let Some(path) = output.filter(|path| !is_pipe(path)) else { return print(text) };
    if run::is_url(path) {
        reads.refuse(path)?;
        run::put_text(path, text, force)?;
    } else {
        let partial = partial(path, force, reads)?;
        partial.file().write_all(text.as_bytes()).map_err(Error::io("write", path))?;
        finish(partial, force)?;
    }
    tracing::info!("wrote {}", path.display());
    Ok(())
}

/// Files that a command reads: its inputs, and those that its options name.
pub fn reads<'a>(inputs: impl IntoIterator<Item = &'a PathBuf>, named: &[&'a Option<PathBuf>]) -> Reads {
    Reads::of(inputs.into_iter().chain(named.iter().filter_map(|path| path.as_ref())))
}

/// Opens a result to be written: a file that is read is never replaced, any other only with `force`.
pub fn partial(path: &Path, force: bool, reads: &Reads) -> Result<Partial, Error> {
    reads.refuse(path)?;
    if force { Partial::create(path, reads) } else { Partial::create_new(path) }
}

/// Gives a result its name. An existing file may already be equal.
pub fn finish(partial: Partial, force: bool) -> Result<(), Error> {
    let path = partial.target().to_owned();
    if force || path.symlink_metadata().is_err() {
        return partial.finish(false);
    }
    match partial.equals(&path).map_err(Error::io("read", &path))? {
        true => Ok(()),
        false => Err(Error::Exists(path)),
    }
}

/// Makes a folder to write into, with those above it.
pub fn make_folder(path: &Path) -> Result<(), Error> {
    match std::fs::create_dir_all(path) {
        Err(_) if path.is_file() => Err(Error::input(path, "is a file; name a folder to write into")),
        made => made.map_err(Error::io("make the folder", path)),
    }
}

/// Text of a file or of standard input; any other path is refused.
pub fn text_of(path: &Path) -> Result<String, Error> {
    if is_pipe(path) {
        let text = std::io::read_to_string(std::io::stdin().take(LONGEST_TEXT));
        return text.map_err(Error::io("read", "standard input".as_ref()));
    }
    stillpoint::run::text(path).map_err(Error::io("read", path))
}
