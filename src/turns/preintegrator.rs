//! Preintegrator of a gyroscope: takes samples, returns stretches of motion, each a [`Piece`] with its statistics.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::piece::Piece;
use super::range_end::RangeEnd;
use super::sample_clock::SampleClock;
use crate::Stamp;

/// Integrals of a [`Piece`] as they are stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Integrals([f32; 10]);

impl Integrals {
    fn of(piece: &Piece) -> Self {
        let Piece { angle: a, coning: c, moment: m, seconds } = piece;
        Self([a.x, a.y, a.z, c.x, c.y, c.z, m.x, m.y, m.z, *seconds].map(|x| x as f32))
    }

    pub(super) fn piece(&self) -> Piece {
        let at = |i: usize| f64::from(self.0[i]);
        let vector = |i: usize| Vector3::new(at(i), at(i + 1), at(i + 2));
        Piece { angle: vector(0), coning: vector(3), moment: vector(6), seconds: at(9) }
    }

    /// Joins this piece and the next.
    pub(super) fn then(&self, next: &Self) -> Self {
        Self::of(&self.piece().then(&next.piece()))
    }
}

/// Stretch of the stream.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "StretchParts", into = "StretchParts")]
pub struct Stretch {
    /// Start of its first sample's cell.
    pub start: Stamp,
    /// End of its last sample's cell, which is the start of the next stretch.
    pub end: Stamp,
    /// Integrals over the stretch.
    pub(super) integrals: Integrals,
    /// Path ∫ ‖ω‖ dt, rad.
    pub path: f32,
    /// Roughness, rad²: Σ ‖second difference of ω‖² h² if it were that of noise, by the fourth differences, which hardly see
    /// motion that the samples resolve.
    pub roughness: f32,
    /// Longest time between two samples, s.
    pub gap: f32,
    /// Largest reading of an axis, rad/s.
    pub peak: f32,
    /// Number of readings that equal the stream's highest or lowest one of their axis so far.
    pub pinned: u16,
    /// Whether the stamps broke within the stretch.
    pub broken: bool,
    /// Sum of the specific forces during the stretch, m/s², and their number.
    pub(super) felt: ([f32; 3], u32),
}

impl Stretch {
    /// Integrals over the stretch.
    pub fn piece(&self) -> Piece {
        self.integrals.piece()
    }

    /// Joins this stretch and the next.
    pub fn then(&self, next: &Self) -> Self {
        Self {
            end: next.end,
            integrals: self.integrals.then(&next.integrals),
            path: self.path + next.path,
            roughness: self.roughness + next.roughness,
            gap: self.gap.max(next.gap),
            peak: self.peak.max(next.peak),
            pinned: self.pinned.saturating_add(next.pinned),
            broken: self.broken || next.broken,
            felt: (
                [0, 1, 2].map(|axis| self.felt.0[axis] + next.felt.0[axis]),
                self.felt.1.saturating_add(next.felt.1),
            ),
            ..*self
        }
    }

    /// Mean specific force during the stretch, m/s².
    pub fn force(&self) -> Option<Vector3<f64>> {
        let (sum, count) = self.felt;
        (count > 0).then(|| Vector3::from(sum.map(f64::from)) / f64::from(count))
    }
}

/// A stretch as it is stored, without the names of its fields: a checkpoint holds hundreds.
type StretchParts = (Stamp, Stamp, Integrals, [f32; 4], u16, bool, ([f32; 3], u32));

impl From<Stretch> for StretchParts {
    fn from(stretch: Stretch) -> Self {
        let Stretch { start, end, integrals, path, roughness, gap, peak, pinned, broken, felt } = stretch;
        (start, end, integrals, [path, roughness, gap, peak], pinned, broken, felt)
    }
}

impl From<StretchParts> for Stretch {
    fn from((start, end, integrals, sizes, pinned, broken, felt): StretchParts) -> Self {
        let [path, roughness, gap, peak] = sizes;
        Self { start, end, integrals, path, roughness, gap, peak, pinned, broken, felt }
    }
}

/// Largest size of a stretch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// Path, rad.
    pub path: f64,
    /// Duration, s.
    pub seconds: f64,
}

impl Default for Limit {
    fn default() -> Self {
        Self { path: 0.1, seconds: 0.25 }
    }
}

/// Preintegrator: sums over the open stretch, in constant memory.
///
/// Each sample counts for its cell, from halfway to the sample before to halfway to the one after. The change of the
/// rate from one cell to the next adds a twelfth of their cross product (Bortz 1971; Savage, "Strapdown inertial
/// navigation integration algorithm design", 1998).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Preintegrator {
    sample_clock: SampleClock,
    /// Last sample, whose cell is open, and the interval before it, s.
    last: Option<(Stamp, Vector3<f64>)>,
    interval: f64,
    /// Angle of the last cell, rad.
    cell: Vector3<f64>,
    differences: Differences,
    range_end: Option<RangeEnd>,
    open: Open,
}

/// Latest differences of the rate of first, second and third order, rad/s.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Differences {
    last: [Vector3<f64>; 3],
    /// Number of them that are known.
    known: usize,
}

impl Differences {
    /// Takes a change of the rate; returns the fourth difference.
    fn push(&mut self, change: Vector3<f64>) -> Option<Vector3<f64>> {
        let mut next = change;
        for last in self.last.iter_mut().take(self.known) {
            next -= std::mem::replace(last, next);
        }
        let Some(unknown) = self.last.get_mut(self.known) else { return Some(next) };
        *unknown = next;
        self.known += 1;
        None
    }
}

