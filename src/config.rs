//! The configuration of all layers, as one document.
//!
//! Each layer documents its own keys. The [shell](crate::run) reads files.

mod changes;
mod check;
mod error;
mod layer;
mod limits;

pub use changes::Change;
pub use error::Error;
pub use layer::{Layer, overlay, plainly};
pub use limits::Limits;

use serde::{Deserialize, Serialize};

use crate::{annotate, fit, imu, still};

/// Complete configuration; [`Default`] is used without a configuration file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Fields and topics that form an IMU; topics of known types need no entry.
    pub imu: Vec<imu::ImuConfig>,
    /// Detection of rests.
    pub still: still::Config,
    /// Fit of a calibration.
    pub fit: fit::Config,
    /// Output to write.
    pub output: annotate::OutputConfig,
    /// Limits of outside data.
    pub limits: Limits,
}

impl Config {
    /// The default as a document to start from: every key with its unit and meaning.
    pub const COMMENTED: &str = include_str!("config/default.toml");

    /// Loads the configuration from layers, later ones over earlier ones, all over the default.
    ///
    /// # Errors
    ///
    /// The first fault: a syntax error, an unknown key, a wrong type, or an invalid value.
    pub fn load(layers: &[Layer]) -> Result<Self, Error> {
        let mut merged = toml::Table::new();
        for layer in layers {
            // Every table has defaults, so each layer is a complete configuration and its faults are found in it.
            layer.parse::<Self>()?;
            overlay(&mut merged, layer.parse()?);
        }
        let value_error = |key: &str, why| {
            let at = layers.iter().rev().find_map(|layer| layer.locate_key(key));
            Error::Value { at: at.unwrap_or_else(|| "configuration".into()), key: key.to_owned(), why }
        };
        let config = Self::deserialize(merged).map_err(|e| value_error(&layer::key_of(&e), plainly(e.message())))?;
        config.check().map_err(|fault| value_error(&fault.key, fault.why))?;
        Ok(config)
    }

    /// Settings that make this configuration out of another one. Those that only viewers see are left out, and so are keys
    /// that only the other one has: no setting takes a value away.
    pub fn changes_from(&self, other: &Self) -> Vec<Change> {
        changes::between(&self.canonical(), &other.canonical())
    }

