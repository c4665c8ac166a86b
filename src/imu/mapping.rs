//! Channels to IMUs: the topic and vector of each triad of each IMU, and reasons against an assignment.

pub(super) mod assignment;
pub(super) mod axes;
pub(super) mod batch;
pub(super) mod channel_role;
pub(super) mod first_readings;
pub(super) mod heading;
pub(super) mod known_types;
pub(super) mod obstacles;
pub(super) mod paired_topics;
pub(super) mod position;
pub(super) mod refusal;
pub(super) mod registry;
pub(super) mod request;
pub(super) mod route;
pub(super) mod source;
pub(super) mod suggestion;
pub(super) mod thermometer;
pub(super) mod time_source;
