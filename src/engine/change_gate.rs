//! Change gate: selects what is new among the results of an engine, compared with what was published last.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::rest_history::RestHistory;
use crate::Stamp;
use crate::fit::{Fixture, Parameterisation, Refit};
use crate::messages::triad::{Model, Status};
use crate::messages::{self, Triad};

/// Round of placements since the last published calibration of the accelerometer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// Whether the round is complete, so that another calibration is due.
    is_whole: bool,
    /// End of the last rest.
    end: Option<Stamp>,
}

/// State of the change gate: what was published last.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct ChangeGate {
    #[serde(serialize_with = "encode", deserialize_with = "decode")]
    coverage: Option<messages::Coverage>,
    #[serde(serialize_with = "encode", deserialize_with = "decode")]
    calibration: Option<messages::Calibration>,
    /// End of the last rest in a published calibration of the accelerometer.
    round: Option<Stamp>,
}

impl ChangeGate {
    /// Returns the coverage if it changed.
    pub(super) fn coverage(&mut self, coverage: messages::Coverage) -> Option<messages::Coverage> {
        let same = self.coverage.as_ref().is_some_and(|last| {
            last.faces == coverage.faces && last.complete == coverage.complete && last.next_step == coverage.next_step
        });
        if same {
            return None;
        }
        self.coverage = Some(coverage.clone());
        Some(coverage)
    }

    /// Progress of the round of placements since the last published calibration of the accelerometer.
    pub(super) fn round(&self, history: &RestHistory, fixture: &Fixture, refit: Refit) -> Round {
        let accepted = || history.entries().iter().filter(|entry| entry.verdict.is_accepted());
        let fresh = |face: usize| {
            accepted().any(|entry| entry.verdict.face() == Some(face) && self.round < Some(entry.rest.start))
        };
        let is_whole = refit == Refit::Segment || (0..fixture.faces().len()).all(fresh);
        Round { is_whole, end: accepted().map(|entry| entry.rest.end).max() }
    }

    /// Model of the accelerometer that was published last, if it was determined.
    pub(super) fn model(&self) -> Option<Parameterisation> {
        match self.calibration.as_ref()?.accelerometer.as_ref()?.model() {
            Model::BiasScale => Some(Parameterisation::DIAGONAL),
            Model::Triangular => Some(Parameterisation::TRIANGULAR),
            Model::CrossAxis => Some(Parameterisation::MATRIX),
            Model::Full => Some(Parameterisation::FULL_ACCELEROMETER),
            _ => None,
        }
    }

    /// Returns the calibration with its revision if it is worth publishing: a parameter moved by half a standard
    /// deviation, a standard deviation shrank by a tenth, or a verdict changed; at the end of the recording, also if
    /// more rests entered.
    pub(super) fn calibration(
        &mut self,
        mut calibration: messages::Calibration,
        at_end: bool,
        round: Round,
    ) -> Option<messages::Calibration> {
        if !(at_end || round.is_whole || self.round.is_none()) {
            return None;
        }
        let worth = match &self.calibration {
            None => triads(&calibration).any(|triad| is_determined(triad) || !triad.combinations.is_empty()),
            Some(last) => {
                at_end && last.segments != calibration.segments
                    || triads(last).zip(triads(&calibration)).any(|(last, now)| is_news(last, now))
            }
        };
        if !worth {
            return None;
        }
        calibration.revision = self.calibration.as_ref().map_or(1, |last| last.revision + 1);
        if calibration.accelerometer.as_ref().is_some_and(is_determined) {
            self.round = round.end;
        }
        self.calibration = Some(calibration.clone());
        Some(calibration)
    }
}

fn triads(calibration: &messages::Calibration) -> impl Iterator<Item = &Triad> {
    calibration.accelerometer.iter().chain(&calibration.gyroscope).chain(&calibration.secondary)
}

fn is_determined(triad: &Triad) -> bool {
    triad.status() != Status::Undetermined
}

fn is_news(last: &Triad, now: &Triad) -> bool {
    let order = |triad: &Triad| triad.temperature.as_ref().map(|model| model.order);
    if last.status() != now.status() || last.model() != now.model() || order(last) != order(now) {
        return true;
    }
    // What is known in part is news like a parameter, and if there is more or less of it.
    let sums = |triad: &Triad| triad.combinations.iter().map(|known| known.coefficients.clone()).collect::<Vec<_>>();
    if sums(last) != sums(now) {
        return true;
    }
    let old = parameters_of(last).zip(stds_of(last));
    let new = parameters_of(now).zip(stds_of(now));
    // A parameter that is not estimated has no deviation, and never moves.
    old.zip(new)
        .filter(|((_, was_std), _)| *was_std > 0.0)
        .any(|((was, was_std), (is, is_std))| (is - was).abs() >= 0.5 * was_std || is_std <= 0.9 * was_std)
}

fn parameters_of(triad: &Triad) -> impl Iterator<Item = f64> {
    let coefficients = triad.temperature.iter().flat_map(|model| model.coefficients.clone());
    let known = triad.combinations.iter().map(|known| known.value);
    components(triad.bias.as_ref()).chain(triad.sensitivity.clone()).chain(coefficients).chain(known)
}

fn stds_of(triad: &Triad) -> impl Iterator<Item = f64> {
    let coefficients = triad.temperature.iter().flat_map(|model| model.coefficients_std.clone());
    let known = triad.combinations.iter().map(|known| known.std);
    components(triad.bias_std.as_ref()).chain(triad.sensitivity_std.clone()).chain(coefficients).chain(known)
}

fn components(vector: Option<&messages::Vector3>) -> impl Iterator<Item = f64> {
    vector.map(|v| [v.x, v.y, v.z]).into_iter().flatten()
}

/// Serialises a message as its bytes.
fn encode<M: prost::Message, S: Serializer>(message: &Option<M>, serializer: S) -> Result<S::Ok, S::Error> {
    message.as_ref().map(M::encode_to_vec).serialize(serializer)
}

fn decode<'de, M: prost::Message + Default, D: Deserializer<'de>>(deserializer: D) -> Result<Option<M>, D::Error> {
    let bytes = Option::<Vec<u8>>::deserialize(deserializer)?;
    bytes.map(|bytes| M::decode(bytes.as_slice())).transpose().map_err(serde::de::Error::custom)
}
