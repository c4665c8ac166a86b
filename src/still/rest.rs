//! Rest: mean and noise of the triads of an IMU during a zero-velocity segment.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::alternation::Phases;
use super::moments::Moments;
use super::saturation::ReadingRange;
use super::sketch::{Sketch, Sketcher};
use crate::Stamp;
use crate::imu::Sensor;

/// Zero-velocity segment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rest {
    /// Stamp of the first sample.
    pub start: Stamp,
    /// Stamp of the last sample.
    pub end: Stamp,
    /// Number of the placement; rests between which the sensor was not moved away share one.
    pub placement: u32,
    /// Whether it follows a rest that ended by creep, with nothing loud in between: both are pieces of a slide.
    pub crept: bool,
    /// Readings of the primary accelerometer, m/s².
    pub accelerometer: TriadMean,
    /// Readings of the gyroscope, rad/s, if there is one.
    pub gyroscope: Option<TriadMean>,
    /// Readings of the secondary accelerometers in the order of the configuration, m/s²; `None` where one was silent.
    pub secondary: Vec<Option<TriadMean>>,
    /// Mean temperature of the sensor, °C, if the recording has it.
    pub temperature: Option<f64>,
}

impl Rest {
    /// Duration, s.
    pub fn seconds(&self) -> f64 {
        self.end.seconds_since(self.start)
    }

    /// Removes the readings of a triad; `None` without the primary accelerometer.
    pub fn without(mut self, sensor: Sensor) -> Option<Self> {
        match sensor {
            Sensor::Accelerometer => return None,
            Sensor::Gyroscope => self.gyroscope = None,
            Sensor::Secondary(i) => {
                if let Some(mean) = self.secondary.get_mut(i) {
                    *mean = None;
                }
            }
            Sensor::Reference(_) => {}
        }
        Some(self)
    }
}

/// Mean and noise of one triad during a rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriadMean {
    /// Number of samples.
    pub samples: u64,
    /// Effective number: as many uncorrelated samples would determine the mean equally well.
    pub effective: f64,
    /// Mean of the samples.
    pub mean: Vector3<f64>,
    /// Covariance of one sample.
    pub covariance: Matrix3<f64>,
    /// Change of each axis from start to end along the line of best fit.
    pub trend: Vector3<f64>,
    /// Standard deviation of the length of the trend from noise; the trend itself is not counted as noise.
    pub trend_noise: f64,
    /// Means of the first and of the last complete window; the overall mean if no window is complete.
    pub ends: [Vector3<f64>; 2],
    /// Lowest and highest readings.
    pub extremes: ReadingRange,
    /// Number of samples that the driver reported as clipped.
    pub clipped: u64,
    /// Sketch of the samples, by which copies are recognised.
    pub sketch: Sketch,
}

impl TriadMean {
    /// Standard deviation of one sample, per axis.
    pub fn std(&self) -> Vector3<f64> {
        self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt())
    }

    /// √(Σ variance of the axes) of one sample.
    pub fn deviation(&self) -> f64 {
        self.covariance.trace().max(0.0).sqrt()
    }

    /// Variance of the mean, per axis.
    pub fn mean_variance(&self) -> Vector3<f64> {
        self.covariance.diagonal().map(|variance| variance.max(0.0)) / self.effective.max(1.0)
    }
}

/// Variance inflation of a mean due to correlation between the samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Correlation {
    /// Variance of the means of batches, relative to that without correlation. By chance it may be below one.
    inflation: f64,
    /// Weight of this estimate: the number of batches less one.
    weight: f64,
}

impl Correlation {
    /// Unknown correlation.
    pub(super) const UNKNOWN: Self = Self { inflation: 1.0, weight: 0.0 };

    /// Weighted mean of both.
    pub(super) fn and(self, other: Self) -> Self {
        let weight = self.weight + other.weight;
        if weight <= 0.0 {
            return Self::UNKNOWN;
        }
        Self { inflation: (self.inflation * self.weight + other.inflation * other.weight) / weight, weight }
    }

