//! Doubt about a heading reference as a whole: it contradicts the gyroscope in many turns, or follows it too well.

use nalgebra::{Matrix3, Vector3};

use super::headings::HeadingChanges;
use super::rest_history::JudgedRest;
use crate::imu::{HeadingConfig, HeadingUnit};
use crate::still::Rest;
use crate::turns::{Contradiction, Ends, History, KnownRotation, Piece, heading_seen, level_axis};

/// Reason why no turn uses a heading reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum HeadingDoubt {
    /// It changes during so many rests of so many, by up to so much, rad.
    Restless(u64, u64, f64),
    /// It grows the other way.
    Opposite,
    /// It changes as it would in this unit.
    Unit(HeadingUnit),
    /// It contradicts so many turns, of so many.
    Contradicts(usize, usize),
    /// It repeats what the gyroscope reads, to this root mean square in rad, over so many turns.
    Repeats(f64, usize),
}

/// Turn with a change of heading.
struct Compared {
    pieces: Vec<Piece>,
    ends: Ends,
    level: Vector3<f64>,
    known: KnownRotation,
}

/// Least change of heading that tells, rad.
const TELLS: f64 = 0.2;

impl Compared {
    /// Whether the gyroscope agrees if the heading is multiplied by so much; `None` if the turn does not tell.
    fn agrees(&self, factor: f64) -> Option<bool> {
        let known = KnownRotation { angle: self.known.angle * factor, ..self.known };
        match known.checked(&self.pieces, &self.ends, &self.level) {
            Ok(_) => Some(true),
            Err(Contradiction::Otherwise(_)) => Some(false),
            Err(Contradiction::Tilted(_) | Contradiction::Uncounted(_)) => None,
        }
    }

    /// What the gyroscope as it reads misses the heading by, rad.
    fn missed(&self) -> Option<f64> {
        let known = self.known.checked(&self.pieces, &self.ends, &self.level).ok()?;
        Some(heading_seen(&self.pieces, &self.ends, &self.level) - known.angle)
    }
}

/// Doubt about a reference by the turns between all rests, accepted or not.
pub(super) fn doubt(
    changes: &HeadingChanges<'_>,
    config: &HeadingConfig,
    turns: &History,
    entries: &[JudgedRest],
    range: Option<f64>,
) -> Option<HeadingDoubt> {
    if let Some((moved, read, most)) = changes.headings.restless() {
        return Some(HeadingDoubt::Restless(moved, read, most));
    }
    let compared = compared(changes, turns, entries, range);
    let told = |factor: f64| {
        let agrees: Vec<bool> = compared.iter().filter_map(|turn| turn.agrees(factor)).collect();
        (agrees.iter().filter(|agrees| !**agrees).count(), agrees.len())
    };
    let (wrong, of) = told(1.0);
    if wrong >= 2 && 3 * wrong > of {
        let explains = |factor: f64| told(factor).0 * 10 <= of;
        let other = [HeadingUnit::Degrees, HeadingUnit::Radians].into_iter().filter(|unit| *unit != config.unit);
        let unit =
            other.into_iter().find(|unit| config.path.is_some() && explains(unit.factor() / config.unit.factor()));
        return Some(match unit {
            _ if explains(-1.0) => HeadingDoubt::Opposite,
            Some(unit) => HeadingDoubt::Unit(unit),
            None => HeadingDoubt::Contradicts(wrong, of),
        });
    }
    repeats(&compared)
}

/// Doubt about a reference that misses what the gyroscope reads, which is in error itself, by far less than its own error.
fn repeats(compared: &[Compared]) -> Option<HeadingDoubt> {
    /// Fewest turns, and largest share of the stated error: four turns of an honest reference agree so well by chance once
    /// in 300 cases, if the gyroscope is perfect.
    const LEAST: usize = 4;
    const SHARE: f64 = 0.2;
    let missed: Vec<f64> = compared.iter().filter_map(Compared::missed).collect();
    let rms = (missed.iter().map(|missed| missed * missed).sum::<f64>() / missed.len().max(1) as f64).sqrt();
    let stated = compared.first()?.known.std();
    (missed.len() >= LEAST && rms < SHARE * stated).then_some(HeadingDoubt::Repeats(rms, missed.len()))
}

/// Turns whose change of heading tells, as far as the gyroscope followed them.
fn compared(
    changes: &HeadingChanges<'_>,
    turns: &History,
    entries: &[JudgedRest],
    range: Option<f64>,
) -> Vec<Compared> {
    // Directions need not be calibrated for this.
    let up = |rest: &Rest| rest.accelerometer.mean.try_normalize(f64::MIN_POSITIVE).unwrap_or(Vector3::z());
    let rest = |start| entries.iter().find(|entry| entry.rest.start == start).map(|entry| &entry.rest);
    let compared = turns.turns(|_| true).into_iter().filter_map(|turn| {
        let known = changes.of(&turn)?;
        if turn.unusable(range).is_some() || !turn.resolves(1.0) {
            return None;
        }
        let rests = [rest(turn.from)?, rest(turn.to)?];
        let rate = rests.map(|rest| rest.gyroscope.as_ref().map_or(Vector3::zeros(), |mean| mean.mean));
        let ends = Ends { up: rests.map(up), rate, by_up: Matrix3::zeros() };
        let level = level_axis(&ends.up[0], entries.iter().map(|entry| up(&entry.rest)));
        Some(Compared { pieces: turn.pieces(), ends, level, known })
    });
    let tells = |turn: &Compared| heading_seen(&turn.pieces, &turn.ends, &turn.level).abs() >= TELLS;
    compared.filter(tells).collect()
}

impl HeadingDoubt {
    /// What is wrong with the reference, and what to do.
    pub(super) fn text(&self, config: &HeadingConfig) -> String {
        match self {
            Self::Restless(moved, read, most) => format!(
                "changes during {moved} of {read} rests, by up to {:.2}°: made from a gyroscope it drifts with its bias; otherwise check \
                 fit.heading.unit, or state a larger fit.heading.std_deg",
                most.to_degrees()
            ),
            Self::Opposite => format!(
                "turns the other way than the gyroscope: set fit.heading.clockwise = {}, or check the gyroscope's axes",
                !config.clockwise
            ),
            Self::Unit(unit) => {
                format!("turns as it would in another unit: set fit.heading.unit = \"{}\"", unit.name())
            }
            Self::Contradicts(wrong, of) => format!(
                "contradicts the gyroscope in {wrong} of {of} turns: check fit.heading, its stamps, and that it is on the same body"
            ),
            Self::Repeats(rms, turns) => format!(
                "repeats what the gyroscope reads to {:.3}° over {turns} turns, far closer than its fit.heading.std_deg = {}: made \
                 from this gyroscope, as an odometry that fuses it is, it says nothing about it; if it is not, state how good it is",
                rms.to_degrees(),
                config.std_deg
            ),
        }
    }
}