    /// The whole configuration in a fixed order, as TOML that [`load`](Self::load) reads back; settings that affect
    /// only viewers have their defaults.
    pub fn canonical(&self) -> String {
        let determining = Self { limits: self.limits.without_viewers(), ..self.clone() };
        toml::to_string(&determining).unwrap_or_else(|e| unreachable!("a configuration is a TOML document: {e}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topic;

    fn file(text: &str) -> Layer {
        Layer::file("a.toml", text)
    }

    fn error(layers: &[Layer]) -> String {
        Config::load(layers).unwrap_err().to_string()
    }

    /// The commented default with the disabled settings (`#key = value`) switched on.
    fn everything() -> String {
        let lines = Config::COMMENTED.lines().map(|line| match line.strip_prefix('#') {
            Some(setting) if !setting.is_empty() && !setting.starts_with(' ') => setting,
            _ => line,
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn the_commented_default_says_the_default_and_nothing_is_left_out() {
        let shown: toml::Table = Config::COMMENTED.parse().unwrap();
        let mut default: toml::Table = toml::from_str(&Config::default().canonical()).unwrap();
        default.remove("imu");
        assert_eq!(shown, default);
        assert_eq!(Config::load(&[file(Config::COMMENTED)]).unwrap(), Config::default());
    }

    #[test]
    fn the_disabled_settings_of_the_commented_default_are_valid_and_complete() {
        let config = Config::load(&[file(&everything())]).unwrap();
        assert_eq!(config.imu.len(), 1);
        let shown: toml::Table = everything().parse().unwrap();
        for (table, text) in [
            ("still", "[still]\nx=1"),
            ("fit", "[fit]\nx=1"),
            ("fit.rotations", "[[fit.rotations]]\nx=1"),
            ("fit.heading", "[fit.heading]\nx=1"),
            ("fit.fixture", "[fit.fixture]\nx=1"),
            ("fit.bounds", "[fit.bounds]\nx=1"),
            ("output", "[output]\nx=1"),
            ("limits", "[limits]\nx=1"),
            ("imu", "[[imu]]\nx=1"),
            ("imu.reference", "[[imu]]\ntopic='t'\n[imu.reference]\nx=1"),
            ("imu.secondary", "[[imu]]\ntopic='t'\n[[imu.secondary]]\nx=1"),
        ] {
            let mut at = &toml::Value::Table(shown.clone());
            for key in table.split('.') {
                at = at.get(key).unwrap();
                at = at.as_array().map_or(at, |list| &list[0]);
            }
            let message = toml::from_str::<Config>(text).unwrap_err().message().to_owned();
            for name in message.split('`').skip(3).step_by(2) {
                assert!(at.get(name).is_some(), "`{table}.{name}` is not in default.toml");
            }
        }
    }

    #[test]
    fn the_canonical_form_reads_back() {
        for config in [Config::default(), Config::load(&[file(&everything())]).unwrap()] {
            assert_eq!(Config::load(&[file(&config.canonical())]).unwrap(), config);
        }
    }

    #[test]
    fn what_only_viewers_see_makes_no_other_configuration() {
        let of = |set: &str| Config::load(&[Layer::set(set).unwrap()]).unwrap().canonical();
        let default = Config::default().canonical();
        assert_eq!(of("limits.viewers=3"), default);
        assert_ne!(of("limits.chunk_mib=3"), default);
    }

    #[test]
    fn settings_go_over_files_and_bare_words_are_strings() {
        let sets = ["still.detector=moving-std", "fit.gravity=9.81744", "imu=[{topic='/imu'}]"];
        let mut layers = vec![file("[still]\ndetector = \"adaptive\"\nmin_fit_s = 2\n")];
        layers.extend(sets.map(|set| Layer::set(set).unwrap()));
        let config = Config::load(&layers).unwrap();
        assert_eq!(config.still.detector, still::Detector::MovingStd);
        assert_eq!((config.still.min_fit_s, config.fit.gravity), (2.0, Some(9.81744)));
        assert_eq!(config.imu[0].topic, "/imu");
        assert_eq!(Layer::set("still").unwrap_err(), Error::Set("still".into()));
        assert!(Layer::set("=1").is_err());
    }

    #[test]
    fn an_unknown_key_is_named_with_its_line_and_the_nearest_valid_one() {
        assert_eq!(
            error(&[file("\n[still]\nwindow = 1\n")]),
            "a.toml:3: `still.window`: no such key `window`; did you mean `window_s`?"
        );
        assert_eq!(
            error(&[Layer::set("stil.window_s=1").unwrap()]),
            "--set stil.window_s=1: `stil`: no such key `stil`; did you mean `still`?"
        );
        assert_eq!(
            error(&[file("[still]\ndetector = 'adaptiv'")]),
            "a.toml:2: `still.detector`: no such choice `adaptiv`; did you mean `adaptive`?"
        );
        let far = error(&[file("[fit.bounds]\nzzz = 1")]);
        assert!(far.contains("`fit.bounds.zzz`") && far.contains("valid: accel_bias, accel_scale"), "{far}");
    }

    #[test]
    fn a_wrong_type_is_named_with_its_line_and_key() {
        assert_eq!(
            error(&[file("[still]\nenter = 3.0\nwindow_s = \"a\"")]),
            "a.toml:3: `still.window_s`: invalid type: string \"a\", expected a number"
        );
        assert_eq!(error(&[file("[[imu]]\nname = 'x'")]), "a.toml:1: `imu`: missing field `topic`");
        assert_eq!(
            error(&[Layer::set("still=x").unwrap()]),
            "--set still=x: `still`: invalid type: string \"x\", expected a table, {key = value, …}"
        );
        assert_eq!(error(&[file("[fit.bounds]\naccel_bias = [1, 2, 3]")]).split(": ").next(), Some("a.toml:2"));
    }

    #[test]
    fn syntax_errors_are_one_line() {
        let text = error(&[file("[still]\nwindow_s = \n")]);
        assert!(text.starts_with("a.toml:2: ") && !text.contains('\n'), "{text}");
    }

    #[test]
    fn values_that_make_no_sense_are_refused_where_they_were_said() {
        for (text, expected) in [
            (
                "[fit.bounds]\naccel_bias = [8, -8]",
                "a.toml:2: `fit.bounds.accel_bias`: the lower bound 8 is above the upper bound -8",
            ),
            ("[still]\nwindow_s = 0", "a.toml:2: `still.window_s`: must be positive, is 0"),
            ("[still]\nwindow_s = nan", "a.toml:2: `still.window_s`: must be positive, is NaN"),
            (
                "[[fit.rotations]]\nbegin_s = 1\nend_s = 4\nangle_deg = 360\n[[fit.rotations]]\nbegin_s = 3\nend_s = 6\nangle_deg = 360",
                "a.toml:6: `fit.rotations.1.begin_s`: the span overlaps that of `fit.rotations.0`",
            ),
            (
                "[[fit.rotations]]\nbegin_s = 1\nend_s = inf\nangle_deg = 360",
                "a.toml:3: `fit.rotations.0.end_s`: must come after `begin_s` (1), is inf",
            ),
            (
                "[[fit.rotations]]\nbegin_s = 1\nend_s = 2\nangle_deg = 0",
                "a.toml:4: `fit.rotations.0.angle_deg`: must be an angle up to 36000 degrees, not zero, is 0",
            ),
            ("[still]\n\nleave = 2", "a.toml:3: `still.leave`: must not be below `still.enter` (3), is 2"),
            (
                "[[imu]]\ntopic='/a'\n[[imu]]\ntopic='/a'",
                "a.toml:4: `imu.1.topic`: two IMUs are called /a; give one of them another `name`",
            ),
            (
                &format!("[[imu]]\ntopic='{}'", topic::of("/a", topic::Kind::Segment)),
                &format!("a.toml:2: `imu.0.topic`: topics that contain {} are annotations, not sources", topic::MARK),
            ),
        ] {
            assert_eq!(error(&[file(text)]), expected);
        }
        assert_eq!(
            error(&[file("[limits]\nratio = 10\nchunk_mib = 5000")]),
            "a.toml:3: `limits.chunk_mib`: must lie between 1 and 1024, is 5000"
        );
        let of = |imu| format!("{{begin_s=1,end_s=4,angle_deg=360,imu='{imu}'}}");
        let apart = Layer::set(&format!("fit.rotations=[{},{}]", of("a"), of("b"))).unwrap();
        assert!(Config::load(&[apart]).is_ok(), "one span, two IMUs");
        let text = error(&[file("[still]\nenter = 4"), Layer::set("still.leave=3.5").unwrap()]);
        assert!(text.starts_with("--set still.leave=3.5: "), "{text}");
    }
}
