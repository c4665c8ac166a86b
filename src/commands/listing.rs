//! Inputs named on the command line and in a list. A prefix of an object store stands for what lies under it.

use std::path::{Path, PathBuf};

use stillpoint::{Error, run};

use super::files::text_of;

/// An input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    pub path: PathBuf,
    /// Folders between it and the prefix that stands for it; none where it was named itself.
    pub below: PathBuf,
    /// Whether it stands on the command line itself.
    pub is_typed: bool,
}

/// Paths of the inputs in the order in which they are named, those of the list last. `under` lists a prefix.
pub fn inputs(
    typed: &[PathBuf],
    list: Option<&Path>,
    under: impl Fn(&Path) -> Result<Vec<PathBuf>, Error>,
) -> Result<Vec<PathBuf>, Error> {
    Ok(named(typed, list, under)?.into_iter().map(|named| named.path).collect())
}

/// The same inputs, each with the way it was named.
pub fn named(
    typed: &[PathBuf],
    list: Option<&Path>,
    under: impl Fn(&Path) -> Result<Vec<PathBuf>, Error>,
) -> Result<Vec<Named>, Error> {
    let one = |path: &Path, is_typed| Named { path: path.to_owned(), below: PathBuf::new(), is_typed };
    let mut inputs: Vec<_> = typed.iter().map(|path| one(path, true)).collect();
    if let Some(list) = list {
        let text = text_of(list)?;
        let lines = text.lines().map(|line| line.strip_suffix('\r').unwrap_or(line));
        inputs.extend(lines.filter(|line| !line.trim().is_empty()).map(|line| one(Path::new(line), false)));
        if inputs.is_empty() {
            return Err(Error::Usage(format!("{}: the list names no recording", list.display())));
        }
    }
    let each = |named: Named| -> Result<Vec<Named>, Error> {
        if !run::is_prefix(&named.path) {
            return Ok(vec![named]);
        }
        let prefix = &named.path;
        let found = |path: PathBuf| Named { below: run::folders_below(prefix, &path), path, is_typed: false };
        Ok(under(prefix)?.into_iter().map(found).collect())
    };
    Ok(inputs.into_iter().map(each).collect::<Result<Vec<_>, _>>()?.concat())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn what_lies_under_a_prefix_keeps_its_folders_and_counts_as_listed() {
        let typed = ["s3://robots/in/", "a/x.mcap"].map(PathBuf::from);
        let under = |prefix: &Path| Ok(vec![prefix.join("s01/r.mcap"), prefix.join("r.mcap")]);
        let named = named(&typed, None, under).unwrap();
        let said =
            |named: &Named| (named.path.display().to_string(), named.below.display().to_string(), named.is_typed);
        let expected = [
            ("s3://robots/in/s01/r.mcap".to_owned(), "s01".to_owned(), false),
            ("s3://robots/in/r.mcap".to_owned(), String::new(), false),
            ("a/x.mcap".to_owned(), String::new(), true),
        ];
        assert_eq!(named.iter().map(said).collect::<Vec<_>>(), expected);
    }
}
