//! Settings in which one configuration differs from another.

use toml::{Table, Value};

/// One setting in which a configuration differs from another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The dotted key.
    pub key: String,
    /// Its value as TOML on one line.
    pub value: String,
}

impl Change {
    /// The setting as [`Layer::set`](super::Layer::set) takes it.
    pub fn setting(&self) -> String {
        format!("{}={}", self.key, self.value)
    }
}

/// Settings that make one configuration, in its canonical form, out of another one.
pub(super) fn between(of: &str, other: &str) -> Vec<Change> {
    let table = |canonical: &str| canonical.parse::<Table>().unwrap_or_default();
    let mut changes = Vec::new();
    collect("", &table(of), &table(other), &mut changes);
    changes
}

fn collect(above: &str, table: &Table, other: &Table, changes: &mut Vec<Change>) {
    for (name, value) in table {
        let key = if above.is_empty() { name.clone() } else { format!("{above}.{name}") };
        match (value, other.get(name)) {
            (value, Some(same)) if value == same => {}
            (Value::Table(table), Some(Value::Table(other))) => collect(&key, table, other, changes),
            (value, _) => changes.push(Change { key, value: value.to_string() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, Layer};

    #[test]
    fn the_changes_from_the_default_make_the_configuration_again() {
        let sets = [
            "fit.gravity=9.81744",
            "fit.bounds.accel_bias=[[-1, 1], [-2, 2], [-3, 3]]",
            "still.detector=moving-std",
            r#"imu=[{topic="/a'b\"c", accel=["x", "y", "z"], gyro={path="g", unit="deg/s"}, secondary=[{name="high", topic="/h"}]}]"#,
            r#"fit.rotations=[{begin_s=1.5, end_s=4, angle_deg=360}]"#,
        ];
        let load =
            |sets: &[&str]| Config::load(&sets.iter().map(|set| Layer::set(set).unwrap()).collect::<Vec<_>>()).unwrap();
        let config = load(&sets);
        let changes = config.changes_from(&Config::default());
        let keys: Vec<_> = changes.iter().map(|change| change.key.as_str()).collect();
        for key in ["fit.gravity", "fit.bounds.accel_bias", "still.detector", "imu", "fit.rotations"] {
            assert!(keys.contains(&key), "{key} is not in {keys:?}");
        }
        assert_eq!(keys.len(), sets.len(), "{keys:?}");
        let settings: Vec<_> = changes.iter().map(Change::setting).collect();
        assert!(settings.iter().all(|setting| !setting.contains('\n')), "{settings:?}");
        assert_eq!(load(&settings.iter().map(String::as_str).collect::<Vec<_>>()), config);
        assert_eq!(Config::default().changes_from(&Config::default()), []);
        assert_eq!(load(&["limits.viewers=3"]).changes_from(&Config::default()), []);
    }
}
