//! Outcome of the evidence on a sensor: its present calibration, and its history.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector, Vector3};

use super::changes::changes;
use super::evidence::{Evidence, Identity, Merge};
use super::history::{Epoch, History, Point};
use super::past_rest::PastRest;
use super::past_turn::PastTurn;
use super::random_walk::State;
use super::timeline::{self, Course, UNKNOWNS, bias, diagonal};
use crate::Stamp;
use crate::config::Config;
use crate::engine::{self, Motion, Moved, Refitted, Secondary};
use crate::fit::turn_fit::TurnSeen;
use crate::imu::{RateUnit, Sensor};
use crate::report::{Findings, day, nanos};
use crate::still::{AllanSums, Rest};

/// Merged sensor of several recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// Key that distinguishes it.
    pub key: String,
    /// Its present findings.
    pub findings: Findings,
    /// Its history.
    pub history: History,
}

/// Evaluates all evidence, sensor by sensor.
pub fn outcome(merge: &Merge, config: &Config) -> Vec<Merged> {
    merge.sensors.iter().map(|(key, evidence)| Story::of(evidence, config).tell(key)).collect()
}

/// Evidence on one sensor with its evaluation over time.
struct Story<'a> {
    evidence: &'a Evidence,
    identity: Identity,
    engine: engine::Config,
    /// In time order.
    rests: Vec<&'a PastRest>,
    /// Indices of the rests of each visit.
    visits: Vec<Vec<usize>>,
    accelerometer: Course<UNKNOWNS>,
    gyroscope: Course<3>,
}

impl<'a> Story<'a> {
    fn of(evidence: &'a Evidence, config: &Config) -> Self {
        let identity = evidence.identity.as_ref().map(|(_, identity)| identity.clone()).unwrap_or_default();
        let engine = engine_config(&identity, config, evidence.unit_confirmed);
        let rests = evidence.in_time();
        let visits = timeline::visits(&rests);
        let gyroscope = timeline::gyroscope(&rests, &visits, &engine);
        let hints: Vec<_> = gyroscope.jumps.iter().map(|jump| jump.at).collect();
        let accelerometer = timeline::accelerometer(&rests, &visits, &engine, &hints);
        Self { evidence, identity, engine, rests, visits, accelerometer, gyroscope }
    }

    fn tell(&self, key: &str) -> Merged {
        let Identity { name, topic, source_type, .. } = &self.identity;
        let key_of_it = Some(key.to_owned());
        let mut findings = Findings { key: key_of_it, source_type: source_type.clone(), ..Findings::new(name, topic) };
        let jumps = self.accelerometer.jumps.iter().map(|jump| jump.at);
        let bounds: Vec<_> = [0].into_iter().chain(jumps).chain([self.visits.len()]).collect();
        let mut epochs = Vec::new();
        for span in bounds.windows(2).filter(|span| span[0] < span[1]) {
            let (epoch, refitted) = self.epoch(span[0], span[1]);
            // What lies before a change does not count.
            findings.rests = refitted.segments.into_iter().map(|rest| (nanos(&rest.start), rest)).collect();
            findings.coverage = Some(refitted.coverage);
            findings.calibration = refitted.calibration;
            epochs.push(epoch);
        }
        let history = History {
            recordings: self.rests.iter().map(|rest| rest.recording).collect::<BTreeSet<_>>().len(),
            rests: self.rests.len(),
            overlapping: self.overlapping(),
            strays: self.accelerometer.strays.clone(),
            turns: self.evidence.turns.len(),
            is_thinned: self.evidence.rests.is_thinned() || self.evidence.turns.is_thinned(),
            epochs,
            changes: changes(&self.rests, &self.visits, &self.accelerometer, &self.gyroscope),
            curve: self.curve(),
            drifts: [self.accelerometer.drifts, self.gyroscope.drifts],
        };
        Merged { key: key.to_owned(), findings, history }
    }

    /// Number of rests that began before another had ended.
    fn overlapping(&self) -> usize {
        let mut rests: Vec<_> = self.rests.iter().map(|past| (past.rest.start, past.rest.end)).collect();
        rests.sort_unstable();
        let mut ended = None;
        let begins_early = |&(start, end): &(Stamp, Stamp)| {
            let early = ended.is_some_and(|ended| start < ended);
            ended = ended.max(Some(end));
            early
        };
        rests.iter().copied().filter(begins_early).count()
    }

