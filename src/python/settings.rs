//! The configuration that a call is given: a file, and settings over it.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;
use stillpoint::Error;
use stillpoint::config::{Config, Layer};

use crate::errors::exception;

/// The effective configuration: the file, overlaid with the settings, a mapping of tables or of dotted keys.
pub fn configuration(file: Option<&PathBuf>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Config> {
    let mut layers = Vec::new();
    if let Some(path) = file {
        let text = stillpoint::run::text(path).map_err(Error::io("read the configuration", path));
        let text = text.map_err(|error| exception(&error))?;
        layers.push(Layer::file(&path.display().to_string(), &text));
    }
    if let Some(settings) = settings {
        let text: String = settings.py().import("json")?.call_method1("dumps", (settings,))?.extract()?;
        let value = serde_json::from_str(&text).map_err(|error| PyValueError::new_err(error.to_string()))?;
        lay("", &value, &mut layers).map_err(|error| exception(&error))?;
    }
    Config::load(&layers).map_err(|error| exception(&error.into()))
}

/// Adds a layer for each setting, as `--set` would.
fn lay(key: &str, value: &Value, layers: &mut Vec<Layer>) -> Result<(), Error> {
    if let Value::Object(table) = value {
        let under = |name: &String| if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
        return table.iter().try_for_each(|(name, value)| lay(&under(name), value, layers));
    }
    let value = toml::Value::try_from(value).map_err(|error| Error::Usage(format!("{key}: {error}")))?;
    layers.push(Layer::set(&format!("{key}={value}"))?);
    Ok(())
}
