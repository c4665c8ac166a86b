//! Whether CONFIRMED means confirmed: sessions in which something goes wrong that nobody told the program of.
//!
//! Sensors and placements are those of a [`Population`]; on top of that each scenario does to the readings what its name
//! says. A calibration is wrong if any parameter is off by more than 3.29 of its standard deviations, which an honest one
//! is once in a thousand; where the bias moves, off what is true at the end, or when it was last to be seen. A
//! lower-triangular S is held against the true one in the frame of the sensor's own axes.

use std::fmt;

use nalgebra::Vector3;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::Stamp;
use stillpoint::imu::{Preset, Sensor};
use stillpoint::simulate::{Pose, Reading, Scenario, Sensitivity};

use super::population::Population;
use super::trial::{Quantity, Trial};

const FACES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub name: &'static str,
    /// Whether nothing is wrong with it, so that it is to be confirmed.
    pub honest: bool,
    /// Visits of each face; none for spread poses.
    visits: usize,
    /// Scatter of placements over what is assumed.
    scatter: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Plain,
    /// One placement off by 0.1 to 0.3 m/s², bumped so often.
    Bad {
        bumps: usize,
    },
    /// Every placement bumped once.
    Bumped,
    /// Six faces, one bad, then three of the others once more.
    Advised,
    /// Warming by ten kelvin, so many m/s² a kelvin on each axis.
    Warming(f64),
    /// A squared part of the reading, m/s² at 1 g; the preset allows for it.
    Nonlinear(f64),
    /// Entries off the diagonal, one standard deviation.
    CrossAxis(f64),
    /// Noise that remembers itself for so many seconds.
    Correlated(f64),
    Flicker,
    /// One axis steps by so much, m/s², at some time.
    Step(f64),
    /// One axis ramps by so much over the session, m/s².
    Ramp(f64),
    /// All rests turn about the vertical, in °/s.
    Turning(f64),
    /// One pose in a curve, in °/s.
    Curve(f64),
    /// An elevator starts during one rest.
    Elevator,
    /// Stamps that are off by so many seconds, one standard deviation.
    Jitter(f64),
}

const fn row(name: &'static str, honest: bool, visits: usize, scatter: f64, kind: Kind) -> Row {
    Row { name, honest, visits, scatter, kind }
}

impl Row {
    pub const ALL: &[Self] = &[
        row("honest, 1 visit", false, 1, 1.0, Kind::Plain),
        row("honest, 2 visits", true, 2, 1.0, Kind::Plain),
        row("honest, 3 visits", true, 3, 1.0, Kind::Plain),
        row("honest, 4 visits", true, 4, 1.0, Kind::Plain),
        row("honest, spread poses", false, 0, 1.0, Kind::Plain),
        row("scatter 5, 2 visits", true, 2, 0.5, Kind::Plain),
        row("scatter 20, 2 visits", true, 2, 2.0, Kind::Plain),
        row("scatter 20, 3 visits", true, 3, 2.0, Kind::Plain),
        row("scatter 30, 3 visits", false, 3, 3.0, Kind::Plain),
        row("bumped, 1 visit", false, 1, 1.0, Kind::Bumped),
        row("bad and bumped, 2 visits", false, 2, 1.0, Kind::Bad { bumps: 4 }),
        row("bad and bumped, 1 visit", false, 1, 1.0, Kind::Bad { bumps: 4 }),
        row("bad, 1 visit", false, 1, 1.0, Kind::Bad { bumps: 0 }),
        row("bad, 2 visits", false, 2, 1.0, Kind::Bad { bumps: 0 }),
        row("bad, 3 visits", false, 3, 1.0, Kind::Bad { bumps: 0 }),
        row("bad, 4 visits", false, 4, 1.0, Kind::Bad { bumps: 0 }),
        row("bad, spread poses", false, 0, 1.0, Kind::Bad { bumps: 0 }),
        row("bad, three others again", false, 1, 1.0, Kind::Advised),
        row("warming, 1 visit", false, 1, 1.0, Kind::Warming(0.0098)),
        row("warming, 2 visits", false, 2, 1.0, Kind::Warming(0.0098)),
        row("warming, 3 visits", false, 3, 1.0, Kind::Warming(0.0098)),
        row("nonlinear 0.2 %, 2 visits", false, 2, 0.5, Kind::Nonlinear(0.0098)),
        row("cross-axis 0.5 %, 2 visits", true, 2, 1.0, Kind::CrossAxis(0.005)),
        row("cross-axis 2 %, 2 visits", true, 2, 1.0, Kind::CrossAxis(0.02)),
        row("band-limited noise, 2 visits", true, 2, 1.0, Kind::Correlated(0.05)),
        row("flicker noise, 3 visits", true, 3, 1.0, Kind::Flicker),
        row("step 30, 2 visits", false, 2, 1.0, Kind::Step(0.03)),
        row("step 50, 3 visits", false, 3, 0.5, Kind::Step(0.05)),
        row("step 100, 2 visits", false, 2, 1.0, Kind::Step(0.1)),
        row("step 300, 3 visits", false, 3, 1.0, Kind::Step(0.3)),
        row("ramp 150, 2 visits", false, 2, 1.0, Kind::Ramp(0.15)),
        row("ramp 150, 3 visits", false, 3, 0.5, Kind::Ramp(0.15)),
        row("turntable, 2 visits", false, 2, 1.0, Kind::Turning(5.0)),
        row("curve", false, 1, 1.0, Kind::Curve(1.0)),
        row("jitter 2 ms, 2 visits", true, 2, 1.0, Kind::Jitter(0.002)),
        row("jitter 2 ms, spread poses", false, 0, 1.0, Kind::Jitter(0.002)),
        row("elevator, 2 visits", false, 2, 1.0, Kind::Elevator),
    ];

