//! Scenarios from TOML. `validate` checks their values.

use super::builtin::BUILTIN;
use super::validate::validate;
use super::{Error, Scenario};
use crate::config::plainly;

impl Scenario {
    /// Parses a scenario from TOML text.
    ///
    /// # Errors
    /// If the text is not TOML or not a scenario, with its line; if a value cannot be simulated, with its key.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let scenario = toml::from_str(text).map_err(|error| malformed(&error, Some(text)))?;
        validate(&scenario)?;
        Ok(scenario)
    }

    /// Converts a table to a scenario, for instance a parsed text with overrides merged in.
    ///
    /// # Errors
    /// As [`parse`](Self::parse), with the key instead of the line.
    pub fn from_table(table: toml::Table) -> Result<Self, Error> {
        let scenario = table.try_into().map_err(|error| malformed(&error, None))?;
        validate(&scenario)?;
        Ok(scenario)
    }

    /// Built-in scenario of this name.
    ///
    /// # Errors
    /// If there is none; the error lists the existing ones.
    pub fn builtin(name: &str) -> Result<Self, Error> {
        let (_, text) =
            BUILTIN.iter().find(|(known, _)| *known == name).ok_or_else(|| Error::Unknown(name.to_owned()))?;
        Self::parse(text)
    }
}

fn malformed(error: &toml::de::Error, text: Option<&str>) -> Error {
    let before = text.zip(error.span()).and_then(|(text, span)| text.get(..span.start));
    let line = before.map(|before| before.matches('\n').count() + 1);
    // Without the text, the error shows the key, after its message and in backticks.
    let mut bare = error.clone();
    bare.set_input(None);
    let bare = bare.to_string();
    let key = bare.strip_prefix(error.message()).and_then(|key| key.split('`').nth(1)).map(str::to_owned);
    let example =
        if error.message().ends_with("expected struct Fault") { r#"; for example {flipped = ["z"]}"# } else { "" };
    Error::Scenario { line, key, problem: format!("{}{example}", plainly(error.message())) }
}