    /// Same correlation, with a weight of at most `weight`.
    fn at_most(self, weight: f64) -> Self {
        Self { weight: self.weight.min(weight), ..self }
    }
}

/// Running sums over the open rest of one triad, in constant memory.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Sums {
    start: Stamp,
    all: Moments,
    phases: Phases,
    batch_size: u64,
    batch: Vector3<f64>,
    batch_count: u64,
    /// Moments of the means of complete batches.
    batches: Moments,
    /// First and last of these means.
    ends: Option<[Vector3<f64>; 2]>,
    extremes: Option<ReadingRange>,
    /// Mean of the times since start, their sum of squared deviations, and their sum of products with the values.
    time_mean: f64,
    time_squares: f64,
    time_products: Vector3<f64>,
    bounds: Option<(Stamp, Stamp)>,
    clipped: u64,
    sketcher: Sketcher,
}

impl Sums {
    pub(super) fn new(start: Stamp, batch_size: usize) -> Self {
        Self {
            start,
            all: Moments::default(),
            phases: Phases::default(),
            batch_size: batch_size.max(1) as u64,
            batch: Vector3::zeros(),
            batch_count: 0,
            batches: Moments::default(),
            ends: None,
            extremes: None,
            time_mean: 0.0,
            time_squares: 0.0,
            time_products: Vector3::zeros(),
            bounds: None,
            clipped: 0,
            sketcher: Sketcher::default(),
        }
    }

    pub(super) fn push(&mut self, stamp: Stamp, value: &Vector3<f64>) {
        self.all.push(value);
        self.sketcher.push(value);
        let time = stamp.seconds_since(self.start);
        let before = time - self.time_mean;
        self.time_mean += before * self.all.share();
        self.time_squares += before * (time - self.time_mean);
        self.time_products += (value - self.all.mean()) * before;
        let first = self.bounds.map_or(stamp, |(first, _)| first);
        self.bounds = Some((first, stamp));

        match &mut self.extremes {
            Some(extremes) => extremes.push(value),
            None => self.extremes = Some(ReadingRange::of(value)),
        }

        self.batch += value;
        self.batch_count += 1;
        if self.batch_count == self.batch_size {
            let mean = self.batch / self.batch_size as f64;
            self.batches.push(&mean);
            self.ends = Some([self.ends.map_or(mean, |[first, _]| first), mean]);
            (self.batch, self.batch_count) = (Vector3::zeros(), 0);
        }
    }

    /// Takes a sample with its number in the stream.
    pub(super) fn push_numbered(&mut self, number: u64, stamp: Stamp, value: &Vector3<f64>) {
        self.phases.push(number, value);
        self.push(stamp, value);
    }

    pub(super) fn phases(&self) -> &Phases {
        &self.phases
    }

    /// Counts one of its samples as clipped.
    pub(super) fn clip(&mut self) {
        self.clipped += 1;
    }

    pub(super) fn start(&self) -> Stamp {
        self.start
    }

    /// Stamps of the first and the last sample.
    pub(super) fn bounds(&self) -> Option<(Stamp, Stamp)> {
        self.bounds
    }

    /// Sum of the variances of the axes so far.
    pub(super) fn variance(&self) -> f64 {
        self.all.variance()
    }

    /// Mean of all samples so far and their number, if there are any.
    pub(super) fn mean(&self) -> Option<(Vector3<f64>, u64)> {
        (self.all.count() > 0).then(|| (self.all.mean(), self.all.count()))
    }

    /// Summarises the readings of the triad, given the usual correlation of its earlier rests.
    pub(super) fn finish(&self, usual: Correlation) -> Option<TriadMean> {
        let correlation = self.correlation_about(self.all.variance(), self.batches.variance());
        Some(TriadMean {
            samples: self.all.count(),
            effective: self.effective(correlation, usual),
            mean: self.all.mean(),
            covariance: self.all.covariance(),
            trend: self.trend(),
            trend_noise: self.trend_noise(usual),
            ends: self.ends.unwrap_or([self.all.mean(); 2]),
            extremes: self.extremes?,
            clipped: self.clipped,
            sketch: self.sketcher.sketch(),
        })
    }

