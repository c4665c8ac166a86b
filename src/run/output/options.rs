//! What is written of a recording, and how.

/// How to annotate.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// What to write.
    pub form: Form,
    /// Replace an output that exists.
    pub force: bool,
    /// Write a result even if no topic is an IMU.
    pub allow_no_imu: bool,
    /// Also read the chunks that hold nothing of use.
    pub verify: bool,
    /// Wait until the output is on the device.
    pub sync: bool,
}

/// What to write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// The recording with its annotations, as a new file.
    #[default]
    Annotated,
    /// The same, in the place of the recording itself, which must have been opened for
    /// [`Access::Change`](super::in_place::Access::Change). Always synced.
    InPlace,
    /// The annotations alone.
    Sidecar,
}
