//! Places of a requested vector in a layout.

use super::known_types::KnownVector;
use super::request::Request;
use super::thermometer::TemperatureError;
use crate::imu::config::VectorPath;
use crate::imu::schema::layout::{Layout, Place};
use crate::imu::schema::lookup::PathError;
use crate::imu::schema::path::FieldPath;

/// Places of the numbers of a request.
pub(in crate::imu) struct Axes<'a> {
    pub(in crate::imu) path: FieldPath,
    pub(in crate::imu) axes: [FieldPath; 3],
    pub(in crate::imu) places: [Place; 3],
    pub(in crate::imu) covariance: Option<Place>,
    /// Further information in the message about the vector.
    pub(in crate::imu) part: Option<&'a KnownVector>,
}

impl<'a> Axes<'a> {
    /// Path beside which its stamp is looked for: the vector, or an axis that is a list.
    pub(in crate::imu) fn place(&self) -> &FieldPath {
        let [x, ..] = &self.axes;
        if x.is_listed() { x } else { &self.path }
    }

    pub(in crate::imu) fn of(layout: &Layout, request: &Request<'a>) -> Result<Self, RouteError> {
        let (path, part) = match (request.path, request.known) {
            (Some(VectorPath::Axes(axes)), _) => {
                let [x, y, z] = axes;
                let places = [layout.number(x)?, layout.number(y)?, layout.number(z)?];
                return Ok(Self { path: x.clone(), axes: axes.clone(), places, covariance: None, part: None });
            }
            (Some(VectorPath::Whole(path)), known) => (path, known.filter(|known| known.vector == *path)),
            (None, Some(known)) => (&known.vector, Some(known)),
            (None, None) => return Err(Self::no_path(layout, request)),
        };
        let axes = layout.axes(path)?;
        let [x, y, z] = &axes;
        let places = [layout.number(x)?, layout.number(y)?, layout.number(z)?];
        let covariance = path.parent().map(|parent| parent.join(&format!("{}_covariance", path.name())).element(0));
        let covariance = covariance.and_then(|path| layout.find_number(&path));
        Ok(Self { path: path.clone(), axes, places, covariance, part })
    }

    fn no_path(layout: &Layout, request: &Request<'_>) -> RouteError {
        let vectors: Vec<_> = layout.vectors().iter().map(FieldPath::called).collect();
        let vectors = match vectors.as_slice() {
            [] => format!("three paths to numbers; {} has no vector", layout.name()),
            vectors => vectors.join(" or "),
        };
        RouteError::NoPath { name: request.name.to_owned(), key: request.key, vectors }
    }
}

/// Reason why a channel cannot serve a request.
#[derive(Debug, thiserror::Error)]
pub(in crate::imu) enum RouteError {
    #[error(transparent)]
    Path(#[from] PathError),
    #[error(transparent)]
    Temperature(#[from] TemperatureError),
    #[error("which field is the {name}? Set `{key}` to {vectors}")]
    NoPath { name: String, key: &'static str, vectors: String },
}
