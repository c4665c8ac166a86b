//! `sensor_msgs/Imu` and `geometry_msgs/Vector3Stamped` of both ROS generations.

use nalgebra::Vector3;

use super::content::{Body, Header};
use super::schema::{Schema, Type};

const RULE: &str = "================================================================================\n";
const IMU: &str = "\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
";
const VECTOR_STAMPED: &str = "\
std_msgs/Header header
geometry_msgs/Vector3 vector
";
const TEMPERATURE: &str = "\
std_msgs/Header header
float64 temperature
float64 variance
";
const QUATERNION: &str = "\
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
";
const VECTOR: &str = "\
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";
const ROS2_HEADER: &str = "\
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
";
const ROS2_TIME: &str = "\
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";
const ROS1_HEADER: &str = "\
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
";

pub(super) fn ros2_schema(of: Type) -> Schema {
    let (name, definition) = match of {
        Type::Imu | Type::WarmImu => {
            ("sensor_msgs/msg/Imu", [IMU, ROS2_HEADER, ROS2_TIME, QUATERNION, VECTOR].join(RULE))
        }
        Type::Vector => {
            ("geometry_msgs/msg/Vector3Stamped", [VECTOR_STAMPED, ROS2_HEADER, ROS2_TIME, VECTOR].join(RULE))
        }
        Type::Temperature => ("sensor_msgs/msg/Temperature", [TEMPERATURE, ROS2_HEADER, ROS2_TIME].join(RULE)),
    };
    Schema { name, encoding: "ros2msg", data: definition.into_bytes() }
}

pub(super) fn ros1_schema(of: Type) -> Schema {
    let (name, definition) = match of {
        Type::Imu | Type::WarmImu => ("sensor_msgs/Imu", [IMU, ROS1_HEADER, QUATERNION, VECTOR].join(RULE)),
        Type::Vector => ("geometry_msgs/Vector3Stamped", [VECTOR_STAMPED, ROS1_HEADER, VECTOR].join(RULE)),
        Type::Temperature => ("sensor_msgs/Temperature", [TEMPERATURE, ROS1_HEADER].join(RULE)),
    };
    Schema { name, encoding: "ros1msg", data: definition.into_bytes() }
}

/// Encodes as XCDR1, little endian: values are aligned to their size, counted after the four-byte encapsulation header.
pub(super) fn ros2(header: Header<'_>, body: Body) -> Vec<u8> {
    let mut out = vec![0, 1, 0, 0];
    time(&mut out, header);
    string(&mut out, header.frame_id, b"\0");
    out.resize(4 + (out.len() - 4).next_multiple_of(8), 0);
    doubles(&mut out, body);
    out
}

/// Encodes for ROS 1, which packs its values without gaps.
pub(super) fn ros1(header: Header<'_>, body: Body) -> Vec<u8> {
    let mut out = header.sequence.to_le_bytes().to_vec();
    time(&mut out, header);
    string(&mut out, header.frame_id, b"");
    doubles(&mut out, body);
    out
}

fn time(out: &mut Vec<u8>, header: Header<'_>) {
    let nanos = header.stamp.nanos();
    // Until 2038, the bytes are the same in both generations: signed seconds in ROS 2, unsigned in ROS 1.
    out.extend((nanos.div_euclid(1_000_000_000) as u32).to_le_bytes());
    out.extend((nanos.rem_euclid(1_000_000_000) as u32).to_le_bytes());
}

fn string(out: &mut Vec<u8>, text: &str, end: &[u8]) {
    out.extend(((text.len() + end.len()) as u32).to_le_bytes());
    out.extend(text.as_bytes());
    out.extend(end);
}

/// Appends everything after the header, which is all doubles.
fn doubles(out: &mut Vec<u8>, body: Body) {
    let mut push = |values: &[f64]| values.iter().for_each(|value| out.extend(value.to_le_bytes()));
    match body {
        Body::Vector(vector) => push(vector.as_slice()),
        Body::Temperature(celsius) => push(&[celsius, 0.0]),
        Body::Imu { accel, gyro, .. } => {
            push(&[0.0, 0.0, 0.0, 1.0]);
            push(&covariance(false));
            for vector in [gyro, accel] {
                push(vector.unwrap_or_else(Vector3::zeros).as_slice());
                push(&covariance(vector.is_some()));
            }
        }
    }
}

/// Covariance matrix, row by row. ROS marks a quantity as not measured by −1 in the first element; all zeros mean
/// "unknown".
fn covariance(measured: bool) -> [f64; 9] {
    let mut covariance = [0.0; 9];
    if !measured {
        covariance[0] = -1.0;
    }
    covariance
}
