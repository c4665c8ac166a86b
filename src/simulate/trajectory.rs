//! Trajectory of the sensor in its session: attitude, true angular rate and true specific force at any instant. `sensor`
//! makes readings of them.
//!
//! The time scaling of a motion is the minimum-jerk polynomial `s(u) = 10u³ − 15u⁴ + 6u⁵` (Flash and Hogan 1985), whose
//! speed and acceleration vanish at both ends. Movements there and back follow the bump `b(u) = 64u³(1 − u)³`.

use std::f64::consts::TAU;

use nalgebra::{Unit, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::pose::{Attitude, attitude, axis_angle, rotation};
use super::{Motion, Scenario, Vibration};

/// Rate of the Earth's rotation, in rad/s (IERS Conventions 2010, table 1.2).
const EARTH_RATE: f64 = 7.292_115e-5;

/// Knock: duration, frequency and lever.
const KNOCK_S: f64 = 0.12;
const KNOCK_HZ: f64 = 20.0;
const KNOCK_LEVER_M: f64 = 0.05;

/// True quantities at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// True specific force in the sensor's frame, in m/s².
    pub force: Vector3<f64>,
    /// Part of the specific force that is the reaction to gravity, in m/s².
    pub gravity: Vector3<f64>,
    /// True angular rate in the sensor's frame, in rad/s.
    pub rate: Vector3<f64>,
    /// Previous and next pose; the same while it rests.
    pub poses: (usize, usize),
    /// Progress from the first to the second, 0 to 1.
    pub progress: f64,
    /// Whether it stays in its pose.
    pub holds_pose: bool,
}

/// A session, as spans that follow each other without a gap.
#[derive(Clone, Debug)]
pub(super) struct Trajectory {
    gravity: f64,
    /// Earth's rotation in the world's frame (x points north), in rad/s.
    earth: Vector3<f64>,
    vibration: Vec<Vibration>,
    spans: Vec<Span>,
}

#[derive(Clone, Debug)]
struct Span {
    /// Start and end in nanoseconds since the start of the recording; `until` belongs to the next span.
    from: i64,
    until: i64,
    kind: SpanKind,
}

#[derive(Clone, Debug)]
enum SpanKind {
    Stay(Stay),
    Move(Box<Leg>),
}

/// Stay in a pose, at rest or turning at a constant rate.
#[derive(Clone, Debug)]
struct Stay {
    pose: usize,
    attitude: Attitude,
    /// Rotation about an axis of the world, with its rate in rad/s.
    turn: Option<(Unit<Vector3<f64>>, f64)>,
    duration_s: f64,
}

/// Motion from one pose to the next.
#[derive(Clone, Debug)]
struct Leg {
    poses: (usize, usize),
    attitude: Attitude,
    /// Turn from attitude to attitude, about an axis of the sensor's frame, in radians.
    axis: Unit<Vector3<f64>>,
    angle: f64,
    /// Detour on the way, applied after the turn, in radians.
    detour_axis: Unit<Vector3<f64>>,
    detour: f64,
    /// Displacements in the world, in metres: `carry` stays, `lift` goes there and back.
    carry: Vector3<f64>,
    lift: Vector3<f64>,
    shake: [[Sine; 3]; 3],
    knock: Knock,
    duration_s: f64,
    /// Part of the motion before the start of the recording, in seconds.
    skipped_s: f64,
}

/// Impact at the end of a motion: vertical acceleration, and rocking about a horizontal axis, that die away.
#[derive(Clone, Debug)]
struct Knock {
    /// Acceleration at the beginning, in m/s².
    acceleration: f64,
    /// Axis of the world that it rocks about.
    axis: Unit<Vector3<f64>>,
    duration_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Sine {
    amplitude: f64,
    frequency: f64,
    phase: f64,
}

impl Trajectory {
    /// Trajectory of a valid scenario. Tilts and motions have separate random generators, so that one does not change
    /// with the other.
    pub fn new(scenario: &Scenario, tilts: &mut impl Rng, motions: &mut impl Rng) -> Self {
        let motion = &scenario.motion;
        let mut spans = Spans::default();
        let mut last: Option<(usize, Attitude)> = None;
        for (index, pose) in scenario.pose.iter().enumerate() {
            let scatter =
                [(); 2].map(|()| scenario.tilt_scatter_deg.to_radians() * tilts.sample::<f64, _>(StandardNormal));
            let Some(attitude) = attitude(pose, scatter) else { continue };
            match last {
                None => {
                    let before = attitude * anywhere(motions);
                    let leg = Leg::new((index, index), before, attitude, 2.0 * motion.start_s, motion, motions);
                    spans.push(motion.start_s, SpanKind::Move(Box::new(Leg { skipped_s: motion.start_s, ..leg })));
                }
                Some((previous, before)) => {
                    let duration_s = pose.motion_s.unwrap_or(motion.duration_s);
                    let leg = Leg::new((previous, index), before, attitude, duration_s, motion, motions);
                    spans.push(duration_s, SpanKind::Move(Box::new(leg)));
                }
            }
            let stay = Stay::new(index, attitude, pose.turn_deg_s, pose.rest_s);
            last = Some((index, stay.attitude_at(pose.rest_s)));
            spans.push(pose.rest_s, SpanKind::Stay(stay));
        }
        if let Some((pose, attitude)) = last {
            let after = attitude * anywhere(motions);
            let leg = Leg::new((pose, pose), attitude, after, 2.0 * motion.end_s, motion, motions);
            spans.push(motion.end_s, SpanKind::Move(Box::new(leg)));
        }
        let latitude = scenario.latitude_deg.map(f64::to_radians);
        let earth = latitude.map(|latitude| Vector3::new(libm::cos(latitude), 0.0, libm::sin(latitude)) * EARTH_RATE);
        Self {
            gravity: scenario.gravity,
            earth: earth.unwrap_or_default(),
            vibration: scenario.vibration.clone(),
            spans: spans.spans,
        }
    }