    /// A session of it.
    pub fn trial(self, seed: u64) -> Trial {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
        let mut scenario = Population::new(self.visits.max(1), self.scatter).scenario(seed);
        scenario.secondary.clear();
        // Nothing of the Earth: its part in the bars is an allowance, and no error here.
        scenario.latitude_deg = None;
        if self.visits == 0 {
            scenario.pose = spread(&mut random);
            // Which way the frame of a sensor with skewed axes is turned no rest tells.
            let lower = scenario.accelerometer.sensitivity.matrix().lower_triangle();
            scenario.accelerometer.sensitivity = Sensitivity::Matrix(lower.transpose().into());
        }
        let documented = match self.kind {
            Kind::Nonlinear(_) => true,
            Kind::CrossAxis(std) => std > 0.01,
            _ => false,
        };
        let preset = documented.then(|| Preset::named("mpu9250")).flatten();
        match self.kind {
            Kind::Bad { bumps } if bumps > 0 => scenario.pose.iter_mut().for_each(|pose| pose.rest_s = 12.0),
            Kind::Bumped => scenario.pose.iter_mut().for_each(|pose| pose.rest_s = 6.0),
            Kind::Advised => {
                let again: Vec<_> = scenario.pose.iter().skip(1).take(3).cloned().collect();
                scenario.pose.extend(again);
            }
            Kind::CrossAxis(std) => cross_axis(&mut scenario, std, &mut random),
            Kind::Correlated(seconds) => scenario.accelerometer.noise_correlation_s = seconds,
            Kind::Turning(rate) => scenario.pose.iter_mut().for_each(|pose| pose.turn_deg_s = [0.0, 0.0, rate]),
            Kind::Curve(rate) => {
                scenario.pose.truncate(1);
                scenario.pose.iter_mut().for_each(|pose| {
                    pose.face = Some("+Z".to_owned());
                    pose.rest_s = 60.0;
                    pose.turn_deg_s = [0.0, 0.0, rate];
                });
            }
            _ => {}
        }
        let mut change = Change::new(self.kind, &scenario, random);
        let moved = change.moved();
        Trial::altered(&scenario, preset, moved, |reading, seconds| change.apply(reading, seconds))
    }
}

/// What came of doing what the next step says until it says that all is done: six faces first, one of them off by 0.1 to 0.3
/// m/s².
pub fn follow(seed: u64) -> Trial {
    /// So many times somebody does as told.
    const PATIENCE: usize = 24;
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x7ead);
    let mut scenario = Population::new(1, 1.0).scenario(seed);
    scenario.latitude_deg = None;
    let change = Change::new(Kind::Bad { bumps: 0 }, &scenario, random.clone());
    let mut round = 0;
    loop {
        let mut change = Change { random: random.clone(), ..change.clone() };
        let trial =
            Trial::altered(&scenario, None, Vector3::zeros(), |reading, seconds| change.apply(reading, seconds));
        round += 1;
        if trial.is_confirmed() || round > PATIENCE {
            return trial;
        }
        let told = told_faces(&trial.next_step);
        for face in told {
            let rest_s = random.random_range(2.0..4.0);
            scenario.pose.push(Pose { face: Some(face.to_owned()), rest_s, ..Pose::default() });
        }
    }
}

