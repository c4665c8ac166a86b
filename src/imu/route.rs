//! How the messages of one channel become readings: compiled once, from the channel's layout and what is asked of it.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::config::VectorPath;
use super::decoder::Decoder;
use super::layout::{Layout, Place};
use super::lookup::PathError;
use super::path::FieldPath;
use super::source::Request;
use super::verdict::{Cause, Counts};
use super::{Malformed, Sensor};
use crate::Stamp;

/// A channel that samples are taken from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Route {
    pub(super) topic: String,
    pub(super) taps: Vec<Tap>,
    pub(super) counts: Counts,
    /// The `frame_id` of the first message.
    pub(super) frame: Option<Vec<u8>>,
    decoder: Decoder,
    clock: Clock,
    /// What the decoder last read: stamp if there is one, then each tap's numbers.
    numbers: Vec<f64>,
}

/// One vector of a message, and whose it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Tap {
    pub(super) source: usize,
    pub(super) sensor: Sensor,
    pub(super) name: String,
    pub(super) path: String,
    pub(super) with_accel: bool,
    pub(super) counts: Counts,
    factor: f64,
    /// Index of its x in the numbers; y and z follow.
    at: usize,
    /// Whether its `covariance[0]` follows z.
    covariance: bool,
}

/// Where the stamps of a channel come from, decided by its first message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Clock {
    Undecided,
    Header,
    LogTime,
}

/// Why a channel cannot serve a request.
#[derive(Debug, thiserror::Error)]
pub(super) enum RouteError {
    #[error(transparent)]
    Path(#[from] PathError),
    #[error("which field is the {name}? Set `{key}` to {vectors}")]
    NoPath { name: String, key: &'static str, vectors: String },
}

impl Route {
    /// Compiles the requests, each with the index of its source.
    pub(super) fn new(topic: &str, layout: &Layout, requests: &[(usize, Request<'_>)]) -> Result<Self, RouteError> {
        let vectors: Vec<_> =
            requests.iter().map(|(_, request)| Axes::of(layout, request)).collect::<Result<_, RouteError>>()?;
        // The header nearest to the accelerometer, which comes last.
        let header = vectors.last().and_then(|axes| Header::nearest(layout, &axes.path));
        let (mut numbers, frame, clock) = match header {
            Some(Header { stamp, frame }) => (stamp.to_vec(), frame, Clock::Undecided),
            None => (Vec::new(), None, Clock::LogTime),
        };
        let mut taps = Vec::new();
        for ((source, request), Axes { path, places, covariance }) in requests.iter().zip(vectors) {
            taps.push(Tap {
                source: *source,
                sensor: request.sensor,
                name: request.name.to_owned(),
                path: path.to_string(),
                with_accel: request.with_accel,
                counts: Counts::default(),
                factor: request.factor,
                at: numbers.len(),
                covariance: covariance.is_some(),
            });
            numbers.extend(places.into_iter().chain(covariance));
        }
        let decoder = Decoder::new(layout, &numbers, frame.as_ref())?;
        let numbers = vec![0.0; numbers.len()];
        Ok(Self { topic: topic.to_owned(), taps, counts: Counts::default(), frame: None, decoder, clock, numbers })
    }

    /// Reads one message: when it was measured, and its `frame_id`.
    pub(super) fn read<'d>(&mut self, log_time: u64, data: &'d [u8]) -> Result<(Stamp, &'d [u8]), Malformed> {
        let frame = self.decoder.read(data, &mut self.numbers)?;
        self.frame.get_or_insert_with(|| frame.to_vec());
        let header = match (self.clock, self.numbers.as_slice()) {
            (Clock::Undecided | Clock::Header, &[seconds, nanos, ..]) => {
                (seconds as i64).saturating_mul(1_000_000_000).saturating_add(nanos as i64)
            }
            _ => 0,
        };
        if self.clock == Clock::Undecided {
            self.clock = if header == 0 { Clock::LogTime } else { Clock::Header };
        }
        let stamp = match self.clock {
            Clock::Header => Stamp::from_nanos(header),
            _ => Stamp::from_log_time(log_time),
        };
        Ok((stamp, frame))
    }

    /// What a tap read from the last message, in m/s² or rad/s.
    pub(super) fn value(&self, tap: &Tap) -> Result<Vector3<f64>, Cause> {
        let numbers = self.numbers.get(tap.at..).unwrap_or_default();
        let Some(&[x, y, z]) = numbers.first_chunk() else { return Err(Cause::Malformed) };
        if tap.covariance && numbers.get(3) == Some(&-1.0) {
            return Err(Cause::NotMeasured);
        }
        let value = Vector3::new(x, y, z) * tap.factor;
        if value.iter().all(|axis| axis.is_finite()) { Ok(value) } else { Err(Cause::NotFinite) }
    }
}

/// Where the numbers of a request stand.
struct Axes {
    path: FieldPath,
    places: [Place; 3],
    covariance: Option<Place>,
}

impl Axes {
    fn of(layout: &Layout, request: &Request<'_>) -> Result<Self, RouteError> {
        let whole = match (request.path, request.known) {
            (Some(VectorPath::Axes([x, y, z])), _) => {
                let places = [layout.number(x)?, layout.number(y)?, layout.number(z)?];
                return Ok(Self { path: x.clone(), places, covariance: None });
            }
            (Some(VectorPath::Whole(path)), _) => path.clone(),
            (None, Some(known)) => {
                known.split('.').filter(|s| !s.is_empty()).fold(FieldPath::default(), |p, s| p.join(s))
            }
            (None, None) => return Err(Self::no_path(layout, request)),
        };
        let places = layout.vector(&whole)?;
        let covariance = whole.parent().map(|parent| parent.join(&format!("{}_covariance", whole.name())).element(0));
        let covariance = covariance.and_then(|path| layout.find_number(&path));
        Ok(Self { path: whole, places, covariance })
    }

    fn no_path(layout: &Layout, request: &Request<'_>) -> RouteError {
        let vectors: Vec<_> = layout.vectors().iter().map(|path| format!("`{path}`")).collect();
        let vectors = match vectors.as_slice() {
            [] => format!("three paths to numbers; {} has no vector", layout.name()),
            vectors => vectors.join(" or "),
        };
        RouteError::NoPath { name: request.name.to_owned(), key: request.key, vectors }
    }
}

/// A `std_msgs/Header`, or what has its fields.
struct Header {
    /// Seconds and nanoseconds.
    stamp: [Place; 2],
    frame: Option<Place>,
}

impl Header {
    /// That of the message that holds the vector, or of the nearest message around it.
    fn nearest(layout: &Layout, vector: &FieldPath) -> Option<Self> {
        let mut around = vector.parent();
        if around.is_none() {
            around = Some(FieldPath::default());
        }
        while let Some(message) = around {
            if let Some(header) = Self::at(layout, &message.join("header")) {
                return Some(header);
            }
            around = message.parent();
        }
        None
    }

    fn at(layout: &Layout, path: &FieldPath) -> Option<Self> {
        let stamp = path.join("stamp");
        let names = [("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec"), ("seconds", "nanos")];
        let places = names.iter().find_map(|(seconds, nanos)| {
            Some([layout.find_number(&stamp.join(seconds))?, layout.find_number(&stamp.join(nanos))?])
        });
        Some(Self { stamp: places?, frame: layout.find_text(&path.join("frame_id")) })
    }
}
