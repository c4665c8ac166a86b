//! Evidence of recordings on their sensors, in a form that adds up.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::noise_set::NoiseSet;
use super::past_rest::{PastRest, RestSet};
use super::past_turn::{PastTurn, TurnSet};
use crate::engine::{rest_of, turn_of};
use crate::messages::segment::Reason;
use crate::messages::triad::Status;
use crate::report::Findings;

/// Evidence of any number of recordings on any number of sensors, by a key that distinguishes sensors. With
/// [`join`](Self::join) and the empty one a commutative monoid; joining evidence that is already in it changes nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Merge {
    /// Evidence by key.
    pub sensors: BTreeMap<String, Evidence>,
}

/// Evidence of any number of recordings on one sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    pub(super) rests: RestSet,
    pub(super) turns: TurnSet,
    pub(super) noise: NoiseSet,
    /// Identity in the latest recording, and the start of that recording's first rest, ns.
    pub(super) identity: Option<(i64, Identity)>,
    /// Whether the gyroscope was confirmed in a recording, and with it its unit: by turns that are not kept, perhaps.
    #[serde(default)]
    pub(super) unit_confirmed: bool,
}

/// Names of a sensor in a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Identity {
    /// Prefix of its annotation topics.
    pub name: String,
    /// Topic of its accelerometer.
    pub topic: String,
    /// Topic of its gyroscope.
    pub gyroscope: String,
    /// Frame of its messages.
    pub frame_id: String,
    /// Type of the messages on the topic, if known.
    pub source_type: String,
    /// Topics of its secondary accelerometers, by their names.
    pub secondary: BTreeMap<String, String>,
}

impl Merge {
    /// Evidence of one recording on one sensor.
    pub fn of(key: &str, findings: &Findings) -> Self {
        Self { sensors: BTreeMap::from([(key.to_owned(), Evidence::of(findings))]) }
    }

    /// Adds the evidence of others.
    pub fn join(&mut self, other: Self) {
        for (key, evidence) in other.sensors {
            self.sensors.entry(key).or_default().join(evidence);
        }
    }
}

impl Evidence {
    /// Evidence of one recording.
    pub fn of(findings: &Findings) -> Self {
        let recording = findings.rests.keys().next().copied();
        let at_rest = findings.rests.values().filter(|rest| matches!(rest.reason(), Reason::Accepted | Reason::Tilted));
        let past = at_rest.filter_map(|segment| {
            let temperature = segment.temperature.filter(|temperature| temperature.is_finite());
            let (rest, secondary) = rest_of(segment)?;
            Some(PastRest { recording: recording?, rest, secondary, temperature })
        });
        let past: Vec<_> = past.collect();
        let mut turns = TurnSet::default();
        let followed = findings.turns.values().filter_map(|turn| PastTurn::between(turn_of(turn)?, &past));
        followed.for_each(|turn| turns.insert(turn));
        let mut rests = RestSet::default();
        past.into_iter().for_each(|rest| rests.insert(rest));
        let noise = recording.zip(findings.noise.as_ref());
        let noise = noise.map(|(recording, noise)| NoiseSet::of(recording, noise)).unwrap_or_default();
        let identity = Some((recording.unwrap_or(i64::MIN), Identity::of(findings)));
        let gyroscope = findings.calibration.as_ref().and_then(|calibration| calibration.gyroscope.as_ref());
        let unit_confirmed = gyroscope.is_some_and(|gyroscope| gyroscope.status() == Status::Confirmed);
        Self { rests, turns, noise, identity, unit_confirmed }
    }

    /// Adds the evidence of others on the same sensor.
    pub fn join(&mut self, other: Self) {
        self.rests.join(other.rests);
        self.turns.join(other.turns);
        self.noise.join(other.noise);
        self.identity = self.identity.take().max(other.identity);
        self.unit_confirmed |= other.unit_confirmed;
    }

    /// The rests that are kept.
    pub fn rests(&self) -> &RestSet {
        &self.rests
    }

    /// The turns that are kept.
    pub fn turns(&self) -> &TurnSet {
        &self.turns
    }

    /// The rests that are kept, and those at the ends of the turns that are, ordered by their start.
    pub(super) fn in_time(&self) -> Vec<&PastRest> {
        let key = |past: &PastRest| (past.rest.start, past.rest.end, past.recording);
        let ends = self.turns.iter().flat_map(|turn| &turn.rests).map(|past| (key(past), past));
        // A rest that is kept by itself, too, counts as it is there.
        let all: BTreeMap<_, _> = ends.chain(self.rests.iter().map(|past| (key(past), past))).collect();
        all.into_values().collect()
    }
}

impl Identity {
    /// Identity in a recording.
    pub fn of(findings: &Findings) -> Self {
        let calibration = findings.calibration.as_ref();
        let triads = calibration.map_or(&[][..], |calibration| &calibration.secondary);
        let named = triads.iter().map(|triad| (triad.sensor.clone(), triad.topic.clone()));
        let gyroscope = calibration.and_then(|calibration| calibration.gyroscope.as_ref());
        let mut secondary: BTreeMap<_, _> = named.collect();
        for mean in findings.rests.values().flat_map(|rest| &rest.means) {
            if !matches!(mean.sensor.as_str(), "accelerometer" | "gyroscope") && !secondary.contains_key(&mean.sensor) {
                secondary.insert(mean.sensor.clone(), String::new());
            }
        }
        Self {
            name: findings.name.clone(),
            topic: findings.topic.clone(),
            gyroscope: gyroscope.map(|triad| triad.topic.clone()).unwrap_or_default(),
            frame_id: Self::frame_of(findings).to_owned(),
            source_type: findings.source_type.clone(),
            secondary,
        }
    }

    /// Frame of a recording's messages; empty if unknown.
    pub fn frame_of(findings: &Findings) -> &str {
        let headers = findings.rests.values().filter_map(|rest| rest.header.as_ref());
        let coverage = findings.coverage.iter().filter_map(|coverage| coverage.header.as_ref());
        headers
            .chain(coverage)
            .map(|header| header.frame_id.as_str())
            .find(|frame| !frame.is_empty())
            .unwrap_or_default()
    }
}