/// Sums of the open stretch.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Open {
    start: Option<Stamp>,
    angle: Vector3<f64>,
    coning: Vector3<f64>,
    /// First moment ∫ t ω dt, t from its start.
    first_moment: Vector3<f64>,
    seconds: f64,
    path: f64,
    roughness: f64,
    gap: f64,
    peak: f64,
    pinned: u16,
    broken: bool,
    force: Vector3<f64>,
    forces: u32,
}

impl Preintegrator {
    /// Takes a sample, and returns the stretch that it closes, if any.
    pub fn push(&mut self, stamp: Stamp, rate: &Vector3<f64>, limit: &Limit) -> Option<Stretch> {
        let Some((last, before)) = self.last else {
            self.sample_clock.interval(stamp);
            self.begin(stamp, rate);
            return None;
        };
        if stamp <= last {
            // The clock was set back: what came before is not connected to what follows.
            let closed = self.close(last, true);
            self.sample_clock = SampleClock::default();
            self.sample_clock.interval(stamp);
            self.begin(stamp, rate);
            self.open.broken = true;
            return closed;
        }
        let interval = 1e-9 * self.sample_clock.interval(stamp).unwrap_or(0.0);
        let cell = (self.interval + interval) / 2.0;
        let angle = before * cell;
        let open = &mut self.open;
        open.coning += open.angle.cross(&angle) / 2.0 + self.cell.cross(&angle) / 12.0;
        open.first_moment += angle * (open.seconds + cell / 2.0);
        open.angle += angle;
        open.seconds += cell;
        open.path += angle.norm();
        open.gap = open.gap.max(stamp.seconds_since(last));
        if let Some(difference) = self.differences.push(rate - before) {
            // Of white noise, and of a knock of one sample, the squares of second differences sum to 6 of its own, those of
            // fourth ones to 70.
            open.roughness += difference.norm_squared() * (cell * cell) * (6.0 / 70.0);
        }
        self.look_for_range(rate);
        self.interval = interval;
        self.cell = angle;
        self.last = Some((stamp, *rate));
        if self.open.path < limit.path && self.open.seconds < limit.seconds {
            return None;
        }
        // The cell of the last sample ends halfway to this one.
        self.close(last.plus_nanos(stamp.since(last) / 2), false)
    }

    /// Takes a specific force measured about now, m/s².
    pub fn feel(&mut self, force: &Vector3<f64>) {
        self.open.force += force;
        self.open.forces = self.open.forces.saturating_add(1);
    }

    /// Counts the current reading as clipped, as reported by the driver.
    pub fn clip(&mut self) {
        self.open.pinned = self.open.pinned.saturating_add(Self::CLIPPED);
    }

    /// Number of readings that stopped at an extreme of the stream that means the end of a range.
    pub const CLIPPED: u16 = 1;

    /// Largest reading of the stream, rad/s.
    pub fn peak(&self) -> f64 {
        self.range_end.map_or(0.0, |end| end.peak())
    }

    fn begin(&mut self, stamp: Stamp, rate: &Vector3<f64>) {
        self.last = Some((stamp, *rate));
        self.interval = 0.0;
        self.cell = Vector3::zeros();
        self.differences = Differences::default();
        self.open = Open { start: Some(stamp), ..Open::default() };
        self.look_for_range(rate);
    }

    /// Counts readings that stop at an extreme of the stream.
    fn look_for_range(&mut self, rate: &Vector3<f64>) {
        self.open.peak = self.open.peak.max(rate.amax());
        if self.range_end.get_or_insert(RangeEnd::of(rate)).push(rate) {
            self.open.pinned = self.open.pinned.saturating_add(1);
        }
    }

    fn close(&mut self, end: Stamp, broken: bool) -> Option<Stretch> {
        let Open {
            start,
            angle,
            coning,
            first_moment,
            seconds,
            path,
            roughness,
            gap,
            peak,
            pinned,
            broken: was,
            force,
            forces,
        } = std::mem::take(&mut self.open);
        self.open.start = Some(end);
        let stretch = Stretch {
            start: start?,
            end,
            integrals: Integrals::of(&Piece { angle, coning, moment: first_moment * 2.0 - angle * seconds, seconds }),
            path: path as f32,
            roughness: roughness as f32,
            gap: gap as f32,
            peak: peak as f32,
            pinned,
            broken: broken || was,
            felt: ([0, 1, 2].map(|axis| force[axis] as f32), forces),
        };
        Some(stretch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Roughness of a second of rates at 25 Hz.
    fn roughness(rate: impl Fn(f64) -> f64) -> f64 {
        let whole = Limit { path: f64::INFINITY, seconds: 0.999 };
        let mut preintegrator = Preintegrator::default();
        let stretches = (0..40_u32).filter_map(|i| {
            let seconds = f64::from(i) / 25.0;
            let rate = Vector3::new(rate(seconds), 0.0, 0.0);
            preintegrator.push(Stamp::from_nanos((1e9 * seconds) as i64), &rate, &whole)
        });
        stretches.map(|stretch| f64::from(stretch.roughness)).sum()
    }

    #[test]
    fn a_knock_shorter_than_a_sample_is_rough_and_a_motion_that_samples_resolve_is_not() {
        let knock = roughness(|seconds| if (seconds - 0.4).abs() < 0.01 { 0.5 } else { 0.0 });
        assert!((knock / (6.0 * 0.5 * 0.5 / 625.0) - 1.0).abs() < 1e-3, "{knock}");
        // A hand that trembles twice a second, as fast as the knock.
        let motion = roughness(|seconds| 0.5 * libm::sin(4.0 * std::f64::consts::PI * seconds));
        assert!(motion < 0.05 * knock, "{motion} {knock}");
    }
}
