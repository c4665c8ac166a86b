//! Six faces, or spread poses, and the turns between them by hand: the gyroscope's S and what is off the diagonal of the
//! accelerometer's.
//!
//! The bound here is the Cramér–Rao bound of an estimator that knows when the sensor rested, the noise, and how much
//! placements and the bias of the gyroscope scatter, but not how the sensor lay. Its unknowns are bias and
//! lower-triangular S of the accelerometer, bias and S of the gyroscope, and two angles of gravity for each rest. Of each rest
//! it has the mean of both triads; of each turn, where gravity comes to when the true rates are integrated sample by sample.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::Stamp;
use stillpoint::engine::{Config, Engine, Message};
use stillpoint::fit;
use stillpoint::imu::{Sample, Sensor};
use stillpoint::messages::{Calibration, Triad};

use super::hand::{G, Hand, Held};

/// A line of the table.
#[derive(Clone, Copy, Debug)]
pub struct Session {
    pub name: &'static str,
    /// Whether errors are held against the bound: nothing is wrong with the session but noise.
    pub bounded: bool,
    turns: usize,
    spread: bool,
    rate_hz: f64,
    /// Jitter of the stamps, one standard deviation, s.
    jitter: f64,
    /// Share of samples that are lost.
    dropped: f64,
    /// Largest entry of the gyroscope's sensitivity to acceleration, °/s/g.
    g_sensitivity: f64,
    /// Entries off the diagonal of the accelerometer's S, one standard deviation.
    cross_axis: f64,
    /// Rate by which the sensor knocks at the end of a turn, one standard deviation, rad/s.
    knock: f64,
    /// Bandwidth of the filters of both sensors, Hz.
    bandwidth: Option<f64>,
    /// End of the gyroscope's range, °/s.
    range: Option<f64>,
}

const PLAIN: Session = Session {
    name: "",
    bounded: false,
    turns: 24,
    spread: false,
    rate_hz: 100.0,
    jitter: 0.0,
    dropped: 0.0,
    g_sensitivity: 0.0,
    cross_axis: 0.005,
    knock: 0.0,
    bandwidth: None,
    range: None,
};

/// One number beside its truth and what it can be known to.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub error: f64,
    pub std: f64,
    pub bound: f64,
}

impl Seen {
    /// Whether the 95 % interval holds the truth.
    pub fn is_inside(self) -> bool {
        self.error.abs() <= 1.96 * self.std
    }
}

impl Session {
    pub const ALL: &[Self] = &[
        // Fewer than eight turns publish nothing.
        Self { name: "6 turns over six faces", bounded: true, turns: 6, ..PLAIN },
        Self { name: "12 turns over six faces", bounded: true, turns: 12, ..PLAIN },
        Self { name: "24 turns over six faces", bounded: true, ..PLAIN },
        Self { name: "19 turns between spread poses", bounded: true, turns: 19, spread: true, ..PLAIN },
        Self { name: "jitter of 1 ms", jitter: 1e-3, ..PLAIN },
        Self { name: "jitter of 3 ms", jitter: 3e-3, ..PLAIN },
        Self { name: "5 % of samples lost", dropped: 0.05, ..PLAIN },
        Self { name: "0.1 °/s/g", g_sensitivity: 0.1, ..PLAIN },
        Self { name: "cross-axis of 1 %", cross_axis: 0.01, ..PLAIN },
        Self { name: "knocks at the end of turns", knock: 0.1, ..PLAIN },
        Self { name: "25 Hz", rate_hz: 25.0, ..PLAIN },
        Self { name: "50 Hz", rate_hz: 50.0, ..PLAIN },
        Self { name: "400 Hz", rate_hz: 400.0, ..PLAIN },
        Self { name: "1000 Hz", rate_hz: 1000.0, ..PLAIN },
        Self { name: "bandwidth of 20 Hz", bandwidth: Some(20.0), ..PLAIN },
        Self { name: "bandwidth of 100 Hz at 400 Hz", bandwidth: Some(100.0), rate_hz: 400.0, ..PLAIN },
        Self { name: "clipped at 100 °/s", range: Some(100.0), ..PLAIN },
        Self { name: "clipped at 250 °/s", range: Some(250.0), ..PLAIN },
    ];

