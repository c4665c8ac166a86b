//! Readings of a triad at rest with their temperatures, those of a placement at like temperatures as one.

use nalgebra::Vector3;

/// Mean reading of a triad during one rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarmReading {
    /// Number of the placement.
    pub placement: u32,
    /// Time of the rest, s.
    pub time: f64,
    /// Mean temperature, °C.
    pub celsius: f64,
    /// Mean reading, m/s² or rad/s.
    pub mean: Vector3<f64>,
    /// Variance of the mean from noise alone, per axis.
    pub noise: Vector3<f64>,
}

/// Parts of the range of temperature within which consecutive rests of a placement count as one.
const PARTS: f64 = 24.0;

/// Readings by placement, in order of time; those of a placement that follow each other at like temperatures are pooled.
pub(super) fn pooled(readings: &[WarmReading], span: f64) -> Vec<Vec<WarmReading>> {
    let mut sorted = readings.to_vec();
    sorted.sort_by(|a, b| a.placement.cmp(&b.placement).then(a.time.total_cmp(&b.time)));
    let same = |a: &WarmReading, b: &WarmReading| a.placement == b.placement;
    sorted.chunk_by(same).map(|placement| pool(placement, span / PARTS)).collect()
}

fn pool(placement: &[WarmReading], width: f64) -> Vec<WarmReading> {
    let mut points = Vec::new();
    let mut rest = placement;
    while let Some(first) = rest.first() {
        let count = rest.iter().take_while(|reading| (reading.celsius - first.celsius).abs() <= width).count();
        let (own, others) = rest.split_at(count);
        points.push(mean(own));
        rest = others;
    }
    points
}

/// Mean of readings, weighted by their noise on all axes together, so that reading, temperature and time belong together.
pub(super) fn mean(readings: &[WarmReading]) -> WarmReading {
    let weight = |reading: &WarmReading| 1.0 / reading.noise.sum().max(f64::MIN_POSITIVE);
    let total: f64 = readings.iter().map(weight).sum();
    let mut mean = WarmReading {
        placement: readings.first().map_or(0, |reading| reading.placement),
        time: 0.0,
        celsius: 0.0,
        mean: Vector3::zeros(),
        noise: Vector3::zeros(),
    };
    for reading in readings {
        let share = weight(reading) / total;
        mean.time += share * reading.time;
        mean.celsius += share * reading.celsius;
        mean.mean += reading.mean * share;
        mean.noise += reading.noise * (share * share);
    }
    mean
}
