//! Parts of a reading that come of another quantity: a gyroscope's of acceleration, an accelerometer's of rotation.

use crate::messages::{Calibration, Triad};

/// Coefficients of one such part, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossTerm {
    /// Its name.
    pub name: &'static str,
    /// Unit of its coefficients.
    pub unit: &'static str,
    /// Rows of coefficients, each with its standard deviations (0 where none is known).
    pub rows: Vec<[[f64; 3]; 2]>,
}

/// Parts of a triad's readings that come of another quantity.
pub fn cross_terms(triad: &Triad) -> Vec<CrossTerm> {
    let parts = [
        ("g-sensitivity", "rad/s per m/s²", &triad.g_sensitivity),
        ("sensitivity to rotation", "m/s² per rad/s", &triad.rate_sensitivity),
        ("g²-sensitivity", "rad/s per (m/s²)²", &triad.g2_sensitivity),
    ];
    // They are the last parameters of the covariance.
    let unknowns = triad.covariance.len().isqrt();
    let mut at = unknowns.saturating_sub(parts.iter().map(|(_, _, values)| values.len()).sum());
    let mut terms = Vec::new();
    for (name, unit, values) in parts {
        let std = |i: usize| triad.covariance.get(i * unknowns + i).map_or(0.0, |variance| variance.max(0.0).sqrt());
        let row = |(row, values): (usize, &[f64])| {
            let three = |of: &dyn Fn(usize) -> f64| [0, 1, 2].map(of);
            let first = at + 3 * row;
            [three(&|i| values.get(i).copied().unwrap_or_default()), three(&|i| std(first + i))]
        };
        let rows: Vec<_> = values.chunks(3).enumerate().map(row).collect();
        at += values.len();
        if !rows.is_empty() {
            terms.push(CrossTerm { name, unit, rows });
        }
    }
    terms
}

/// Direction of the numbers of a calibration, as a formula.
pub fn direction(calibration: Option<&Calibration>) -> String {
    let mut formula = "measured = bias + sensitivity * true".to_owned();
    let gyroscope = calibration.and_then(|calibration| calibration.gyroscope.as_ref());
    let has = |part: fn(&Triad) -> &[f64]| gyroscope.is_some_and(|triad| !part(triad).is_empty());
    let (linear, square) = (has(|triad| &triad.g_sensitivity), has(|triad| &triad.g2_sensitivity));
    if linear || square {
        formula += "; of the gyroscope";
        formula += if linear { " + g_sensitivity * true acceleration" } else { "" };
        formula += if square { " + g2_sensitivity * (true acceleration)^2, axis by axis" } else { "" };
    }
    let accelerometer = calibration.and_then(|calibration| calibration.accelerometer.as_ref());
    if accelerometer.is_some_and(|triad| !triad.rate_sensitivity.is_empty()) {
        formula += "; of the accelerometer + rate_sensitivity * true rate";
    }
    formula
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviations_of_cross_terms_are_the_last_of_the_covariance() {
        let variances: Vec<f64> = (0..21).map(|i| f64::from(i * i)).collect();
        let covariance = (0..21 * 21).map(|i| if i % 22 == 0 { variances[i / 22] } else { 0.5 }).collect();
        let g_sensitivity = (0..9).map(|i| 0.01 * f64::from(i)).collect();
        let triad = Triad { covariance, g_sensitivity, ..Triad::default() };
        let [term] = cross_terms(&triad).try_into().unwrap();
        assert_eq!(term.rows[1], [[0.03, 0.04, 0.05], [15.0, 16.0, 17.0]]);
        assert_eq!(cross_terms(&Triad { covariance: Vec::new(), ..triad })[0].rows[2][1], [0.0; 3]);
    }
}