    /// Epoch of the visits `from..until`, with the fit to all of their rests.
    fn epoch(&self, from: usize, until: usize) -> (Epoch, Refitted) {
        let last = until.saturating_sub(1);
        let since = self.gyroscope.jumps.iter().map(|jump| jump.at).filter(|at| (from..until).contains(at)).max();
        let mut placements = BTreeMap::new();
        let mut rests = Vec::new();
        let mut recordings = BTreeSet::new();
        let mut places = BTreeMap::new();
        for (visit, place) in
            (from..until).flat_map(|visit| self.visits.get(visit).into_iter().flatten().map(move |i| (visit, *i)))
        {
            let Some(past) = self.rests.get(place) else { continue };
            let number = placements.len() as u32 + 1;
            let placement = *placements.entry((past.recording, past.rest.placement)).or_insert(number);
            recordings.insert(past.recording);
            let mut rest = Rest { placement, ..past.rest.clone() };
            let secondary = self.engine.secondary.iter().map(|secondary| past.secondary.get(&secondary.name).cloned());
            rest.secondary = secondary.collect();
            // Readings of a gyroscope before its last jump do not count for its present bias.
            if since.is_some_and(|since| visit < since) {
                rest.gyroscope = None;
            }
            self.as_of(last, visit, &mut rest);
            places.insert((past.recording, rest.start), (rests.len(), visit));
            rests.push(rest);
        }
        let (begin, end) = (rests.iter().map(|rest| rest.start).min(), rests.iter().map(|rest| rest.end).max());
        let noise = match (recordings.first(), recordings.last()) {
            (Some(&first), Some(&last)) => self.by_sensor(self.evidence.noise.total(first, last)),
            _ => BTreeMap::new(),
        };
        let turns: Vec<_> = self.turns_between(&places, last);
        let refitted = engine::refit(rests, &turns, noise, &self.motion(last), self.engine.clone());
        let epoch = Epoch {
            begin: begin.unwrap_or_default(),
            end: end.unwrap_or_default(),
            recordings: recordings.len(),
            calibration: refitted.calibration.clone(),
            coverage: refitted.coverage.clone(),
        };
        (epoch, refitted)
    }

    /// Turns between these rests, in time order: by recording and start, the index and the visit of each. The rates are
    /// those that would have been read at another visit.
    fn turns_between(&self, places: &BTreeMap<(i64, Stamp), (usize, usize)>, then: usize) -> Vec<TurnSeen> {
        let mut turns: Vec<_> = self.evidence.turns.iter().collect();
        turns.sort_by_key(|turn| (turn.motion.start, turn.motion.end));
        let seen = |PastTurn { motion, rests }: &PastTurn| {
            let place = |past: &PastRest| places.get(&(past.recording, past.rest.start)).copied();
            let [(from, before), (to, after)] = [place(&rests[0])?, place(&rests[1])?];
            let slower = -(self.faster(then, before) + self.faster(then, after)) / 2.0;
            Some(TurnSeen {
                known: motion.known(),
                rests: [from, to],
                pieces: motion.pieces.iter().map(|piece| piece.without(&slower)).collect(),
                seconds: motion.seconds,
                path: motion.path,
                roughness: motion.roughness,
            })
        };
        turns.into_iter().filter_map(seen).collect()
    }

    /// Rate by which the gyroscope reads more at one visit than at another, rad/s.
    fn faster(&self, then: usize, visit: usize) -> Vector3<f64> {
        let states = &self.gyroscope.states;
        match (states.get(visit), states.get(then)) {
            (Some(now), Some(then)) if self.gyroscope.is_followed => then.mean - now.mean,
            _ => Vector3::zeros(),
        }
    }

    /// Converts a rest into what it would have read at another visit, if the parameters walk.
    fn as_of(&self, then: usize, visit: usize, rest: &mut Rest) {
        if self.accelerometer.is_followed
            && let (Some(now), Some(later)) =
                (self.accelerometer.states.get(visit), self.accelerometer.states.get(then))
        {
            let truth = timeline::calibration(&now.mean).correct(&rest.accelerometer.mean);
            rest.accelerometer.mean = timeline::calibration(&later.mean).measure(&truth);
            // What the bias walked in between is known only so well, and by the pace of its walk at worst.
            let seconds = rest.start.seconds_since(self.time(then).unwrap_or(rest.start)).abs();
            let samples = rest.accelerometer.effective.max(1.0);
            for axis in 0..3 {
                let known = now.covariance[(axis, axis)] + later.covariance[(axis, axis)];
                rest.accelerometer.covariance[(axis, axis)] +=
                    known.min(self.accelerometer.speed[axis] * seconds) * samples;
            }
        }
        if let Some(rate) = &mut rest.gyroscope {
            rate.mean += self.faster(then, visit);
            rate.ends = [rate.mean; 2];
        }
    }

    /// Start of the first rest of a visit.
    fn time(&self, visit: usize) -> Option<Stamp> {
        self.visits.get(visit).and_then(|visit| self.rests.get(*visit.first()?)).map(|rest| rest.rest.start)
    }

