//! Types of messages, and their schemas.

/// Schema of a message.
#[derive(Clone, Debug)]
pub(in crate::simulate) struct Schema {
    pub name: &'static str,
    pub encoding: &'static str,
    pub data: Vec<u8>,
}

/// Type of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::simulate) enum Type {
    Imu,
    /// IMU with a temperature.
    WarmImu,
    Vector,
    Temperature,
}