    /// Entries of the gyroscope's S and those below the diagonal of the accelerometer's; none where they are not published.
    pub fn errors(&self, seed: u64) -> [Option<Vec<Seen>>; 2] {
        let held = self.held(seed);
        let hand = self.moved(Hand::new(held.clone(), seed));
        let ideal = Held {
            accel_noise: 0.0,
            gyro_noise: 0.0,
            gyro_bias: Vector3::zeros(),
            gyro_sensitivity: Matrix3::identity(),
            accel_sensitivity: Matrix3::identity(),
            accel_bias: Vector3::zeros(),
            g_sensitivity: Matrix3::zeros(),
            placement: 0.0,
            ..held
        };
        let bound = self.bounded.then(|| bound(&self.moved(Hand::new(ideal, seed)), &held));
        let calibration = learn(&self.altered(hand, seed), self.range.map(f64::to_radians));
        let of = |triad: Option<&Triad>, truth: &Matrix3<f64>, first: usize, entries: &[(usize, usize)]| {
            let triad = triad.filter(|triad| triad.sensitivity.len() == 9 && triad.sensitivity_std.len() == 9)?;
            let seen = |(k, &(row, column)): (usize, &(usize, usize))| {
                let at = 3 * row + column;
                let std = *triad.sensitivity_std.get(at).filter(|std| **std > 0.0)?;
                let bound = bound.as_ref().map_or(f64::NAN, |bound| bound[first + k].sqrt());
                Some(Seen { error: triad.sensitivity[at] - truth[(row, column)], std, bound })
            };
            entries.iter().enumerate().map(seen).collect()
        };
        let all: Vec<_> = (0..9).map(|at| (at / 3, at % 3)).collect();
        let found = calibration.as_ref();
        [
            of(found.and_then(|found| found.gyroscope.as_ref()), &held.gyro_sensitivity, GYROSCOPE, &all),
            of(found.and_then(|found| found.accelerometer.as_ref()), &held.accel_sensitivity, BELOW, &BELOW_DIAGONAL),
        ]
    }

    fn held(&self, seed: u64) -> Held {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = |std: f64| std * random.sample::<f64, _>(StandardNormal);
        let gyro_sensitivity = Matrix3::from_fn(|row, column| f64::from(u8::from(row == column)) + normal(0.01));
        let accel_sensitivity = Matrix3::from_fn(|row, column| match row.cmp(&column) {
            std::cmp::Ordering::Equal => 1.0 + normal(0.01),
            std::cmp::Ordering::Greater => normal(self.cross_axis),
            std::cmp::Ordering::Less => 0.0,
        });
        let g_sensitivity = Matrix3::from_fn(|_, _| normal(0.6)).map(|entry| entry.clamp(-1.0, 1.0));
        Held {
            rate_hz: self.rate_hz,
            gyro_bias: Vector3::from_fn(|_, _| normal(0.01)),
            accel_bias: Vector3::from_fn(|_, _| normal(0.2)),
            g_sensitivity: g_sensitivity * self.g_sensitivity.to_radians(),
            placement: fit::Config::default().placement_std,
            wobble: 0.1,
            // As dense as in a sensor of 100 Hz.
            accel_noise: 0.02 * (self.rate_hz / 100.0).sqrt(),
            gyro_noise: 0.001 * (self.rate_hz / 100.0).sqrt(),
            gyro_sensitivity,
            accel_sensitivity,
        }
    }

    fn moved(&self, hand: Hand) -> Hand {
        let mut hand = hand.rest(3.0);
        if !self.spread {
            return hand.through_faces(self.turns);
        }
        for _ in 0..self.turns {
            let target = hand.normal().normalize();
            hand = hand.turn_up(target, 1.7).rest(3.0);
        }
        hand
    }

