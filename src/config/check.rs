//! Validation beyond types: ranges, and keys that must agree with each other.

use std::collections::BTreeSet;

use super::{Config, Limits};
use crate::{fit, imu, still, topic};

/// An invalid value.
pub(super) struct Fault {
    pub(super) key: String,
    pub(super) why: String,
}

impl Config {
    /// Checks all values; the error is the first invalid one.
    pub(super) fn check(&self) -> Result<(), Fault> {
        imus(&self.imu)?;
        rests(&self.still)?;
        if self.fit.model == fit::Model::Full && self.imu.iter().all(|imu| imu.reference.is_none()) {
            return fault(
                "fit.model",
                "`full` needs a reference: name its topic in [imu.reference] of an [[imu]] table",
            );
        }
        limits(&self.limits)?;
        fit(&self.fit)
    }
}

fn limits(limits: &Limits) -> Result<(), Fault> {
    let Limits { chunk_mib, ratio, record_mib, definition_mib, definitions_mib, attachments_mib, channels, .. } =
        *limits;
    let Limits { viewers, viewer_kib, viewer_rate, .. } = *limits;
    for (key, value, most) in [
        ("chunk_mib", chunk_mib, 1024),
        ("ratio", ratio, 1 << 32),
        ("record_mib", record_mib, 1024),
        ("definition_mib", definition_mib, 1024),
        ("definitions_mib", definitions_mib, 1024),
        ("attachments_mib", attachments_mib, 1024),
        ("channels", channels, 1 << 16),
        ("viewers", viewers as u64, 10_000),
        ("viewer_kib", viewer_kib as u64, 1 << 20),
        ("viewer_rate", viewer_rate.into(), 1_000_000),
    ] {
        if !(1..=most).contains(&value) {
            return fault(&format!("limits.{key}"), format!("must lie between 1 and {most}, is {value}"));
        }
    }
    Ok(())
}

fn imus(imus: &[imu::ImuConfig]) -> Result<(), Fault> {
    let mut names = BTreeSet::new();
    for (i, imu) in imus.iter().enumerate() {
        let key = format!("imu.{i}.{}", if imu.name.is_some() { "name" } else { "topic" });
        topic(&format!("imu.{i}.topic"), &imu.topic)?;
        let name = imu.name.as_ref().unwrap_or(&imu.topic);
        if name.is_empty() {
            return fault(&key, "must not be empty");
        }
        if !names.insert(name.trim_start_matches('/')) {
            return fault(&key, format!("two IMUs are called {name}; give one of them another `name`"));
        }
        if let Some(name) = imu.temperature.as_ref().and_then(|temperature| temperature.topic.as_ref()) {
            topic(&format!("imu.{i}.temperature.topic"), name)?;
        }
        if let Some(reference) = &imu.reference {
            topic(&format!("imu.{i}.reference.topic"), &reference.topic)?;
        }
        secondaries(i, &imu.secondary)?;
    }
    Ok(())
}

fn secondaries(imu: usize, secondaries: &[imu::SecondaryConfig]) -> Result<(), Fault> {
    let mut names = BTreeSet::from(["", "accelerometer", "gyroscope"]);
    for (i, secondary) in secondaries.iter().enumerate() {
        let key = format!("imu.{imu}.secondary.{i}");
        if !names.insert(&secondary.name) {
            return fault(&format!("{key}.name"), format!("`{}` is taken; choose another name", secondary.name));
        }
        if let Some(name) = &secondary.topic {
            topic(&format!("{key}.topic"), name)?;
        }
    }
    Ok(())
}

fn topic(key: &str, name: &str) -> Result<(), Fault> {
    if name.is_empty() {
        return fault(key, "must not be empty");
    }
    if topic::is_annotation(name) {
        return fault(key, format!("topics that contain {} are annotations, not sources", topic::MARK));
    }
    Ok(())
}

