//! Inputs named on the command line and in a list. A prefix of an object store stands for what lies under it.

use std::path::{Path, PathBuf};

use stillpoint::{Error, run};

use super::files::text_of;

/// The inputs in the order in which they are named, those of the list last. `under` lists a prefix.
pub fn inputs(
    named: &[PathBuf],
    list: Option<&Path>,
    under: impl Fn(&Path) -> Result<Vec<PathBuf>, Error>,
) -> Result<Vec<PathBuf>, Error> {
    let mut inputs = named.to_vec();
    if let Some(list) = list {
        let text = text_of(list)?;
        let lines = text.lines().map(|line| line.strip_suffix('\r').unwrap_or(line));
        inputs.extend(lines.filter(|line| !line.trim().is_empty()).map(PathBuf::from));
        if inputs.is_empty() {
            return Err(Error::Usage(format!("{}: the list names no recording", list.display())));
        }
    }
    let each = |path: PathBuf| if run::is_prefix(&path) { under(&path) } else { Ok(vec![path]) };
    Ok(inputs.into_iter().map(each).collect::<Result<Vec<_>, _>>()?.concat())
}