    /// Readings with what happens to them on their way, and with the scatter of the gyroscope's bias that is assumed: in each
    /// turn it is off what the rests say by σ/√2.
    fn altered(&self, hand: Hand, seed: u64) -> Vec<(Sensor, Sample)> {
        let mut random = ChaCha8Rng::seed_from_u64(!seed);
        let mut normal = |std: f64| std * random.sample::<f64, _>(StandardNormal);
        let rests: Vec<usize> = hand.headings.iter().map(|(.., rest)| *rest).collect();
        let mut filtered = [[Vector3::zeros(); 2]; 2];
        let step = 1.0 / self.rate_hz;
        let mut wander = Vector3::zeros();
        let mut kept = Vec::new();
        let mut pairs = hand.samples;
        for (i, pair) in pairs.chunks_exact_mut(2).enumerate() {
            let ahead = rests.get(i + 1).copied().unwrap_or(0);
            if i == 0 || rests[i - 1] != 0 && rests[i] == 0 {
                wander = Vector3::from_fn(|_, _| normal(wander_std()));
            }
            let knock = match rests[i] == 0 && ahead != 0 {
                true => Vector3::from_fn(|_, _| normal(self.knock)),
                false => Vector3::zeros(),
            };
            // No stamp overtakes the next one.
            let jitter = if self.jitter > 0.0 { normal(self.jitter).clamp(-0.4 * step, 0.4 * step) } else { 0.0 };
            let lost = self.dropped > 0.0 && rests[i] == 0 && normal(1.0).abs() < quantile(self.dropped);
            for (which, (sensor, sample)) in pair.iter_mut().enumerate() {
                if *sensor == Sensor::Gyroscope && rests[i] == 0 {
                    sample.value += wander + knock;
                }
                if let Some(bandwidth) = self.bandwidth {
                    let share = 1.0 - (-std::f64::consts::TAU * bandwidth * step).exp();
                    if i == 0 {
                        filtered[which] = [sample.value; 2];
                    }
                    filtered[which][0] += (sample.value - filtered[which][0]) * share;
                    sample.value = filtered[which][0];
                }
                if let Some(range) = self.range.map(f64::to_radians).filter(|_| *sensor == Sensor::Gyroscope) {
                    sample.value = sample.value.map(|axis| axis.clamp(-range, range));
                }
                sample.stamp = Stamp::from_nanos(sample.stamp.nanos() + (jitter * 1e9) as i64);
                if !lost {
                    kept.push((*sensor, *sample));
                }
            }
        }
        kept
    }
}

/// How far the gyroscope's bias is off in a turn, one standard deviation, rad/s.
fn wander_std() -> f64 {
    fit::Config::default().rate_std / 2_f64.sqrt()
}

/// What a standard normal number is nearer to zero than, with this small probability.
fn quantile(share: f64) -> f64 {
    share * (std::f64::consts::PI / 2.0).sqrt()
}

fn learn(samples: &[(Sensor, Sample)], range: Option<f64>) -> Option<Calibration> {
    let fit = fit::Config { gravity: Some(G), ..fit::Config::default() };
    let mut engine = Engine::new(Config { fit, ..Config::default() });
    let mut events = Vec::new();
    let mut calibration = None;
    for (sensor, sample) in samples {
        if range.is_some_and(|range| *sensor == Sensor::Gyroscope && sample.value.amax() >= range) {
            engine.clipped(*sensor, sample.stamp);
        }
        engine.push(*sensor, sample, &mut events);
    }
    engine.finish(&mut events);
    for event in events {
        if let Message::Calibration(news) = event.message {
            calibration = Some(*news);
        }
    }
    calibration
}

/// Unknowns: bias and lower-triangular S of the accelerometer, bias and S of the gyroscope, and two angles a rest.
const ACCELEROMETER: usize = 0;
const BELOW: usize = 6;
const GYROSCOPE_BIAS: usize = 9;
const GYROSCOPE: usize = 12;
const ATTITUDES: usize = 21;
const BELOW_DIAGONAL: [(usize, usize); 3] = [(1, 0), (2, 0), (2, 1)];

