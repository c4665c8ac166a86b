//! Mark on a result in a store: what it was made of, so that one request tells finished work.

use crate::config::Config;

/// Sources of a result, and what its exit code depends on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ResultMark {
    /// Fingerprint of the version and configuration.
    pub(crate) settings: String,
    /// Length of the recording and, of an object, its version; empty where it is not known.
    pub(crate) input: String,
    /// Number of damaged places in the recording, and whether every IMU of it and of the configuration was calibrated;
    /// `None` on a result that was begun before this was known, as large ones are.
    pub(crate) outcome: Option<(u64, bool)>,
}

impl ResultMark {
    /// Mark of a result that is to be made by a configuration.
    pub(crate) fn of(config: &Config) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        let settings = crc32fast::hash(config.canonical().as_bytes());
        Self { settings: format!("{version}-{settings:08x}"), ..Self::default() }
    }

    /// Mark of a text.
    pub(super) fn of_text(text: &str) -> Self {
        Self { settings: format!("text-{:08x}", crc32fast::hash(text.as_bytes())), ..Self::default() }
    }

    /// Whether another one is of the same settings and, as far as both are known, of the same recording.
    pub(crate) fn is_of(&self, other: &Self) -> bool {
        let same = self.input.is_empty() || other.input.is_empty() || self.input == other.input;
        self.settings == other.settings && same
    }
}

#[cfg(feature = "object-store")]
impl ResultMark {
    /// The mark as the value of one attribute.
    pub(super) fn text(&self) -> String {
        let Self { settings, input, outcome } = self;
        let outcome = outcome.map(|(damages, calibrated)| format!(" damages={damages} calibrated={calibrated}"));
        format!("settings={settings} input={input}{}", outcome.unwrap_or_default())
    }

    /// Reads the value of the attribute.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut mark = Self::default();
        let (mut damages, mut calibrated) = (None, None);
        for part in text.split(' ') {
            match part.split_once('=')? {
                ("settings", value) => value.clone_into(&mut mark.settings),
                ("input", value) => value.clone_into(&mut mark.input),
                ("damages", value) => damages = value.parse().ok(),
                ("calibrated", value) => calibrated = value.parse().ok(),
                _ => {}
            }
        }
        mark.outcome = damages.zip(calibrated);
        (!mark.settings.is_empty()).then_some(mark)
    }
}

#[cfg(test)]
#[cfg(feature = "object-store")]
mod tests {
    use super::*;

    #[test]
    fn a_mark_reads_back_and_tells_other_settings_and_recordings() {
        let mark =
            ResultMark { input: "10:abc".to_owned(), outcome: Some((2, true)), ..ResultMark::of(&Config::default()) };
        assert_eq!(ResultMark::parse(&mark.text()), Some(mark.clone()));
        assert_eq!(ResultMark::parse("of another program"), None);
        assert!(mark.is_of(&ResultMark::of(&Config::default())));
        assert!(!mark.is_of(&ResultMark { input: "11:abd".to_owned(), ..mark.clone() }));
        assert!(!mark.is_of(&ResultMark { settings: "other".to_owned(), ..mark.clone() }));
    }
}