fn rests(still: &still::Config) -> Result<(), Fault> {
    let still::Config { window_s, enter, settle_s, leave, min_rest_s, min_fit_s, .. } = *still;
    let still::Config { max_duration_s, gap_s, accel_ceiling, gyro_ceiling, max_creep, max_turn, .. } = *still;
    for (key, value) in [
        ("still.window_s", window_s),
        ("still.enter", enter),
        ("still.settle_s", settle_s),
        ("still.leave", leave),
        ("still.min_rest_s", min_rest_s),
        ("still.min_fit_s", min_fit_s),
        ("still.max_duration_s", max_duration_s),
        ("still.gap_s", gap_s),
        ("still.accel_ceiling", accel_ceiling),
        ("still.gyro_ceiling", gyro_ceiling),
        ("still.max_creep", max_creep),
        ("still.max_turn", max_turn),
    ] {
        positive(key, value)?;
    }
    for (key, seconds, most) in [
        ("still.window_s", window_s, 60.0),
        ("still.settle_s", settle_s, 60.0),
        ("still.min_rest_s", min_rest_s, 3600.0),
        ("still.min_fit_s", min_fit_s, 3600.0),
        ("still.max_duration_s", max_duration_s, 86_400.0),
        ("still.gap_s", gap_s, 3600.0),
    ] {
        not_above(key, seconds, most)?;
    }
    if !(0.0..=10.0).contains(&still.late_s) {
        return fault("still.late_s", format!("{} is not between 0 and 10 seconds", still.late_s));
    }
    not_below("still.leave", leave, "still.enter", enter)?;
    not_below("still.min_fit_s", min_fit_s, "still.min_rest_s", min_rest_s)?;
    not_below("still.max_duration_s", max_duration_s, "still.min_fit_s", min_fit_s)
}

fn fit(fit: &fit::Config) -> Result<(), Fault> {
    gravity(fit.gravity.unwrap_or(9.80665))?;
    place(fit)?;
    positive("fit.placement_std", fit.placement_std)?;
    positive("fit.rate_std", fit.rate_std)?;
    not_above("fit.cross_axis_std", fit.cross_axis_std, 0.2)?;
    positive("fit.cross_axis_std", fit.cross_axis_std)?;
    if !(0.0..=1.0).contains(&fit.nonlinearity) {
        return fault("fit.nonlinearity", format!("{} is not between 0 and 1 m/s²", fit.nonlinearity));
    }
    positive("fit.max_error", fit.max_error)?;
    positive("fit.max_tilt_deg", fit.max_tilt_deg)?;
    not_above("fit.max_tilt_deg", fit.max_tilt_deg, 45.0)?;
    positive("fit.half_life_s", fit.half_life_s.unwrap_or(1.0))?;
    rotations(&fit.rotations)?;
    fit.heading.as_ref().map_or(Ok(()), heading)?;
    fixture(&fit.fixture)?;
    for (name, bound) in fit.bounds.named() {
        (0..3).try_for_each(|axis| bounds(&format!("fit.bounds.{name}"), bound.of(axis)))?;
    }
    Ok(())
}

/// Checks gravity: from the Moon to Jupiter; a value beyond is a slip, or in another unit.
fn gravity(gravity: f64) -> Result<(), Fault> {
    if (1.5..=30.0).contains(&gravity) {
        return Ok(());
    }
    let why = "is no gravity in m/s², which is 9.76 to 9.84 on Earth; leave it out, or give fit.latitude_deg";
    fault("fit.gravity", format!("{gravity} {why}"))
}

fn fixture(fixture: &fit::FixtureConfig) -> Result<(), Fault> {
    let accuracy = fixture.accuracy_deg;
    if !(0.0..=45.0).contains(&accuracy) {
        return fault("fit.fixture.accuracy_deg", format!("must lie between 0 and 45, is {accuracy}"));
    }
    if fixture.mounting_deg.iter().any(|angle| !angle.is_finite()) {
        return fault("fit.fixture.mounting_deg", "must be three finite angles");
    }
    let mut names = BTreeSet::from([""]);
    for (i, face) in fixture.faces.iter().enumerate() {
        let key = format!("fit.fixture.faces.{i}");
        if !names.insert(&face.name) {
            return fault(&format!("{key}.name"), format!("`{}` is taken; choose another name", face.name));
        }
        if face.up.iter().any(|part| !part.is_finite()) || face.up == [0.0; 3] {
            return fault(&format!("{key}.up"), "must be a direction, not zero");
        }
    }
    Ok(())
}

