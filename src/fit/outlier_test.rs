//! The placement that contradicts the others, if there is one. What becomes of it is left to the caller.
//!
//! Each placement is held against the fit of all others: its residual over the standard deviation that the others show
//! (externally studentised). Two readings of one face that differ are equally far off each other, and any bias and scale
//! explains either; what then speaks for one of them is how askew the sensor would have had to lie on every other face.
//! That is worth only so much, since a table that is not level does the same.

use nalgebra::DVector;

use super::accelerometer::{Assumptions, MagnitudeEquation, Observation};
use super::config::Estimator;
use super::config::Loss;
use super::estimate::Estimate;
use super::linear_system::{LinearSystem, limits};
use super::parameterisation::Parameterisation;

/// A placement that the others contradict.
#[derive(Clone, Debug, PartialEq)]
pub struct Contradiction {
    /// Its place among the observations.
    pub index: usize,
    /// How much longer its specific force is than gravity by what the others say, m/s².
    pub off: f64,
    /// The most that is excused, m/s².
    pub limit: f64,
    /// Another that may be the wrong one instead, as far as the placements tell.
    pub rival: Option<Rival>,
}

/// The other of two that cannot both be right.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// Its place among the observations.
    pub index: usize,
    /// What leaving it out, and keeping the first, would add to the parameters.
    pub moved: DVector<f64>,
}

struct Candidate {
    index: usize,
    off: f64,
    limit: f64,
    /// Logarithms of the likelihood of all others: of the lengths that they read, and of how askew they lie.
    lengths: f64,
    evenness: f64,
    /// The parameters without it.
    parameters: DVector<f64>,
}

/// So much likelier, in units of the logarithm, must one culprit be than another to be the only one: e^4.5 is 90.
const DECISIVE: f64 = 4.5;
/// Tables are level to about half a degree, as a share of gravity.
const LEVEL: f64 = 0.0087;

impl Candidate {
    fn score(&self) -> f64 {
        self.lengths + self.evenness
    }

    /// How much likelier this culprit is than another.
    fn lead(&self, other: &Self, gravity: f64) -> f64 {
        let shift = (&self.parameters - &other.parameters).rows(0, 3).norm() / (LEVEL * gravity);
        let most = 0.5 * shift * shift;
        self.lengths - other.lengths + (self.evenness - other.evenness).clamp(-most, most)
    }
}

/// The likeliest culprit among those placements that can be spared. Bounds are not minded.
pub fn contradiction(
    observations: &[Observation],
    given: &Assumptions<'_>,
    fit: &Estimate,
    is_spare: impl Fn(usize) -> bool,
) -> Option<Contradiction> {
    let freedom = observations.len().checked_sub(given.shape.unknowns() + 1)? as f64;
    if given.estimator != Estimator::Magnitude {
        return None;
    }
    let calibration = fit.calibration();
    let assumed = given.placement_std * given.placement_std;
    let lines: Vec<_> = observations.iter().map(|seen| MagnitudeEquation::of(seen, given, &calibration)).collect();
    let mut system = LinearSystem::new(given.shape);
    for line in &lines {
        system.push(&-line.by_measured, &line.truth, -line.residual, line.noise, assumed);
    }
    let solved = system.solve(&limits(given.shape, |_| [f64::NEG_INFINITY, f64::INFINITY]), Loss::Square).ok()?;
    let gain = solved.gain();
    let squares = solved.left.norm_squared();
    let trust = trust(freedom);
    // As rare as one in some ten thousand, by Student's quantiles.
    let most = 4.3 + 30.0 / (freedom + trust);
    let candidate = |(index, line): (usize, &MagnitudeEquation)| {
        let left = solved.left[index];
        let own = 1.0 - (solved.design.row(index) * gain.column(index))[(0, 0)];
        if !is_spare(index) || own < 1e-6 {
            return None;
        }
        let of_others = squares - left * left / own;
        // Less scatter than is assumed is luck.
        let spread = ((of_others + trust) / (freedom + trust)).max(1.0);
        let deviation = left.abs() / (own * spread).sqrt();
        let unit = (line.by_measured.norm_squared() * assumed + line.noise).sqrt();
        (deviation > most).then(|| {
            let parameters = &fit.parameters + &solved.solution.x - gain.column(index) * (left / own);
            Candidate {
                index,
                off: -left / own * unit,
                limit: most * (spread / own).sqrt() * unit,
                lengths: -0.5 * freedom * libm::log(of_others.max(freedom).max(f64::MIN_POSITIVE)),
                evenness: evenness(observations, given, index, &parameters),
                parameters,
            }
        })
    };
    let mut candidates: Vec<_> = lines.iter().enumerate().filter_map(candidate).collect();
    candidates.sort_by(|a, b| b.score().total_cmp(&a.score()));
    let mut candidates = candidates.into_iter();
    let culprit = candidates.next()?;
    let rival = candidates.next().filter(|rival| culprit.lead(rival, given.gravity.value) < DECISIVE);
    Some(Contradiction {
        index: culprit.index,
        off: culprit.off,
        limit: culprit.limit,
        rival: rival.map(|rival| Rival { index: rival.index, moved: rival.parameters - culprit.parameters }),
    })
}

