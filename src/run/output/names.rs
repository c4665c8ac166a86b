//! Names of results, made of the recording's own name, byte for byte, Unicode or not.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt as _;
use std::path::{Path, PathBuf};

/// Default path of a recording's result: beside it, or in `folder`.
///
/// Annotating again replaces the annotations, so an annotated recording keeps its name. A folder's result is a folder.
pub fn default_output(input: &Path, is_folder: bool, folder: Option<&Path>, sidecar: bool) -> PathBuf {
    let whole = if is_folder { input.canonicalize().ok() } else { None };
    let whole = whole.unwrap_or_else(|| input.to_owned());
    let stem = if is_folder { whole.file_name() } else { whole.file_stem() }.unwrap_or_default();
    let stem = without_ending(stem, &[".annotated"]).unwrap_or(stem);
    let name = with_ending(
        stem,
        match (sidecar, is_folder) {
            (true, _) => ".stillpoint.mcap",
            (false, true) => ".annotated",
            (false, false) => ".annotated.mcap",
        },
    );
    // A folder may be named relative to the working directory, like `.`.
    let beside = if input.file_name().is_some() { input } else { &whole };
    folder.map_or_else(|| beside.with_file_name(&name), |folder| folder.join(&name))
}

/// A name without the first of these endings that it has; `None` if it has none of them.
pub(crate) fn without_ending<'a>(name: &'a OsStr, endings: &[&str]) -> Option<&'a OsStr> {
    endings.iter().find_map(|ending| name.as_bytes().strip_suffix(ending.as_bytes())).map(OsStr::from_bytes)
}

/// A name with an ending.
pub(crate) fn with_ending(stem: &OsStr, ending: &str) -> OsString {
    let mut name = stem.to_owned();
    name.push(ending);
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_names_stand_beside_the_input_or_in_the_folder() {
        let name = |input: &[u8], folder: Option<&str>, sidecar| {
            let output = default_output(Path::new(OsStr::from_bytes(input)), false, folder.map(Path::new), sidecar);
            output.as_os_str().as_bytes().to_owned()
        };
        assert_eq!(name(b"a/x.mcap", None, false), b"a/x.annotated.mcap");
        assert_eq!(name(b"a/x.mcap", Some("b"), true), b"b/x.stillpoint.mcap");
        assert_eq!(name(b"x.annotated.mcap", None, false), b"x.annotated.mcap");
        assert_eq!(name(b"a/\xff\xfe.mcap", None, false), b"a/\xff\xfe.annotated.mcap");
    }
}
