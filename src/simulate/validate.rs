//! Check that a scenario can be simulated. Each error names the key.

use super::pose::attitude;
use super::{Encoding, Error, Pose, Scenario, Sensitivity, Temperature, Triad, Vibration};

/// Longest session, in seconds: about a hundred days.
const LONGEST_S: f64 = 1e7;

/// Largest magnitude of a value; larger ones would only overflow.
const LARGEST: f64 = 1e9;

/// Refuses the first value that cannot be simulated.
pub(super) fn validate(scenario: &Scenario) -> Result<(), Error> {
    within("gravity", scenario.gravity, 0.0, 1e3)?;
    if let Some(latitude) = scenario.latitude_deg {
        within("latitude_deg", latitude, -90.0, 90.0)?;
    }
    within("tilt_scatter_deg", scenario.tilt_scatter_deg, 0.0, 90.0)?;
    require(scenario.recording.start_s > 0, "recording.start_s", || {
        "viewers take stamp 0 for 1970, start later".into()
    })?;
    within("recording.chunk_bytes", f64::from(scenario.recording.chunk_bytes), 1024.0, 67_108_864.0)?;

    within("recording.copies", f64::from(scenario.recording.copies), 1.0, 9.0)?;

    sensors(scenario)?;
    if let Some(of) = &scenario.temperature {
        temperature(of, scenario.recording.encoding)?;
    }

    let motion = &scenario.motion;
    within("motion.duration_s", motion.duration_s, 0.01, LONGEST_S)?;
    for (key, value) in [
        ("motion.start_s", motion.start_s),
        ("motion.end_s", motion.end_s),
        ("motion.carry_m", motion.carry_m),
        ("motion.lift_m", motion.lift_m),
        ("motion.wobble_deg", motion.wobble_deg),
        ("motion.shake", motion.shake),
        ("motion.shake_hz", motion.shake_hz),
        ("motion.knock", motion.knock),
    ] {
        within(key, value, 0.0, LONGEST_S)?;
    }

    require(!scenario.pose.is_empty(), "pose", || "there must be at least one [[pose]]".into())?;
    for (index, pose) in scenario.pose.iter().enumerate() {
        self::pose(&format!("pose[{index}]"), pose)?;
    }
    for (index, vibration) in scenario.vibration.iter().enumerate() {
        self::vibration(&format!("vibration[{index}]"), vibration)?;
    }
    let rests: f64 = scenario.pose.iter().map(|pose| pose.rest_s + pose.motion_s.unwrap_or(motion.duration_s)).sum();
    within("pose", rests + motion.start_s + motion.end_s, 0.0, LONGEST_S)
}

fn sensors(scenario: &Scenario) -> Result<(), Error> {
    accelerometer("accelerometer", &scenario.accelerometer)?;
    if let Some(gyroscope) = &scenario.gyroscope {
        triad("gyroscope", gyroscope)?;
        let none = "a gyroscope does not feel gravity";
        require(!gyroscope.fault.gravity_removed, "gyroscope.fault.gravity_removed", || none.into())?;
        let absent = "a gyroscope has none; cross-axis sensitivity belongs into sensitivity";
        require(gyroscope.rate_sensitivity.is_none(), "gyroscope.rate_sensitivity", || absent.into())?;
        if gyroscope.topic.is_none() {
            let shared = &scenario.accelerometer;
            let same = gyroscope.rate_hz == shared.rate_hz && gyroscope.phase_s == shared.phase_s;
            require(same, "gyroscope.rate_hz", || {
                "rate and phase must be the accelerometer's, whose messages it shares; or give gyroscope.topic".into()
            })?;
        }
    }
    if let Some(reference) = &scenario.reference {
        reference.triads().iter().try_for_each(|of| triad("reference", of))?;
    }
    for (name, secondary) in &scenario.secondary {
        let key = format!("secondary.{name}");
        accelerometer(&key, secondary)?;
        require(secondary.topic.is_some(), &format!("{key}.topic"), || {
            "a secondary accelerometer needs a topic".into()
        })?;
    }
    let mut topics: Vec<_> = scenario.topics().collect();
    let all = topics.len();
    topics.sort_unstable();
    topics.dedup();
    require(topics.len() == all, "topic", || format!("each sensor needs a topic of its own, there are only {topics:?}"))
}

fn accelerometer(key: &str, accelerometer: &Triad) -> Result<(), Error> {
    triad(key, accelerometer)?;
    let absent = "an accelerometer has none; its sensitivity to rotation is rate_sensitivity";
    require(accelerometer.g_sensitivity.is_none(), &format!("{key}.g_sensitivity"), || absent.into())?;
    require(accelerometer.g2_sensitivity.is_none(), &format!("{key}.g2_sensitivity"), || absent.into())
}

