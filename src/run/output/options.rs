//! Options of annotating: what is written, and how.

/// Options of annotating.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Form of the result.
    pub form: Form,
    /// Replace an existing output.
    pub force: bool,
    /// Write a result even if no topic is an IMU.
    pub allow_no_imu: bool,
    /// Also read the chunks without useful messages.
    pub verify: bool,
    /// Wait until the output is on the device.
    pub sync: bool,
}

/// Form of the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// The recording with its annotations, as a new file.
    #[default]
    Annotated,
    /// The same, in place of the recording itself, which must have been opened for
    /// [`Access::Change`](super::in_place::Access::Change). Always synced.
    InPlace,
    /// The annotations alone.
    Sidecar,
}
