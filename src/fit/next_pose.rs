//! Next best poses of an accelerometer.
//!
//! A placement tells the length of the corrected reading in one direction. It adds most where that length is least
//! certain, which makes the determinant of the information as large as one more placement can (Wynn, "The sequential
//! generation of D-optimum experimental designs", 1970). A session that is continued so ends with the smallest largest
//! uncertainty of any direction (Kiefer and Wolfowitz, "The equivalence of two extremum problems", 1960), and with
//! placements that check each other equally well.

use nalgebra::{SMatrix, SVector, Vector3};

use super::accelerometer::{Assumptions, MagnitudeEquation, Observation};
use super::parameterisation::{Parameterisation, Term, Truth};
use super::turn_fit::Told;

type LengthRow = SVector<f64, 9>;

/// Session whose next poses are wanted.
#[derive(Clone, Copy, Debug)]
pub struct PoseSearch<'a> {
    /// Placements so far.
    pub seen: &'a [Observation],
    /// Assumptions of a fit of a lower-triangular S, with the calibration so far as its start.
    pub given: &'a Assumptions<'a>,
    /// Information of the turns on the accelerometer.
    pub told: Option<&'a Told>,
    /// Scatter of specific force between placements, standard deviation, m/s².
    pub scatter: f64,
}

/// Poses to show next.
#[derive(Clone, Debug, Default)]
pub struct PosePlan {
    /// Directions of true specific force, in order, as indices of the candidates.
    pub poses: Vec<usize>,
    /// Largest variance of the length of any candidate before each of them, over that of a placement.
    pub unknown: Vec<f64>,
}

impl PosePlan {
    /// Share of the largest standard deviation of a length that is left after so many poses, at most all but one.
    pub fn left_after(&self, poses: usize) -> Option<f64> {
        Some((self.unknown.get(poses)? / self.unknown.first()?).sqrt())
    }
}

