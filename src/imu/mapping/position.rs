//! Position of the recording: the first valid one in it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::imu::decode::Decoder;
use crate::imu::schema::layout::{Layout, Place};
use crate::imu::schema::lookup::PathError;
use crate::imu::schema::path::FieldPath;

/// A position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Position {
    /// Geodetic latitude, degrees north.
    pub latitude_deg: f64,
    /// Height above the ellipsoid, m, if known.
    pub height_m: Option<f64>,
}

/// Search for the first valid position.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct PositionSearch {
    /// Configured topic; if absent, every topic of a known type is used.
    topic: Option<String>,
    /// Channels to search, until a position is found.
    routes: BTreeMap<u16, PositionFields>,
    found: Option<Position>,
}

/// Places of a position's numbers in the messages of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct PositionFields {
    decoder: Decoder,
    /// Latitude and longitude, then the altitude and the status if there are any.
    numbers: Vec<f64>,
    altitude: Option<usize>,
    status: Option<usize>,
}

/// Known types of positions.
const KNOWN: [&str; 3] = ["sensor_msgs/NavSatFix", "foxglove.LocationFix", "foxglove/LocationFix"];

impl PositionSearch {
    pub(in crate::imu) fn new(topic: Option<String>) -> Self {
        Self { topic, ..Self::default() }
    }

    /// Configured topic.
    pub(in crate::imu) fn topic(&self) -> Option<&str> {
        self.topic.as_deref()
    }

    /// Adds a channel. Returns whether it provides positions.
    ///
    /// # Errors
    /// If it is the configured one and has no position.
    pub(in crate::imu) fn channel(&mut self, id: u16, topic: &str, layout: &Layout) -> Result<bool, PathError> {
        let wanted = match &self.topic {
            Some(configured) => configured == topic,
            None => KNOWN.contains(&layout.name()),
        };
        if wanted {
            let route = PositionFields::new(layout)?;
            if self.found.is_none() {
                self.routes.insert(id, route);
            }
        }
        Ok(wanted)
    }

    pub(in crate::imu) fn wants(&self, channel: u16) -> bool {
        self.routes.contains_key(&channel)
    }

    /// Reads a message of a wanted channel. Returns the first valid position.
    pub(in crate::imu) fn message(&mut self, channel: u16, data: &[u8]) -> Option<Position> {
        let fix = self.routes.get_mut(&channel)?.read(data)?;
        self.found = Some(fix);
        self.routes.clear();
        Some(fix)
    }
}

impl PositionFields {
    fn new(layout: &Layout) -> Result<Self, PathError> {
        let path = |names: [&str; 2]| {
            names.iter().filter(|name| !name.is_empty()).fold(FieldPath::default(), |path, name| path.join(name))
        };
        let number = |name| layout.number(&path([name, ""]));
        let mut places: Vec<Place> = vec![number("latitude")?, number("longitude")?];
        let mut optional = |place: Option<Place>| {
            places.push(place?);
            Some(places.len() - 1)
        };
        let altitude = optional(number("altitude").ok());
        let status = optional(layout.number(&path(["status", "status"])).ok());
        let decoder = Decoder::new(layout, &places, None)?;
        Ok(Self { decoder, numbers: vec![0.0; places.len()], altitude, status })
    }

    /// Position of a message, if it is valid: not marked as no fix, on the Earth, and not the (0, 0) of a receiver
    /// without a fix.
    fn read(&mut self, data: &[u8]) -> Option<Position> {
        self.decoder.read(data, &mut self.numbers).ok()?;
        let number = |place: Option<usize>| place.and_then(|place| self.numbers.get(place)).copied();
        let (latitude_deg, longitude_deg) = (number(Some(0))?, number(Some(1))?);
        let has_fix = number(self.status).is_none_or(|status| status >= 0.0);
        let on_earth = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 360.0;
        let found = (latitude_deg, longitude_deg) != (0.0, 0.0);
        let height_m = number(self.altitude).filter(|height| (-12_000.0..=100_000.0).contains(height));
        (has_fix && on_earth && found).then_some(Position { latitude_deg, height_m })
    }
}