    /// Rests: pose, first nanosecond, the nanosecond after the last, attitude. Turns are not rests.
    pub fn rests(&self) -> impl Iterator<Item = (usize, i64, i64, Attitude)> {
        self.spans.iter().filter_map(|span| match &span.kind {
            SpanKind::Stay(stay) if stay.turn.is_none() => Some((stay.pose, span.from, span.until, stay.attitude)),
            _ => None,
        })
    }

    /// True quantities at `nanos` nanoseconds after the start; `None` after the end.
    pub fn at(&self, nanos: i64) -> Option<State> {
        let span = self.spans.get(self.spans.partition_point(|span| span.until <= nanos))?;
        let seconds = (nanos - span.from) as f64 * 1e-9;
        let (attitude, rate, acceleration, poses, progress) = match &span.kind {
            SpanKind::Stay(stay) => stay.at(seconds),
            SpanKind::Move(leg) => leg.at(seconds),
        };
        let from_world = attitude.inverse();
        let vibration: Vector3<f64> = self.vibration.iter().map(|vibration| vibration.at(nanos as f64 * 1e-9)).sum();
        Some(State {
            force: from_world * (Vector3::z() * self.gravity + acceleration) + vibration,
            gravity: from_world * (Vector3::z() * self.gravity),
            rate: rate + from_world * self.earth,
            poses,
            progress,
            holds_pose: matches!(span.kind, SpanKind::Stay(_)),
        })
    }
}

#[derive(Default)]
struct Spans {
    spans: Vec<Span>,
}

impl Spans {
    /// Appends a span, unless it is empty.
    fn push(&mut self, seconds: f64, kind: SpanKind) {
        let from = self.spans.last().map_or(0, |span| span.until);
        let until = from.saturating_add((seconds * 1e9).round() as i64);
        if until > from {
            self.spans.push(Span { from, until, kind });
        }
    }
}

/// Attitude, angular rate in the sensor's frame, acceleration in the world, poses, progress.
type Kinematics = (Attitude, Vector3<f64>, Vector3<f64>, (usize, usize), f64);

impl Stay {
    fn new(pose: usize, attitude: Attitude, turn_deg_s: [f64; 3], duration_s: f64) -> Self {
        let turn = Unit::try_new_and_get(Vector3::from(turn_deg_s), 0.0);
        Self { pose, attitude, turn: turn.map(|(axis, rate)| (axis, rate.to_radians())), duration_s }
    }

    fn at(&self, seconds: f64) -> Kinematics {
        let attitude = self.attitude_at(seconds);
        let rate = self.turn.map(|(axis, full)| {
            let ramp = self.ramp_s();
            let speed = full
                * minimum_jerk((seconds / ramp).min(1.0))
                * minimum_jerk(((self.duration_s - seconds) / ramp).clamp(0.0, 1.0));
            attitude.inverse_transform_vector(&(axis.into_inner() * speed))
        });
        (attitude, rate.unwrap_or_default(), Vector3::zeros(), (self.pose, self.pose), 0.0)
    }

    fn attitude_at(&self, seconds: f64) -> Attitude {
        let Some((axis, rate)) = self.turn else { return self.attitude };
        let ramp = self.ramp_s();
        // A turn starts and ends as smoothly as a motion: the angle is the integral of the speed.
        let ramped = |seconds: f64| {
            let u = (seconds / ramp).clamp(0.0, 1.0);
            ramp * u * u * u * u * (2.5 + u * (u - 3.0))
        };
        let plateau = (seconds - ramp).clamp(0.0, self.duration_s - 2.0 * ramp);
        let slowing =
            if seconds > self.duration_s - ramp { ramp / 2.0 - ramped(self.duration_s - seconds) } else { 0.0 };
        rotation(&axis, rate * (ramped(seconds) + plateau + slowing)) * self.attitude
    }