impl PoseSearch<'_> {
    /// Poses that are best shown next.
    pub fn best(&self, candidates: &[Vector3<f64>], count: usize) -> PosePlan {
        let mut information = self.information();
        let noise = self.noise();
        let rows: Vec<LengthRow> = candidates.iter().map(|up| self.row(&self.reading(up, noise, 0.0))).collect();
        let mut plan = PosePlan::default();
        for _ in 0..count {
            let Some(factor) = information.cholesky() else { break };
            let uncertainty = |row: &LengthRow| row.dot(&factor.solve(row));
            // Among equals the first, which is the easiest to hold.
            let of_all = rows.iter().map(uncertainty).enumerate();
            let Some((pose, unknown)) = of_all.reduce(|best, other| if other.1 > 1.01 * best.1 { other } else { best })
            else {
                break;
            };
            information += rows[pose] * rows[pose].transpose();
            plan.poses.push(pose);
            plan.unknown.push(unknown);
        }
        plan
    }

    /// Placements as they would be after these: each reads as calibrated, off in either direction in turn by the scatter and
    /// what is not known of the calibration there.
    pub fn after<'b>(&self, ups: impl IntoIterator<Item = &'b Vector3<f64>>) -> Vec<Observation> {
        /// Largest variance of what is not known that counts, over that of a placement: more is a parameter that the
        /// placement itself determines.
        const MOST: f64 = 1.0;
        let noise = self.noise();
        let next = self.seen.iter().map(|seen| seen.placement).max().map_or(0, |last| last.saturating_add(1));
        let mut information = self.information();
        let mut seen = self.seen.to_vec();
        for (k, up) in ups.into_iter().enumerate() {
            let row = self.row(&self.reading(up, noise, 0.0));
            let unknown = information.cholesky().map_or(MOST, |factor| row.dot(&factor.solve(&row)).min(MOST));
            information += row * row.transpose();
            let off = self.scatter * (1.0 + unknown).sqrt() * if k % 2 == 0 { 1.0 } else { -1.0 };
            seen.push(Observation { placement: next.saturating_add(k as u32), ..self.reading(up, noise, off) });
        }
        seen
    }

    /// Information of the placements and turns about the parameters; entries off the diagonal have their assumed size.
    fn information(&self) -> SMatrix<f64, 9, 9> {
        let mut information = self.told.map_or(SMatrix::<f64, 9, 9>::zeros(), |told| told.information);
        for (i, term) in Parameterisation::TRIANGULAR.terms().iter().enumerate() {
            if matches!(term, Term::Own(row, column) if row != column) {
                information[(i, i)] += 1.0 / self.given.cross_axis_std.max(1e-6).powi(2);
            }
        }
        for seen in self.seen {
            let row = self.row(seen);
            information += row * row.transpose();
        }
        information
    }

    /// Variance of a typical mean by noise, per axis.
    fn noise(&self) -> Vector3<f64> {
        self.seen.iter().map(|seen| seen.noise).sum::<Vector3<f64>>() / self.seen.len().max(1) as f64
    }

    fn reading(&self, up: &Vector3<f64>, noise: Vector3<f64>, off: f64) -> Observation {
        let mean = self.given.start.measure(&(up * (self.given.gravity.value + off)));
        Observation { placement: 0, mean, noise, normal: *up }
    }

    /// Derivative of the corrected length with respect to the parameters, over the standard deviation of the length.
    fn row(&self, seen: &Observation) -> LengthRow {
        let MagnitudeEquation { by_measured, truth, noise, .. } =
            MagnitudeEquation::of(seen, self.given, &self.given.start);
        let std = (noise + by_measured.norm_squared() * self.scatter * self.scatter).sqrt().max(f64::MIN_POSITIVE);
        let terms = Parameterisation::TRIANGULAR.terms().iter();
        LengthRow::from_iterator(terms.map(|term| by_measured[term.axis()] * term.regressor(&Truth { ..truth }) / std))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Bounds, Calibration, Estimator, Fixture, Gravity, Loss};
    use super::*;

    fn given(bounds: &Bounds) -> Assumptions<'_> {
        Assumptions {
            shape: Parameterisation::TRIANGULAR,
            estimator: Estimator::Magnitude,
            gravity: Gravity::configured(9.8),
            placement_std: 0.01,
            cross_axis_std: 0.01,
            nonlinearity: 0.0,
            loss: Loss::Square,
            bounds,
            start: Calibration::default(),
        }
    }

    fn at(up: Vector3<f64>) -> Observation {
        Observation { placement: 0, mean: up * 9.8, noise: Vector3::repeat(1e-8), normal: up }
    }

    #[test]
    fn after_six_faces_each_entry_off_the_diagonal_is_asked_for_by_an_edge_of_its_own() {
        let (bounds, fixture) = (Bounds::default(), Fixture::cube());
        let seen: Vec<_> = fixture.faces().iter().map(|face| at(face.normal)).collect();
        let given = given(&bounds);
        let search = PoseSearch { seen: &seen, given: &given, told: None, scatter: 0.01 };
        let candidates: Vec<_> = fixture.poses().into_iter().map(|(_, up)| up).collect();
        let planes =
            search.best(&candidates, 3).poses.into_iter().map(|pose| candidates[pose].map(|part| part.abs() > 0.1));
        let mut planes: Vec<_> = planes.map(|plane| (plane.x, plane.y, plane.z)).collect();
        planes.sort_unstable();
        assert_eq!(planes, [(false, true, true), (true, false, true), (true, true, false)]);
    }

    #[test]
    fn a_face_that_was_seen_less_often_than_the_others_comes_first() {
        let (bounds, fixture) = (Bounds::default(), Fixture::cube());
        let poses = fixture.poses();
        // Every pose four times, one face once.
        let seen = poses.iter().flat_map(|(name, up)| vec![at(*up); if name == "-Y" { 1 } else { 4 }]);
        let seen: Vec<_> = seen.collect();
        let given = given(&bounds);
        let search = PoseSearch { seen: &seen, given: &given, told: None, scatter: 0.01 };
        let candidates: Vec<_> = poses.iter().map(|(_, up)| *up).collect();
        assert_eq!(poses[search.best(&candidates, 1).poses[0]].0, "-Y");
    }
}
