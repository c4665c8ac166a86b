//! Findings of a recording, IMU by IMU: the last state of all annotations. They are the same whether the annotations
//! were just learned or read back.

use std::collections::{BTreeMap, BTreeSet};

use crate::engine::{Event, Message};
use crate::messages::segment::Reason;
use crate::messages::triad::Status;
use crate::messages::{Calibration, Combination, Coverage, Noise, Segment, Triad, Turn};

use super::{NearMiss, NearMisses, Weight, calibration, vector, weight};

/// Findings of one IMU.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Prefix of its annotation topics.
    pub name: String,
    /// Key of the sensor among others of this name, if it was merged from several recordings.
    pub key: Option<String>,
    /// Topic of its accelerometer.
    pub topic: String,
    /// Type of the messages on it; empty if unknown, for example beside a sidecar.
    pub source_type: String,
    /// Stamp of the first reading in nanoseconds, if it is known.
    pub first: Option<i64>,
    /// The rests by their start in nanoseconds, each with its last verdict.
    pub rests: BTreeMap<i64, Segment>,
    /// The turns between them by their start in nanoseconds, each with its last verdict.
    pub turns: BTreeMap<i64, Turn>,
    /// Sums of the noise at rest.
    pub noise: Option<Noise>,
    /// The faces seen, and the next step.
    pub coverage: Option<Coverage>,
    /// The calibration, if one was published.
    pub calibration: Option<Calibration>,
    /// Spans that were nearly rests.
    pub near_misses: NearMisses,
}

impl Findings {
    /// Empty findings.
    pub fn new(name: &str, topic: &str) -> Self {
        Self { name: name.to_owned(), topic: topic.to_owned(), ..Self::default() }
    }

    /// Stamp that times are told from, in nanoseconds: that of the first reading.
    pub fn origin(&self) -> i64 {
        let rest = self.rests.keys().next().copied();
        self.first.or(rest).or(self.near_misses.iter().next().map(|miss| miss.start)).unwrap_or_default()
    }

    /// Takes an event; later ones replace earlier ones.
    pub fn note(&mut self, event: &Event) {
        match &event.message {
            Message::Segment(segment) => {
                self.rests.insert(super::nanos(&segment.start), segment.clone());
            }
            Message::Turn(turn) => {
                self.turns.insert(super::nanos(&turn.start), turn.clone());
            }
            Message::Noise(noise) => self.noise = Some(noise.clone()),
            Message::Coverage(coverage) => self.coverage = Some(coverage.clone()),
            Message::Calibration(calibration) => self.calibration = Some((**calibration).clone()),
            Message::Stillness(stillness) => {
                let stamp = stillness.header.as_ref().map(|header| super::nanos(&header.stamp));
                self.first = self.first.or(stamp);
                self.near_misses.note(stillness);
            }
            Message::Log(_) => {}
        }
    }

    /// Number of rests that entered the fit.
    pub fn accepted(&self) -> usize {
        self.rests.values().filter(|rest| rest.accepted).count()
    }

    /// Number of placements in the fit that lie on no face, but between them.
    pub fn between_faces(&self) -> usize {
        let count = |is_one: &dyn Fn(&Segment) -> bool| {
            let accepted = self.rests.values().filter(|rest| rest.accepted && is_one(rest));
            accepted.map(|rest| rest.placement).collect::<BTreeSet<_>>().len()
        };
        // The faces count the rests that are kept, which are not all of a long recording.
        let limit = crate::fit::Config::default().max_tilt_deg;
        let tilted = count(&|rest| rest.tilt_deg.is_some_and(|tilt| tilt > limit));
        let faces = self.coverage.iter().flat_map(|coverage| &coverage.faces);
        let on_faces: usize = faces.map(|face| face.placements as usize).sum();
        if self.coverage.is_some() { count(&|_| true).saturating_sub(on_faces).min(tilted) } else { 0 }
    }

    /// Rests that did not enter the fit, in time order.
    pub fn rejected(&self) -> impl Iterator<Item = &Segment> {
        self.rests.values().filter(|rest| !rest.accepted)
    }

    /// Face that was up while it was nearly at rest, as far as the bias is known; `None` off every face, or without readings.
    pub fn face_of(&self, miss: &NearMiss) -> Option<&str> {
        /// Largest angle to the normal of a face, degrees: beyond that it stood on an edge.
        const NEAR: f64 = 30.0;
        let accelerometer = self.calibration.as_ref().and_then(|found| found.accelerometer.as_ref());
        let (force, ..) = self.near_misses.told(miss)?;
        let up =
            accelerometer.and_then(calibration).map_or(force, |known| known.correct(&force)).try_normalize(1e-9)?;
        let faces = self.coverage.iter().flat_map(|coverage| &coverage.faces);
        let near = faces.filter_map(|face| Some((vector(face.normal.as_ref()?).dot(&up), face)));
        let (cosine, face) = near.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
        (cosine > NEAR.to_radians().cos()).then_some(face.name.as_str())
    }