/// Variances of the unknowns.
fn bound(ideal: &Hand, held: &Held) -> DVector<f64> {
    let rests = ideal.headings.iter().map(|(.., rest)| *rest).max().unwrap_or(0);
    let unknowns = ATTITUDES + 2 * rests;
    let mut information = DMatrix::<f64>::zeros(unknowns, unknowns);
    let mut add = |jacobian: &DMatrix<f64>, variance: f64| information += jacobian.tr_mul(jacobian) / variance;
    let pairs = || ideal.samples.chunks_exact(2).zip(&ideal.headings);
    let step = 1.0 / held.rate_hz;
    let mut ups = Vec::new();
    for rest in 1..=rests {
        let of_it: Vec<_> = pairs().filter(|(_, (.., of))| *of == rest).map(|(pair, _)| pair).collect();
        let force = of_it[0][1].1.value;
        let mut seen = DMatrix::<f64>::zeros(3, unknowns);
        for axis in 0..3 {
            seen[(axis, ACCELEROMETER + axis)] = 1.0;
            seen[(axis, ACCELEROMETER + 3 + axis)] = force[axis];
        }
        for (k, (row, column)) in BELOW_DIAGONAL.into_iter().enumerate() {
            seen[(row, BELOW + k)] = force[column];
        }
        let across = across(&force);
        for (k, direction) in across.iter().enumerate() {
            seen.column_mut(ATTITUDES + 2 * (rest - 1) + k).copy_from(&(held.accel_sensitivity * direction * G));
        }
        add(&seen, held.accel_noise.powi(2) / of_it.len() as f64 + held.placement.powi(2));
        let mut rates = DMatrix::<f64>::zeros(3, unknowns);
        rates.view_mut((0, GYROSCOPE_BIAS), (3, 3)).fill_with_identity();
        add(&rates, held.gyro_noise.powi(2) / of_it.len() as f64);
        ups.push((force.normalize(), across));
    }
    for (turn, ends) in ups.windows(2).enumerate() {
        let [(before, from), (_, to)] = ends else { continue };
        let last = pairs().rposition(|(_, (.., rest))| *rest == turn + 1).unwrap_or(0);
        let first_after = pairs().position(|(_, (.., rest))| *rest == turn + 2).unwrap_or(0);
        let rates: Vec<Vector3<f64>> =
            pairs().take(first_after + 1).skip(last).map(|(pair, _)| pair[0].1.value).collect();
        let came = |up: &Vector3<f64>, inverse: &Matrix3<f64>, bias: &Vector3<f64>| {
            rates.windows(2).fold(*up, |up, pair| {
                let rate = inverse * ((pair[0] + pair[1]) / 2.0 + bias);
                Rotation3::from_scaled_axis(rate * step).inverse() * up
            })
        };
        let (identity, still) = (Matrix3::identity(), Vector3::zeros());
        let here = came(before, &identity, &still);
        let mut jacobian = DMatrix::<f64>::zeros(2, unknowns);
        let small = 1e-6;
        let mut put = |column: usize, moved: Vector3<f64>| {
            to.iter().enumerate().for_each(|(k, direction)| jacobian[(k, column)] += direction.dot(&moved));
        };
        for at in 0..9 {
            // S moved by an entry: the rates are read as those of its inverse.
            let mut entry = Matrix3::zeros();
            entry[(at / 3, at % 3)] = -small;
            put(GYROSCOPE + at, (came(before, &(identity + entry), &still) - here) / small);
        }
        for axis in 0..3 {
            put(GYROSCOPE_BIAS + axis, (came(before, &identity, &Vector3::ith(axis, -small)) - here) / small);
        }
        for k in 0..2 {
            put(ATTITUDES + 2 * turn + k, came(&from[k], &identity, &still));
            put(ATTITUDES + 2 * (turn + 1) + k, -to[k]);
        }
        let seconds = (rates.len() - 1) as f64 * step;
        add(&jacobian, held.gyro_noise.powi(2) * step * seconds + (wander_std() * seconds).powi(2));
    }
    information.try_inverse().map_or(DVector::zeros(unknowns), |covariance| covariance.diagonal())
}

/// Two unit vectors across a direction.
fn across(up: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
    [first, up.normalize().cross(&first)]
}