/// How many degrees of freedom the assumed scatter is worth beside so many of the data.
fn trust(freedom: f64) -> f64 {
    12.0 * (1.0 - freedom / 4.0).max(0.0).powi(2)
}

/// Logarithm of the likelihood of the tilts that the others have by these parameters, their scatter being unknown; zero for
/// a model that takes any direction.
fn evenness(observations: &[Observation], given: &Assumptions<'_>, without: usize, parameters: &DVector<f64>) -> f64 {
    if given.shape == Parameterisation::TRIANGULAR {
        return 0.0;
    }
    let calibration = given.shape.calibration(parameters);
    let others = observations.iter().enumerate().filter(|(index, _)| *index != without);
    let (squares, count) = others.fold((0.0, 0.0), |(squares, count), (_, seen)| {
        let force = calibration.correct(&seen.mean);
        (squares + (force - seen.normal * force.dot(&seen.normal)).norm_squared(), count + 2.0)
    });
    // Nobody puts a sensor down better than placements repeat.
    -0.5 * count * libm::log(f64::max(squares, count * given.placement_std.powi(2)).max(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::super::{Bounds, Calibration, Gravity, accelerometer};
    use super::*;

    const G: f64 = 9.80665;

    /// Each face so often, put down within so many degrees, and what is found when the first is off by 0.3 m/s².
    fn found(seed: u64, visits: usize, tilt_deg: f64, off: f64) -> Option<Contradiction> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
        let truth = Calibration { bias: Vector3::new(-0.38, 0.7, -0.6), ..Calibration::default() };
        let observations: Vec<_> = (0..6 * visits)
            .map(|k| {
                let mut up = Vector3::ith(k % 3, 1.0);
                if k % 6 > 2 {
                    up = -up;
                }
                let tilted = Rotation3::from_scaled_axis(normal(tilt_deg.to_radians())) * up;
                let mean = truth.measure(&(tilted * G)) + normal(0.005) + up * if k == 0 { off } else { 0.0 };
                Observation { placement: k as u32, mean, noise: Vector3::repeat(3e-6), normal: up }
            })
            .collect();
        let bounds = Bounds::default();
        let given = Assumptions {
            shape: Parameterisation::DIAGONAL,
            estimator: Estimator::Magnitude,
            gravity: Gravity::configured(G),
            placement_std: 0.01,
            cross_axis_std: 0.01,
            nonlinearity: 0.0,
            bounds: &bounds,
            loss: Loss::Square,
            start: truth,
        };
        let fit = accelerometer::fit(&observations, &given).unwrap();
        contradiction(&observations, &given, &fit, |_| true)
    }

    #[test]
    fn of_two_the_wrong_one_is_told_by_how_askew_the_others_would_lie() {
        for seed in 0..20 {
            for off in [0.3, -0.3] {
                let found = found(seed, 2, 0.2, off).unwrap();
                assert_eq!((found.index, found.rival.as_ref().map(|rival| rival.index)), (0, Some(6)), "tables tilt");
                assert!((found.off - off).abs() < 0.03 && found.limit < 0.3, "{} {}", found.off, found.limit);
            }
        }
    }

    #[test]
    fn no_table_tilts_by_three_degrees() {
        let found = found(1, 2, 0.2, 0.9).unwrap();
        assert_eq!((found.index, found.rival), (0, None));
    }

    #[test]
    fn where_the_sensor_lies_askew_anyway_the_other_one_is_named_too() {
        let all: Vec<_> = (0..20).filter_map(|seed| found(seed, 2, 3.0, 0.3)).collect();
        assert_eq!(all.len(), 20);
        for found in all {
            let either = found.index == 0 || found.rival.as_ref().is_some_and(|rival| rival.index == 0);
            assert!(either, "{found:?}");
        }
    }

    #[test]
    fn of_three_the_two_that_agree_are_right() {
        for seed in 0..20 {
            let found = found(seed, 3, 3.0, 0.3).unwrap();
            assert_eq!((found.index, found.rival), (0, None));
        }
    }

    #[test]
    fn placements_that_scatter_as_assumed_contradict_nothing() {
        assert!((0..200).all(|seed| found(seed, 2, 1.0, 0.0).is_none()));
    }
}
