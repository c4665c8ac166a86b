//! Settings of the command line that do not apply: annotations are read as they are.

use std::path::Path;

use stillpoint::config::{Change, Config, Layer};
use stillpoint::run::{self, Made};
use stillpoint::{Error, shell_word};

use super::configuration::layer;
use crate::cli::Configuration;

/// Most keys that are named.
const NAMED: usize = 4;

/// Says which settings are not applied to the annotations of these inputs, each of which was annotated with a
/// configuration, as TOML. `applies` is whether the command follows a setting nevertheless.
pub fn say<'a>(
    typed: &Configuration,
    inputs: impl IntoIterator<Item = (&'a Path, &'a str)>,
    applies: impl Fn(&Change) -> bool,
) -> Result<(), Error> {
    if typed.config.is_none() && typed.set.is_empty() {
        return Ok(());
    }
    let layers = layers(typed)?;
    let mut concerned = inputs.into_iter().filter_map(|(path, stored)| {
        let mut changes = changes(&layers, stored);
        changes.retain(|change| !applies(change));
        (!changes.is_empty()).then_some((path, changes))
    });
    let Some((path, changes)) = concerned.next() else { return Ok(()) };
    let others = match concerned.count() {
        0 => String::new(),
        others => format!(" (and {others} more)"),
    };
    let keys: Vec<_> = changes.iter().map(|change| change.key.as_str()).collect();
    let further = keys.len().saturating_sub(NAMED);
    let named = keys.get(..NAMED).unwrap_or(&keys).join(", ");
    let named = if further > 0 { format!("{named} and {further} more") } else { named };
    let verb = if keys.len() == 1 { "is" } else { "are" };
    tracing::warn!(
        "{}{others}: the annotations are read as they are, and {named} {verb} not applied; to calibrate anew: {}",
        path.display(),
        command(path, typed)
    );
    Ok(())
}

fn layers(typed: &Configuration) -> Result<Vec<Layer>, Error> {
    let file = typed.config.as_deref().map(layer).transpose()?;
    let settings = typed.set.iter().map(|setting| Layer::set(setting).map_err(Error::from));
    file.into_iter().map(Ok).chain(settings).collect()
}

/// What these layers would change in a stored configuration; in the default, where that is of another version.
fn changes(layers: &[Layer], stored: &str) -> Vec<Change> {
    let stored = Layer::file("the annotations", stored);
    let stored = Config::load(std::slice::from_ref(&stored)).ok().map(|config| (config, vec![stored]));
    let (before, below) = stored.unwrap_or_default();
    let all: Vec<_> = below.into_iter().chain(layers.iter().cloned()).collect();
    Config::load(&all).map(|after| after.changes_from(&before)).unwrap_or_default()
}

/// The command that calibrates with these settings.
fn command(path: &Path, typed: &Configuration) -> String {
    let name = path.to_string_lossy();
    let mut words = vec!["stillpoint annotate".to_owned()];
    match run::made(path) {
        // It holds no readings.
        Some(Made::Sidecar) => words.push("RECORDING".to_owned()),
        _ => {
            let output = if path.extension().is_some() { "anew.mcap" } else { "anew" };
            words.extend([shell_word(&name).into_owned(), format!("-o {output}")]);
        }
    }
    words.extend(typed.config.iter().map(|file| format!("-c {}", shell_word(&file.to_string_lossy()))));
    words.extend(typed.set.iter().map(|setting| format!("--set {}", shell_word(setting))));
    words.join(" ")
}