    fn ramp_s(&self) -> f64 {
        0.5_f64.min(self.duration_s / 4.0)
    }
}

impl Leg {
    fn new(
        poses: (usize, usize),
        from: Attitude,
        to: Attitude,
        duration_s: f64,
        motion: &Motion,
        random: &mut impl Rng,
    ) -> Self {
        let (axis, angle) = axis_angle(&(from.inverse() * to));
        let heading = random.random_range(0.0..TAU);
        let (sin, cos) = libm::sincos(heading);
        // Three sines per direction, with the requested root mean square.
        let amplitude = motion.shake * (2.0_f64 / 3.0).sqrt();
        let mut sine = || Sine {
            amplitude,
            frequency: motion.shake_hz * random.random_range(0.6..1.4),
            phase: random.random_range(0.0..TAU),
        };
        let shake = [(); 3].map(|()| [(); 3].map(|()| sine()));
        Self {
            poses,
            attitude: from,
            axis,
            angle,
            detour_axis: any_axis(random),
            detour: motion.wobble_deg.to_radians(),
            carry: Vector3::new(cos, sin, 0.0) * motion.carry_m,
            lift: Vector3::z() * motion.lift_m,
            shake,
            knock: Knock {
                acceleration: motion.knock,
                axis: Unit::new_unchecked(Vector3::new(-sin, cos, 0.0)),
                duration_s: KNOCK_S.min(duration_s / 4.0),
            },
            duration_s,
            skipped_s: 0.0,
        }
    }

    fn at(&self, seconds: f64) -> Kinematics {
        let duration = self.duration_s;
        let u = ((seconds + self.skipped_s) / duration).clamp(0.0, 1.0);
        let v = 1.0 - u;
        let p = u * v;
        let (speed, acceleration) = (30.0 * p * p, 60.0 * p * (v - u));
        let bump = 64.0 * p * p * p;
        let (bump_speed, bump_acceleration) = (192.0 * p * p * (v - u), 384.0 * p * (1.0 - 5.0 * p));

        let progress = minimum_jerk(u);
        let detour = rotation(&self.detour_axis, self.detour * bump);
        let attitude = self.attitude * rotation(&self.axis, self.angle * progress) * detour;
        let rate = detour.inverse_transform_vector(&(self.axis.into_inner() * (self.angle * speed / duration)))
            + self.detour_axis.into_inner() * (self.detour * bump_speed / duration);
        let shake = self.shake.map(|sines| sines.iter().map(|sine| sine.at(seconds)).sum());
        let acceleration = (self.carry * acceleration + self.lift * bump_acceleration) / (duration * duration)
            + Vector3::from(shake) * bump;
        let (rocked, rocking, jolt) = self.knock.at(duration * v);
        let axis = self.knock.axis;
        let rate = rate + attitude.inverse_transform_vector(&(axis.into_inner() * rocking));
        (rotation(&axis, rocked) * attitude, rate, acceleration + Vector3::z() * jolt, self.poses, progress)
    }
}

impl Knock {
    /// Angle in rad, rate in rad/s and vertical acceleration in m/s² at `left` seconds before the end of the motion. It
    /// rocks as if the acceleration were felt at the end of a lever.
    fn at(&self, left: f64) -> (f64, f64, f64) {
        if self.acceleration == 0.0 || left >= self.duration_s {
            return (0.0, 0.0, 0.0);
        }
        let decay = left / self.duration_s;
        let speed = TAU * KNOCK_HZ;
        let (sin, cos) = libm::sincos(speed * (self.duration_s - left));
        let envelope = decay * decay * decay;
        let angle = self.acceleration / (speed * speed * KNOCK_LEVER_M);
        let rate = angle * (speed * envelope * cos - 3.0 * decay * decay / self.duration_s * sin);
        (angle * envelope * sin, rate, self.acceleration * envelope * cos)
    }
}

impl Sine {
    fn at(&self, seconds: f64) -> f64 {
        self.amplitude * libm::sin(TAU * self.frequency * seconds + self.phase)
    }
}

impl Vibration {
    /// Acceleration in the sensor's frame, in m/s², at `seconds` after the start.
    fn at(&self, seconds: f64) -> Vector3<f64> {
        if self.burst_s.is_some_and(|burst| seconds % (burst + self.pause_s) >= burst) {
            return Vector3::zeros();
        }
        let envelope = 1.0 - self.modulation * (0.5 - 0.5 * libm::cos(TAU * self.modulation_hz * seconds));
        Vector3::from(self.amplitude) * (envelope * libm::sin(TAU * self.frequency_hz * seconds))
    }
}

fn minimum_jerk(u: f64) -> f64 {
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// Rotation by about a right angle (1 to 2 rad) about any axis.
fn anywhere(random: &mut impl Rng) -> Attitude {
    let axis = any_axis(random);
    rotation(&axis, random.random_range(1.0..2.0))
}

/// Random direction, all equally likely.
fn any_axis(random: &mut impl Rng) -> Unit<Vector3<f64>> {
    let mut axis = || random.sample::<f64, _>(StandardNormal);
    Unit::try_new(Vector3::new(axis(), axis(), axis()), 1e-9).unwrap_or_else(Vector3::x_axis)
}