/// The faces that a next step asks for: the first one that it names, those along an axis, or all of them.
fn told_faces(next_step: &str) -> Vec<&'static str> {
    let asked = ["place ", "rest once more near ", "Turn the sensor so that ", "turn the sensor so that "];
    let named = asked.iter().filter_map(|words| {
        let (_, behind) = next_step.split_once(words)?;
        FACES.into_iter().find(|face| behind.starts_with(face))
    });
    if let Some(face) = named.into_iter().next() {
        return vec![face];
    }
    match next_step.split_once("Show the faces along ").and_then(|(_, behind)| behind.chars().next()) {
        Some(axis) => FACES.into_iter().filter(|face| face.ends_with(axis.to_ascii_uppercase())).collect(),
        None => FACES.to_vec(),
    }
}

/// What happens to the readings.
#[derive(Clone)]
struct Change {
    kind: Kind,
    random: ChaCha8Rng,
    /// The pose that is wrong, by how much, and the length of the session in seconds.
    pose: usize,
    off: f64,
    length: f64,
    axis: usize,
    /// When a step happens, as a share of the session.
    when: f64,
    /// Share of the session at the last rest on a face along the axis.
    shown: f64,
    /// Start of the pose that it is in.
    current: Option<(usize, f64)>,
    /// Slow noise of several memories.
    flicker: [Vector3<f64>; 5],
}

impl Change {
    fn new(kind: Kind, scenario: &Scenario, mut random: ChaCha8Rng) -> Self {
        let poses = scenario.pose.len();
        let pose = if matches!(kind, Kind::Advised) { 0 } else { random.random_range(0..poses) };
        let sign = if random.random() { 1.0 } else { -1.0 };
        let times = scenario.pose.iter().scan(0.0, |end, pose| {
            *end += pose.rest_s + scenario.motion.duration_s;
            Some((pose, *end))
        });
        let times: Vec<_> = times.collect();
        let length = times.last().map_or(0.0, |(_, end)| *end);
        let off = sign * random.random_range(0.1..0.3);
        let axis = random.random_range(0..3);
        let along =
            |pose: &&(&Pose, f64)| pose.0.face.as_ref().is_some_and(|face| face.ends_with(["X", "Y", "Z"][axis]));
        Self {
            kind,
            pose,
            off,
            length,
            axis,
            when: random.random_range(0.2..0.8),
            shown: times.iter().rfind(along).map_or(1.0, |(_, end)| end / length),
            current: None,
            flicker: [Vector3::zeros(); 5],
            random,
        }
    }

    /// What the bias moves by from the beginning to the end; what steps or ramps, to the last rest that may show it.
    fn moved(&self) -> Vector3<f64> {
        match self.kind {
            Kind::Warming(slope) => Vector3::repeat(10.0 * slope * (1.0 - (-3.0_f64).exp())),
            Kind::Step(size) if self.shown > self.when => Vector3::ith(self.axis, size),
            Kind::Ramp(size) => Vector3::ith(self.axis, size * self.shown),
            _ => Vector3::zeros(),
        }
    }