    /// Correlation of the noise; unknown for a rest that wanders, whose batches differ for another reason.
    pub(super) fn correlation(&self) -> Correlation {
        const WANDERS: f64 = 4.0;
        match self.trend().norm() > WANDERS * self.trend_noise(Correlation::UNKNOWN) {
            true => Correlation::UNKNOWN,
            false => self.correlation_about(self.all.variance(), self.batches.variance()),
        }
    }

    /// Trend: slope of the regression on time, times the duration.
    fn trend(&self) -> Vector3<f64> {
        let seconds = self.bounds.map_or(0.0, |(first, last)| last.seconds_since(first));
        if self.time_squares > 0.0 { self.time_products * (seconds / self.time_squares) } else { Vector3::zeros() }
    }

    /// Method of batch means (Conway 1963): for white noise, the variance of the means of `batch_size` samples is that
    /// of one sample over `batch_size`; any excess is correlation. Takes the variances of one sample and of a batch
    /// mean.
    fn correlation_about(&self, of_one: f64, of_batch: f64) -> Correlation {
        if self.batches.count() < 2 || of_one <= 0.0 {
            return Correlation::UNKNOWN;
        }
        let inflation = of_batch * self.batch_size as f64 / of_one;
        Correlation { inflation, weight: (self.batches.count() - 1) as f64 }
    }

    /// Effective number of samples. A few batches say little, and their chance result must not pass for correlation:
    /// the estimate is shrunk towards that of earlier rests, and towards white noise.
    fn effective(&self, own: Correlation, usual: Correlation) -> f64 {
        const WHITE: Correlation = Correlation { inflation: 1.0, weight: 2.0 };
        const USUAL: f64 = 20.0;
        /// Least inflation: values below one by chance count, since those above one by chance do, too.
        const LEAST: f64 = 0.8;
        let all = own.and(usual.at_most(USUAL)).and(WHITE);
        (self.all.count() as f64 / all.inflation.max(LEAST)).max(1.0)
    }

    /// Standard deviation of the trend from noise: over a rest it has √12 times the error of the mean. A slide is no
    /// correlation of the noise, so it is removed from both variances: a twelfth of its square.
    fn trend_noise(&self, usual: Correlation) -> f64 {
        let slide = self.trend().norm_squared() / 12.0;
        let of_one = (self.all.variance() - slide).max(0.0);
        let correlation = self.correlation_about(of_one, (self.batches.variance() - slide).max(0.0));
        let effective = self.effective(correlation, usual);
        (12.0 * of_one / effective).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Rest with first-order autoregressive noise of unit variance and a slope, at 100 Hz.
    fn rest(samples: usize, correlation: f64, slope: f64) -> TriadMean {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut sums = Sums::new(Stamp::default(), 25);
        let mut noise = Vector3::zeros();
        for i in 0..samples {
            let mut axis = || -> f64 { StandardNormal.sample(&mut rng) };
            let white = Vector3::new(axis(), axis(), axis());
            noise = noise * correlation + white * (1.0 - correlation * correlation).sqrt();
            let stamp = Stamp::from_nanos(i as i64 * 10_000_000);
            sums.push(stamp, &(noise + Vector3::x() * (slope * i as f64 * 0.01)));
        }
        sums.finish(Correlation::UNKNOWN).unwrap()
    }

    #[test]
    fn white_samples_all_count() {
        let rest = rest(6000, 0.0, 0.0);
        assert!(rest.effective > 0.8 * 6000.0, "{}", rest.effective);
    }

    #[test]
    fn correlated_samples_count_less() {
        // Their share is (1 − ρ)/(1 + ρ) in the limit of long batches.
        let rest = rest(6000, 0.8, 0.0);
        let share = rest.effective / 6000.0;
        assert!((0.08..0.22).contains(&share), "{share}");
    }

    #[test]
    fn the_trend_is_the_change_over_the_rest() {
        let rest = rest(6000, 0.0, 0.1);
        assert!((rest.trend.x - 6.0).abs() < 0.2 && rest.trend.y.abs() < 0.2, "{:?}", rest.trend);
    }
}
