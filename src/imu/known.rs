//! Types whose vectors are known by name, and names by which the vectors of other types are recognised.

use super::path::FieldPath;

/// Where a well-known type has its vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    pub(super) accel: Option<&'static str>,
    pub(super) gyro: Option<&'static str>,
    /// Whether its topics are IMUs even if the configuration does not mention them.
    pub(super) imu: bool,
}

/// What is known of a type, named `package/Type`.
pub(super) fn known(name: &str) -> Option<Known> {
    let imu = |accel, gyro| Known { accel: Some(accel), gyro: Some(gyro), imu: true };
    let mapped = |accel, gyro| Known { accel, gyro, imu: false };
    Some(match name {
        "sensor_msgs/Imu" => imu("linear_acceleration", "angular_velocity"),
        "px4_msgs/SensorCombined" => imu("accelerometer_m_s2", "gyro_rad"),
        "geometry_msgs/Vector3" => mapped(Some(""), Some("")),
        "geometry_msgs/Vector3Stamped" => mapped(Some("vector"), Some("vector")),
        "geometry_msgs/Accel" => mapped(Some("linear"), None),
        "geometry_msgs/AccelStamped" => mapped(Some("accel.linear"), None),
        "geometry_msgs/AccelWithCovarianceStamped" => mapped(Some("accel.accel.linear"), None),
        "geometry_msgs/Twist" => mapped(None, Some("angular")),
        "geometry_msgs/TwistStamped" => mapped(None, Some("twist.angular")),
        _ => return None,
    })
}

/// The lines that would map the vectors of a topic, if their names tell what they are.
pub(super) fn suggestion(topic: &str, vectors: &[FieldPath]) -> Option<String> {
    let find = |recognise: fn(&str) -> bool| vectors.iter().find(|path| recognise(&path.name().to_lowercase()));
    if let Some(accel) = find(is_accel) {
        let accel = line("accel", accel, "g", is_in_g);
        let gyro = find(is_gyro).map(|gyro| line("gyro", gyro, "deg/s", is_in_degrees)).unwrap_or_default();
        return Some(format!("[[imu]]\ntopic = {topic:?}\n{accel}{gyro}"));
    }
    let [_] = vectors else { return None };
    let name = topic.trim_matches('/').split('/').next().filter(|name| !name.is_empty())?;
    is_accel(&topic.to_lowercase()).then(|| format!("[[imu.secondary]]\nname = {name:?}\ntopic = {topic:?}\n"))
}

fn line(key: &str, path: &FieldPath, unit: &str, has_unit: fn(&str) -> bool) -> String {
    let path = path.to_string();
    match has_unit(&path.to_lowercase()) {
        true => format!("{key} = {{ path = {path:?}, unit = {unit:?} }}\n"),
        false => format!("{key} = {path:?}\n"),
    }
}

fn is_accel(name: &str) -> bool {
    (name.contains("acc") || name.contains("specific_force")) && !name.contains("angular") && !name.contains("cov")
}

fn is_gyro(name: &str) -> bool {
    let words = ["gyr", "angular_vel", "angular_rate", "angularvel", "omega"];
    words.iter().any(|word| name.contains(word)) && !name.contains("cov")
}

fn is_in_g(name: &str) -> bool {
    name.ends_with("_g") || name.ends_with("_gs")
}

fn is_in_degrees(name: &str) -> bool {
    name.contains("dps") || name.contains("deg")
}