    fn normal(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.random.sample::<f64, _>(StandardNormal))
    }

    fn apply(&mut self, reading: &mut Reading, seconds: f64) {
        if reading.pose != self.current.map(|(pose, _)| pose) {
            self.current = reading.pose.map(|pose| (pose, seconds));
        }
        let within = self.current.map_or(0.0, |(_, start)| seconds - start);
        let bad = reading.pose == Some(self.pose);
        if let Kind::Jitter(std) = self.kind {
            let late = std * self.random.sample::<f64, _>(StandardNormal);
            // No stamp overtakes the next one.
            reading.stamp = Stamp::from_nanos(reading.stamp.nanos() + (late.clamp(-0.004, 0.004) * 1e9) as i64);
        }
        let accelerometer = reading.sensor == Sensor::Accelerometer;
        let up = reading.force.try_normalize(1.0).unwrap_or_default();
        let along = Vector3::ith(self.axis, 1.0);
        let bumping = match self.kind {
            Kind::Bad { bumps } => bad && bumps > 0 && within > 1.5 && within % 2.2 < 0.25,
            Kind::Bumped => (3.0..3.25).contains(&within),
            _ => false,
        };
        if bumping {
            let size = if accelerometer { 2.0 } else { 0.2 };
            reading.measured += self.normal() * size;
        }
        if !accelerometer {
            return;
        }
        reading.measured += match self.kind {
            Kind::Bad { .. } | Kind::Advised if bad => up * self.off,
            Kind::Elevator if bad && within < 1.2 => up * (2.0 * self.off),
            Kind::Warming(slope) => Vector3::repeat(10.0 * slope * (1.0 - (-3.0 * seconds / self.length).exp())),
            Kind::Nonlinear(size) => reading.force.map(|force| size * (force / 9.80665).powi(2)),
            Kind::Step(size) if seconds > self.when * self.length => along * size,
            Kind::Ramp(size) => along * (size * seconds / self.length),
            Kind::Flicker => {
                for k in 0..5 {
                    let memory = 0.1 * 4_f64.powi(k as i32);
                    let fresh = self.normal();
                    let keep = (-0.01 / memory).exp();
                    self.flicker[k] = self.flicker[k] * keep + fresh * (0.003 * (1.0 - keep * keep).sqrt());
                }
                self.flicker.iter().sum()
            }
            _ => Vector3::zeros(),
        };
    }
}

/// Twenty poses in directions that are spread over the sphere.
fn spread(random: &mut ChaCha8Rng) -> Vec<Pose> {
    let faces = FACES.iter().map(|face| Pose { face: Some((*face).to_owned()), ..Pose::default() });
    let mut poses: Vec<_> = faces.collect();
    poses.extend((0..16).map(|_| {
        let up = Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal)).normalize();
        Pose { up: Some(up.into()), ..Pose::default() }
    }));
    poses.shuffle(random);
    poses.iter_mut().for_each(|pose| pose.rest_s = 2.5);
    poses
}

fn cross_axis(scenario: &mut Scenario, std: f64, random: &mut ChaCha8Rng) {
    let mut matrix = scenario.accelerometer.sensitivity.matrix();
    for (row, column) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
        matrix[(row, column)] = std * random.sample::<f64, _>(StandardNormal);
    }
    scenario.accelerometer.sensitivity = Sensitivity::Matrix(matrix.transpose().into());
}

/// What came of one session.
pub struct Outcome {
    pub published: bool,
    pub confirmed: bool,
    pub wrong: bool,
    /// How many of the published intervals hold the truth, and how many there are.
    pub inside: [(usize, usize); 2],
    /// Whether the worst-case error was kept to in every direction.
    pub bounded: Option<bool>,
    pub gyroscope: [bool; 3],
    /// Errors of bias and scale over their standard deviations.
    pub off: Vec<f64>,
    /// What the operator is told.
    pub next_step: String,
}

impl Outcome {
    pub fn of(trial: &Trial) -> Self {
        let confirmed = trial.is_confirmed();
        let accelerometer: Vec<_> =
            trial.errors(Quantity::AccelBias).chain(trial.errors(Quantity::AccelScale)).collect();
        let gyroscope: Vec<_> = trial.errors(Quantity::GyroBias).collect();
        let inside = |seen: &[super::trial::Seen]| (seen.iter().filter(|seen| seen.is_inside()).count(), seen.len());
        let off = |seen: &[super::trial::Seen]| seen.iter().any(|seen| seen.error.abs() > 3.29 * seen.std);
        let bounded = trial.are_bounded();
        let gyro_confirmed = trial.is_gyroscope_confirmed();
        Self {
            published: !accelerometer.is_empty(),
            confirmed,
            wrong: confirmed && off(&accelerometer),
            inside: [inside(&accelerometer), inside(&gyroscope)],
            bounded: (!bounded.is_empty()).then(|| bounded.iter().all(|bounded| *bounded)),
            gyroscope: [!gyroscope.is_empty(), gyro_confirmed, gyro_confirmed && off(&gyroscope)],
            off: accelerometer.iter().map(|seen| seen.error / seen.std).collect(),
            next_step: trial.next_step.clone(),
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = match (self.wrong, self.confirmed, self.published) {
            (true, ..) => "CONFIRMED WRONG",
            (_, true, _) => "confirmed",
            (_, _, true) => "provisional",
            _ => "undetermined",
        };
        write!(f, "{said}, off by {:.2?} standard deviations; {}", self.off, self.next_step)
    }
}
