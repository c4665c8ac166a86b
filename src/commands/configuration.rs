//! The configuration that a command works with: the file, overlaid with the settings.

use std::path::Path;

use stillpoint::Error;
use stillpoint::config::{Config, Layer};

use super::files::is_pipe;
use crate::cli::Configuration;

/// Range of gravity on the surface of the Earth, in m/s².
const ON_EARTH: std::ops::RangeInclusive<f64> = 9.76..=9.84;

/// The effective configuration: the file, overlaid with the settings.
pub fn configuration(typed: &Configuration) -> Result<Config, Error> {
    let mut layers = Vec::new();
    if let Some(path) = &typed.config {
        layers.push(layer(path)?);
    }
    for setting in &typed.set {
        layers.push(Layer::set(setting)?);
    }
    let config = Config::load(&layers)?;
    if let Some(gravity) = config.fit.gravity.filter(|gravity| !ON_EARTH.contains(gravity)) {
        tracing::warn!(
            "fit.gravity = {gravity} m/s² is that of no place on Earth (9.76 to 9.84): every scale is wrong by as much if it is a slip"
        );
    }
    Ok(config)
}

/// A configuration file.
pub fn layer(path: &Path) -> Result<Layer, Error> {
    if is_pipe(path) {
        let why = "-: a configuration is read by its name, and again on SIGHUP, not from a pipe; name a file";
        return Err(Error::Usage(why.to_owned()));
    }
    let text = stillpoint::run::text(path);
    // An unreadable configuration is a fault of the command line, not of a recording.
    let unreadable = |source| Error::Io { doing: "read the configuration", path: path.into(), source };
    let text = text.map_err(|e| Error::Usage(unreadable(e).to_string()))?;
    Ok(Layer::file(&path.display().to_string(), &text))
}