fn rotations(rotations: &[fit::RotationConfig]) -> Result<(), Fault> {
    /// Most degrees of a rotation: a hundred turns.
    const MOST: f64 = 36_000.0;
    for (i, rotation) in rotations.iter().enumerate() {
        let key = |name: &str| format!("fit.rotations.{i}.{name}");
        let &fit::RotationConfig { begin_s, end_s, angle_deg, .. } = rotation;
        if !(begin_s.is_finite() && begin_s >= 0.0) {
            return fault(&key("begin_s"), format!("must not be negative, is {begin_s}"));
        }
        if !(end_s.is_finite() && end_s > begin_s) {
            return fault(&key("end_s"), format!("must come after `begin_s` ({begin_s}), is {end_s}"));
        }
        if !(-MOST..=MOST).contains(&angle_deg) || angle_deg == 0.0 {
            return fault(
                &key("angle_deg"),
                format!("must be an angle up to {MOST} degrees, not zero, is {angle_deg}"),
            );
        }
        let of_another =
            |other: &fit::RotationConfig| other.imu.is_some() && rotation.imu.is_some() && other.imu != rotation.imu;
        let meets =
            |other: &fit::RotationConfig| other.begin_s <= end_s && begin_s <= other.end_s && !of_another(other);
        if let Some(other) = rotations.iter().take(i).position(meets) {
            return fault(&key("begin_s"), format!("the span overlaps that of `fit.rotations.{other}`"));
        }
    }
    Ok(())
}

fn heading(heading: &imu::HeadingConfig) -> Result<(), Fault> {
    topic("fit.heading.topic", &heading.topic)?;
    if heading.path.as_ref().is_some_and(|path| path.to_string().contains('*')) {
        return fault("fit.heading.path", "must lead to one heading, not to each of a list");
    }
    positive("fit.heading.std_deg", heading.std_deg)?;
    not_above("fit.heading.std_deg", heading.std_deg, 20.0)
}

fn place(fit: &fit::Config) -> Result<(), Fault> {
    if let Some(name) = &fit.fix_topic {
        topic("fit.fix_topic", name)?;
    }
    let latitude_deg = fit.latitude_deg.unwrap_or(0.0);
    let at = |height_m| fit::EarthLocation { latitude_deg, height_m };
    if !at(None).is_valid() {
        return fault("fit.latitude_deg", format!("must lie between -90 and 90, is {latitude_deg}"));
    }
    let Some(height) = fit.height_m else { return Ok(()) };
    if fit.latitude_deg.is_none() {
        return fault("fit.height_m", "says nothing without fit.latitude_deg");
    }
    if !at(fit.height_m).is_valid() {
        return fault("fit.height_m", format!("must lie between -12000 and 100000, is {height}"));
    }
    Ok(())
}

fn positive(key: &str, value: f64) -> Result<(), Fault> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { fault(key, format!("must be positive, is {value}")) }
}

fn not_above(key: &str, value: f64, most: f64) -> Result<(), Fault> {
    if value <= most { Ok(()) } else { fault(key, format!("must not exceed {most}, is {value}")) }
}

fn not_below(key: &str, value: f64, other: &str, least: f64) -> Result<(), Fault> {
    if value >= least { Ok(()) } else { fault(key, format!("must not be below `{other}` ({least}), is {value}")) }
}

fn bounds(key: &str, [lower, upper]: [f64; 2]) -> Result<(), Fault> {
    if !lower.is_finite() || !upper.is_finite() {
        return fault(key, "bounds must be finite");
    }
    if lower > upper {
        return fault(key, format!("the lower bound {lower} is above the upper bound {upper}"));
    }
    Ok(())
}

fn fault<T>(key: &str, why: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { key: key.to_owned(), why: why.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_that_no_rest_needs_are_refused() {
        let mut config = Config::default();
        assert!(config.check().is_ok());
        config.still.window_s = 1e9;
        assert_eq!(config.check().map_err(|fault| fault.key), Err("still.window_s".to_owned()));
    }
}