fn triad(key: &str, triad: &Triad) -> Result<(), Error> {
    within(&format!("{key}.rate_hz"), triad.rate_hz, 1e-3, 1e6)?;
    within(&format!("{key}.phase_s"), triad.phase_s, 0.0, LONGEST_S)?;
    within(&format!("{key}.noise_correlation_s"), triad.noise_correlation_s, 0.0, LONGEST_S)?;
    within(&format!("{key}.fault.frozen_from_s"), triad.fault.frozen_from_s, 0.0, LONGEST_S)?;
    bounded(&format!("{key}.fault.factor"), &[triad.fault.factor])?;
    if let Some(constant) = triad.fault.bias_learned_in_s {
        positive(&format!("{key}.fault.bias_learned_in_s"), constant)?;
    }
    if let Some(bandwidth) = triad.bandwidth_hz {
        positive(&format!("{key}.bandwidth_hz"), bandwidth)?;
    }
    if let Some(range) = triad.range {
        positive(&format!("{key}.range"), range)?;
    }
    for (name, value) in [("noise", triad.noise), ("step", triad.step), ("placement_scatter", triad.placement_scatter)]
    {
        within(&format!("{key}.{name}"), value, 0.0, 1e6)?;
    }
    if let Some(topic) = &triad.topic {
        require(topic.starts_with('/'), &format!("{key}.topic"), || format!("{topic:?} does not start with /"))?;
    }
    let sensitivity = match triad.sensitivity {
        Sensitivity::Diagonal(scale) => [scale, [0.0; 3], [0.0; 3]],
        Sensitivity::Matrix(rows) => rows,
    };
    bounded(&format!("{key}.bias"), &triad.bias)?;
    bounded(&format!("{key}.sensitivity"), sensitivity.as_flattened())?;
    bounded(&format!("{key}.bias_drift_per_h"), &triad.bias_drift_per_h)?;
    bounded(&format!("{key}.bias_by_temperature"), triad.bias_by_temperature.as_flattened())?;
    require(triad.bias_by_temperature.len() <= 3, &format!("{key}.bias_by_temperature"), || {
        "a polynomial of at most three degrees".into()
    })?;
    bounded(&format!("{key}.g_sensitivity"), triad.g_sensitivity.unwrap_or_default().as_flattened())?;
    bounded(&format!("{key}.g2_sensitivity"), &triad.g2_sensitivity.unwrap_or_default())?;
    bounded(&format!("{key}.rate_sensitivity"), triad.rate_sensitivity.unwrap_or_default().as_flattened())
}

fn temperature(temperature: &Temperature, encoding: Encoding) -> Result<(), Error> {
    let Temperature { course, reference, topic, rate_hz, noise, step } = temperature;
    require(!course.is_empty(), "temperature.course", || "give at least one point, [seconds, °C]".into())?;
    bounded("temperature.course", course.as_flattened())?;
    let rises = course.windows(2).all(|pair| pair[0][0] < pair[1][0]);
    require(rises, "temperature.course", || "the seconds of its points must increase".into())?;
    bounded("temperature.reference", &[*reference])?;
    within("temperature.rate_hz", *rate_hz, 1e-3, 1e6)?;
    within("temperature.noise", *noise, 0.0, 1e6)?;
    within("temperature.step", *step, 0.0, 1e6)?;
    match topic {
        Some(topic) => {
            require(topic.starts_with('/'), "temperature.topic", || format!("{topic:?} does not start with /"))
        }
        None => require(matches!(encoding, Encoding::Protobuf | Encoding::Json), "temperature.topic", || {
            "sensor_msgs/Imu has no field for a temperature: it needs a topic".into()
        }),
    }
}

fn pose(key: &str, pose: &Pose) -> Result<(), Error> {
    within(&format!("{key}.rest_s"), pose.rest_s, 0.0, LONGEST_S)?;
    if let Some(motion) = pose.motion_s {
        within(&format!("{key}.motion_s"), motion, 0.01, LONGEST_S)?;
    }
    bounded(&format!("{key}.tilt_deg"), &[pose.tilt_deg])?;
    bounded(&format!("{key}.azimuth_deg"), &[pose.azimuth_deg])?;
    bounded(&format!("{key}.heading_deg"), &[pose.heading_deg])?;
    bounded(&format!("{key}.turn_deg_s"), &pose.turn_deg_s)?;
    bounded(&format!("{key}.up"), &pose.up.unwrap_or_default())?;
    bounded(&format!("{key}.attitude"), &pose.attitude.unwrap_or_default())?;
    require(attitude(pose, [0.0; 2]).is_some(), key, || {
        "give exactly one of face (\"+X\", \"-X\", …), up (a direction, not zero) and attitude (a quaternion w, x, y, z)".into()
    })
}

fn vibration(key: &str, vibration: &Vibration) -> Result<(), Error> {
    bounded(&format!("{key}.amplitude"), &vibration.amplitude)?;
    within(&format!("{key}.frequency_hz"), vibration.frequency_hz, 0.0, 1e6)?;
    within(&format!("{key}.modulation"), vibration.modulation, 0.0, 1.0)?;
    within(&format!("{key}.modulation_hz"), vibration.modulation_hz, 0.0, 1e6)?;
    within(&format!("{key}.pause_s"), vibration.pause_s, 0.0, LONGEST_S)?;
    vibration.burst_s.map_or(Ok(()), |burst| positive(&format!("{key}.burst_s"), burst))
}

fn positive(key: &str, value: f64) -> Result<(), Error> {
    require(value.is_finite() && value > 0.0, key, || format!("must be positive, is {value}"))
}

fn within(key: &str, value: f64, least: f64, most: f64) -> Result<(), Error> {
    require((least..=most).contains(&value), key, || format!("must lie between {least} and {most}, is {value}"))
}

fn bounded(key: &str, values: &[f64]) -> Result<(), Error> {
    values.iter().try_for_each(|value| within(key, *value, -LARGEST, LARGEST))
}

fn require(holds: bool, key: &str, problem: impl FnOnce() -> String) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::Value { key: key.to_owned(), problem: problem() }) }
}
