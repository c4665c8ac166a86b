//! Samples, and how message bytes become samples: the schema of a channel is compiled once to a flat plan, which walks
//! its messages without building values.
//!
//! [`Intake`] is the entry point: channels and messages go in, samples come out. It uses three modules: `schema`
//! (schema text to [`Layout`]), `decode` ([`Layout`] to numbers) and `mapping` (channels to IMUs).

mod config;
mod decode;
mod intake;
mod mapping;
mod preset;
mod sample;
mod schema;
mod timing;

pub use config::{
    AccelUnit, AxesConfig, CovarianceUse, HeadingConfig, HeadingUnit, ImuConfig, RateUnit, ReferenceConfig,
    SecondaryConfig, SecondaryModel, TemperatureConfig, TemperatureUnit, VectorConfig, VectorPath,
};
pub use decode::Decoder;
pub use decode::malformed::Malformed;
pub use intake::Intake;
pub use mapping::channel_role::{ChannelRole, VectorUse};
pub use mapping::first_readings::{FirstReadings, Relation};
pub use mapping::heading::Heading;
pub use mapping::obstacles::MissingTopic;
pub use mapping::position::Position;
pub use mapping::refusal::{Cause, Notice, RefusalCount};
pub use mapping::registry::{Imu, Triad};
pub use mapping::suggestion::Suggestion;
pub use mapping::time_source::header_stamp;
pub use preset::{DATASHEETS, Datasheet, Preset, TriadDatasheet};
pub use sample::{ImuId, Quantity, Reading, Sample, Sensor};
pub use schema::layout::{Layout, Place, SchemaError};
pub use schema::lookup::PathError;
pub use schema::path::{FieldPath, PathSyntaxError};
pub use timing::Timing;