    /// State of the walking parameters at a visit.
    fn motion(&self, visit: usize) -> Motion {
        let time = self.time(visit);
        let note = |what: &str, drifts: bool| {
            let how = if drifts { "drifts" } else { "may drift, though it is not plain that it does," };
            format!("{what} {how} from recording to recording: followed to {}", time.map(day).unwrap_or_default())
        };
        let accelerometer = self.accelerometer.states.get(visit).filter(|_| self.accelerometer.is_followed);
        let gyroscope = self.gyroscope.states.get(visit).filter(|_| self.gyroscope.is_followed);
        Motion {
            accelerometer: accelerometer.map(|state| {
                moved(state, self.walked(&self.accelerometer), note("the accelerometer", self.accelerometer.drifts))
            }),
            gyroscope: gyroscope
                .map(|state| moved(state, self.walked(&self.gyroscope), note("the gyroscope", self.gyroscope.drifts))),
        }
    }

    /// What each parameter walks from the first visit to the last, one standard deviation.
    fn walked<const N: usize>(&self, course: &Course<N>) -> DVector<f64> {
        let times = self.time(0).zip(self.time(self.visits.len().saturating_sub(1)));
        let seconds = times.map_or(0.0, |(first, last)| last.seconds_since(first).abs());
        DVector::from_iterator(N, course.speed.iter().map(|speed| (speed * seconds).sqrt()))
    }

    fn curve(&self) -> Vec<Point> {
        let gravity = engine::gravity(&self.engine);
        let doubt = gravity.std / gravity.value;
        let states = self.accelerometer.states.iter().zip(&self.gyroscope.states).zip(&self.visits);
        let point = |((accelerometer, gyroscope), visit): ((&State<UNKNOWNS>, &State<3>), &Vec<usize>)| {
            let first = self.rests.get(*visit.first()?)?;
            let std = accelerometer.covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
            let scale = diagonal(&accelerometer.mean);
            let scale_std = diagonal(&std);
            let warm: Vec<_> = visit.iter().filter_map(|i| self.rests.get(*i)?.temperature).collect();
            Some(Point {
                time: first.rest.start,
                bias: [bias(&accelerometer.mean), bias(&std)],
                scale: [scale, [0, 1, 2].map(|i| libm::hypot(scale_std[i], scale[i] * doubt))],
                gyro_bias: self.has_gyroscope().then(|| {
                    [
                        gyroscope.mean.into(),
                        gyroscope.covariance.diagonal().map(|variance| variance.max(0.0).sqrt()).into(),
                    ]
                }),
                temperature: (!warm.is_empty()).then(|| warm.iter().sum::<f64>() / warm.len() as f64),
            })
        };
        states.filter_map(point).collect()
    }

    fn has_gyroscope(&self) -> bool {
        self.rests.iter().any(|rest| rest.rest.gyroscope.is_some())
    }

    fn by_sensor(&self, noise: BTreeMap<String, AllanSums>) -> BTreeMap<Sensor, AllanSums> {
        let sensor = |name: &str| match name {
            "accelerometer" => Some(Sensor::Accelerometer),
            "gyroscope" => Some(Sensor::Gyroscope),
            name => self.engine.secondary.iter().position(|secondary| secondary.name == name).map(Sensor::Secondary),
        };
        noise.into_iter().filter_map(|(name, sums)| Some((sensor(&name)?, sums))).collect()
    }
}

fn moved<const N: usize>(state: &State<N>, walked: DVector<f64>, note: String) -> Moved {
    Moved {
        walked,
        parameters: DVector::from_column_slice(state.mean.as_slice()),
        covariance: DMatrix::from_fn(N, N, |i, j| state.covariance[(i, j)]),
        note,
    }
}

/// Engine configuration of such a sensor, whose unit of rates may be confirmed.
fn engine_config(identity: &Identity, config: &Config, unit_confirmed: bool) -> engine::Config {
    let named = |imu: &&crate::imu::ImuConfig| imu.topic == identity.topic || imu.name.as_ref() == Some(&identity.name);
    let imu = config.imu.iter().find(named);
    let secondary = identity.secondary.iter().map(|(name, topic)| {
        let known = imu.and_then(|imu| imu.secondary.iter().find(|secondary| secondary.name == *name));
        Secondary {
            name: name.clone(),
            topic: topic.clone(),
            preset: known.and_then(|secondary| secondary.preset),
            model: known.and_then(|secondary| secondary.model).unwrap_or_default(),
        }
    });
    let engine = engine::Config {
        name: identity.name.clone(),
        frame_id: identity.frame_id.clone(),
        accelerometer: identity.topic.clone(),
        gyroscope: identity.gyroscope.clone(),
        secondary: secondary.collect(),
        preset: None,
        // Rests alone do not show it.
        accel_unit: None,
        // Rests and turns are kept in rad/s.
        gyro_unit: unit_confirmed.then_some(RateUnit::RadiansPerSecond),
        reference: false,
        still: config.still.clone(),
        fit: config.fit.clone(),
    };
    match imu.and_then(|imu| imu.preset) {
        Some(preset) => engine.of(preset),
        None => engine,
    }
}
