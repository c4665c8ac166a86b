//! Readings as messages, in each of the encodings, with their schemas. Their topics are left to `write`.

mod ros;
mod vendor;

use nalgebra::Vector3;

use super::Encoding;
use crate::Stamp;

/// Stamp and frame of a message.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header<'a> {
    /// Number of the message on its topic, for ROS 1.
    pub sequence: u32,
    pub stamp: Stamp,
    pub frame_id: &'a str,
}

/// Content of a message.
#[derive(Clone, Copy, Debug)]
pub(super) enum Body {
    /// Message of an IMU: specific force and angular rate, one of which may be measured elsewhere, and temperature, °C.
    Imu { accel: Option<Vector3<f64>>, gyro: Option<Vector3<f64>>, celsius: Option<f64> },
    /// Message of a secondary accelerometer.
    Vector(Vector3<f64>),
    /// Message of a thermometer, °C.
    Temperature(f64),
}

/// Schema of a message.
#[derive(Clone, Debug)]
pub(super) struct Schema {
    pub name: &'static str,
    pub encoding: &'static str,
    pub data: Vec<u8>,
}

/// Type of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    Imu,
    /// IMU with a temperature.
    WarmImu,
    Vector,
    Temperature,
}

impl Encoding {
    /// Profile of recordings in this encoding.
    pub(super) fn profile(self) -> &'static str {
        match self {
            Self::Ros2 => "ros2",
            Self::Ros1 => "ros1",
            Self::Protobuf | Self::Json => "",
        }
    }

    /// Message encoding in channel records.
    pub(super) fn message_encoding(self) -> &'static str {
        match self {
            Self::Ros2 => "cdr",
            Self::Ros1 => "ros1",
            Self::Protobuf => "protobuf",
            Self::Json => "json",
        }
    }

    pub(super) fn schema(self, of: Type) -> Schema {
        match self {
            Self::Ros2 => ros::ros2_schema(of),
            Self::Ros1 => ros::ros1_schema(of),
            Self::Protobuf => vendor::protobuf_schema(of),
            Self::Json => vendor::json_schema(of),
        }
    }

    pub(super) fn encode(self, header: Header<'_>, body: Body) -> Vec<u8> {
        match self {
            Self::Ros2 => ros::ros2(header, body),
            Self::Ros1 => ros::ros1(header, body),
            Self::Protobuf => vendor::protobuf(header, body),
            Self::Json => vendor::json(header, body),
        }
    }
}
