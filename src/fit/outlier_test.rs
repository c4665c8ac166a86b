//! Outlier test: the placement that contradicts the others, if there is one.
//!
//! Each placement is compared with the fit of all others: its residual over the standard deviation that the others show
//! (externally studentised). Two readings of one face that differ are equally far from each other, and some bias and
//! scale explain either. Then the tilts decide: how far from level the sensor would have to lie on every other face.
//! This evidence is limited, because a table that is not level has the same effect.

use nalgebra::DVector;

use super::accelerometer::{Assumptions, MagnitudeEquation, Observation};
use super::config::Estimator;
use super::config::Loss;
use super::estimate::Estimate;
use super::linear_system::{LinearSystem, limits};
use super::parameterisation::Parameterisation;

/// Placement that contradicts the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Contradiction {
    /// Index among the observations.
    pub index: usize,
    /// Excess of its specific force over gravity by the fit of the others, m/s².
    pub off: f64,
    /// Largest excess that is accepted, m/s².
    pub limit: f64,
    /// Another placement that may be the wrong one instead.
    pub rival: Option<Rival>,
}

/// Second of two placements that cannot both be right.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// Index among the observations.
    pub index: usize,
    /// Change of the parameters if this one is left out instead of the first.
    pub moved: DVector<f64>,
}

struct Candidate {
    index: usize,
    off: f64,
    limit: f64,
    /// Log-likelihoods of the others: of the lengths of their readings, and of their tilts.
    lengths: f64,
    evenness: f64,
    /// Parameters without this placement.
    parameters: DVector<f64>,
}

/// Least lead in log-likelihood that makes one culprit the only one: e^4.5 is 90.
const DECISIVE: f64 = 4.5;
/// Level error of tables, as a share of gravity: about half a degree.
const LEVEL: f64 = 0.0087;

impl Candidate {
    fn score(&self) -> f64 {
        self.lengths + self.evenness
    }

    /// Log-likelihood ratio of this culprit over another.
    fn lead(&self, other: &Self, gravity: f64) -> f64 {
        let shift = (&self.parameters - &other.parameters).rows(0, 3).norm() / (LEVEL * gravity);
        let most = 0.5 * shift * shift;
        self.lengths - other.lengths + (self.evenness - other.evenness).clamp(-most, most)
    }
}

/// Finds the likeliest culprit among the placements that can be spared. Bounds are ignored.
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
    // Student's quantile at about one in ten thousand.
    let most = 4.3 + 30.0 / (freedom + trust);
    let candidate = |(index, line): (usize, &MagnitudeEquation)| {
        let left = solved.left[index];
        let own = 1.0 - (solved.design.row(index) * gain.column(index))[(0, 0)];
        if !is_spare(index) || own < 1e-6 {
            return None;
        }
        let of_others = squares - left * left / own;
        // Less scatter than assumed is luck.
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

/// Degrees of freedom that the assumed scatter is worth beside those of the data.
fn trust(freedom: f64) -> f64 {
    12.0 * (1.0 - freedom / 4.0).max(0.0).powi(2)
}

/// Log-likelihood of the tilts of the others by these parameters, with unknown scatter; zero for a model that takes any
/// direction.
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

    /// Result for placements on each face, `visits` times within `tilt_deg`, of which the first is off by `off` (m/s²).
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