    /// Sensor that kept a near miss from being a rest: the one that was the louder, compared with its rests; `None` without
    /// readings or rests.
    pub fn sensor_of(&self, miss: &NearMiss) -> Option<&'static str> {
        let usual = |sensor: &str| {
            let means = self.rests.values().flat_map(|rest| &rest.means).filter(|mean| mean.sensor == sensor);
            let mut all: Vec<_> = means.filter_map(|mean| Some(vector(mean.std.as_ref()?).norm())).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().filter(|usual| *usual > 0.0)
        };
        let (_, force, rate) = self.near_misses.told(miss)?;
        let (force, rate) = (force / usual("accelerometer")?, rate? / usual("gyroscope")?);
        Some(if force > rate { "accelerometer" } else { "gyroscope" })
    }

    /// Whether a rest that was rejected still counts for what is known of the accelerometer in part: one off every face, where
    /// no accurate fixture is asked for.
    pub fn is_used_in_part(&self, rest: &Segment) -> bool {
        let accelerometer = self.calibration.as_ref().and_then(|found| found.accelerometer.as_ref());
        let known = accelerometer.map_or(&[][..], |triad| &triad.combinations);
        // S beside its diagonal is asked for by models of accurate fixtures alone.
        let beside =
            |known: &Combination| (3..12).any(|i| i % 4 != 3 && known.coefficients.get(i).is_some_and(|c| *c != 0.0));
        rest.reason() == Reason::Tilted && !known.is_empty() && !known.iter().any(beside)
    }

    /// Whether the accelerometer was calibrated.
    pub fn is_calibrated(&self) -> bool {
        let accelerometer = self.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
        accelerometer.is_some_and(|triad| triad.status() != Status::Undetermined)
    }

    /// Every triad of the calibration, the accelerometer first.
    pub fn triads(&self) -> impl Iterator<Item = &Triad> {
        let found = self.calibration.iter();
        found.flat_map(|found| found.accelerometer.iter().chain(&found.gyroscope).chain(&found.secondary))
    }

    /// Whether nothing is left to do: all calibrated triads are confirmed, and no note speaks against them.
    pub fn is_done(&self) -> bool {
        let is_good = |triad: &Triad| triad.status() == Status::Confirmed && serious(triad).is_none();
        self.is_calibrated() && self.triads().all(is_good)
    }

    /// The next step. Notes against the calibration, and unconfirmed triads, take precedence over being done.
    pub fn next_step(&self) -> String {
        let said = self.coverage.as_ref().map(|coverage| coverage.next_step.as_str()).filter(|step| !step.is_empty());
        let said = said.unwrap_or("record the sensor at rest, each face up in turn");
        if self.is_done() || !said.starts_with("done") {
            return said.to_owned();
        }
        if let Some(note) = self.triads().find_map(serious) {
            return note.to_owned();
        }
        let open: Vec<_> = self.triads().filter(|triad| triad.status() != Status::Confirmed).collect();
        let names: Vec<_> = open.iter().map(|triad| format!("the {}", triad.sensor)).collect();
        let why = open.iter().find_map(|triad| triad.notes.iter().find(|note| weight(note) != Weight::Detail));
        let why = why.map_or_else(|| "let it rest a few times more, for some seconds each".to_owned(), Clone::clone);
        format!("{} is not confirmed yet: {why}", names.join(" and "))
    }

    /// Root mean square of ‖a‖ − g over the accepted rests, of readings and of corrected readings, m/s²; accelerometer
    /// only.
    pub fn residuals(&self) -> Option<[f64; 2]> {
        let found = self.calibration.as_ref()?;
        let known = calibration(found.accelerometer.as_ref()?)?;
        let (mut squares, mut count) = ([0.0; 2], 0.0);
        for rest in self.rests.values().filter(|rest| rest.accepted) {
            let mean =
                rest.means.iter().find(|mean| mean.sensor == "accelerometer").and_then(|mean| mean.mean.as_ref());
            let Some(mean) = mean.map(vector) else { continue };
            let off = [mean.norm(), known.correct(&mean).norm()].map(|length| length - found.gravity);
            squares = [0, 1].map(|i| squares[i] + off[i] * off[i]);
            count += 1.0;
        }
        (count > 0.0).then(|| squares.map(|sum| f64::sqrt(sum / count)))
    }

    /// Reason why the accelerometer was not calibrated, if it was not.
    pub fn reason(&self) -> Option<&str> {
        if self.is_calibrated() {
            return None;
        }
        let accelerometer = self.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
        let note = accelerometer.and_then(|triad| triad.notes.first()).map(String::as_str);
        note.or_else(|| self.coverage.as_ref().map(|coverage| coverage.next_step.as_str()))
            .or(Some("no rest was found"))
    }
}

/// The first note that speaks against a triad.
fn serious(triad: &Triad) -> Option<&str> {
    triad.notes.iter().map(String::as_str).find(|note| weight(note) == Weight::Serious)
}
