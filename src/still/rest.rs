//! What the triads of an IMU read while it rested.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::moments::Moments;
use super::saturation::ReadingRange;
use crate::Stamp;
use crate::imu::Sensor;

/// One zero-velocity segment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rest {
    /// First sample.
    pub start: Stamp,
    /// Last sample.
    pub end: Stamp,
    /// Rests with no motion between them share a number.
    pub placement: u32,
    /// Whether it follows one whose mean wandered off, with nothing loud between them: both are pieces of a slide.
    pub crept: bool,
    /// The primary accelerometer, m/s².
    pub accelerometer: TriadMean,
    /// The gyroscope, rad/s, if there is one.
    pub gyroscope: Option<TriadMean>,
    /// The secondary accelerometers in the order of the configuration, m/s²; absent where one was silent.
    pub secondary: Vec<Option<TriadMean>>,
}

impl Rest {
    /// Length in seconds.
    pub fn seconds(&self) -> f64 {
        self.end.seconds_since(self.start)
    }

    /// The same without what a triad read; nothing is left without the primary accelerometer.
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
    /// How many samples.
    pub samples: u64,
    /// How many uncorrelated samples would have told as much.
    pub effective: f64,
    /// Their mean.
    pub mean: Vector3<f64>,
    /// Covariance of one sample.
    pub covariance: Matrix3<f64>,
    /// Change of each axis from start to end along the line of best fit.
    pub trend: Vector3<f64>,
    /// Standard deviation that noise gives the length of the trend, itself not counted as noise.
    pub trend_noise: f64,
    /// Means of the first and of the last whole window; of everything where no window is whole.
    pub ends: [Vector3<f64>; 2],
    /// Lowest and highest readings.
    pub extremes: ReadingRange,
    /// How many samples the driver called clipped.
    pub clipped: u64,
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

/// By how much the mean of correlated samples varies more than that of as many uncorrelated ones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Correlation {
    /// Variance of the means of batches over what it would be without correlation. By chance it may be below one.
    inflation: f64,
    /// How much that is worth: one batch less than there were.
    weight: f64,
}

impl Correlation {
    /// Nothing is known of it.
    pub(super) const UNKNOWN: Self = Self { inflation: 1.0, weight: 0.0 };

    /// Both together.
    pub(super) fn and(self, other: Self) -> Self {
        let weight = self.weight + other.weight;
        if weight <= 0.0 {
            return Self::UNKNOWN;
        }
        Self { inflation: (self.inflation * self.weight + other.inflation * other.weight) / weight, weight }
    }

    /// The same, worth no more than so many batches.
    fn at_most(self, weight: f64) -> Self {
        Self { weight: self.weight.min(weight), ..self }
    }
}

/// Sums over the open rest of one triad, in constant memory.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Sums {
    start: Stamp,
    all: Moments,
    batch_size: u64,
    batch: Vector3<f64>,
    batch_count: u64,
    /// Of the means of whole batches.
    batches: Moments,
    /// The first and the last of them.
    ends: Option<[Vector3<f64>; 2]>,
    extremes: Option<ReadingRange>,
    /// Mean of the times since start, their sum of squared deviations, and that with the values.
    time_mean: f64,
    time_squares: f64,
    time_products: Vector3<f64>,
    bounds: Option<(Stamp, Stamp)>,
    clipped: u64,
}

impl Sums {
    pub(super) fn new(start: Stamp, batch_size: usize) -> Self {
        Self {
            start,
            all: Moments::default(),
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
        }
    }

    pub(super) fn push(&mut self, stamp: Stamp, value: &Vector3<f64>) {
        self.all.push(value);
        let time = stamp.seconds_since(self.start);
        let before = time - self.time_mean;
        self.time_mean += before / self.all.count() as f64;
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

    /// One of its samples was clipped.
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

    /// Σ variance of the axes so far.
    pub(super) fn variance(&self) -> f64 {
        self.all.variance()
    }

    /// The mean of everything so far and its count, if there is anything.
    pub(super) fn mean(&self) -> Option<(Vector3<f64>, u64)> {
        (self.all.count() > 0).then(|| (self.all.mean(), self.all.count()))
    }

    /// What the triad read, given how correlated its earlier rests were.
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
        })
    }

    /// How correlated the noise is; nothing is said of a rest that wanders, whose batches differ for another reason.
    pub(super) fn correlation(&self) -> Correlation {
        const WANDERS: f64 = 4.0;
        match self.trend().norm() > WANDERS * self.trend_noise(Correlation::UNKNOWN) {
            true => Correlation::UNKNOWN,
            false => self.correlation_about(self.all.variance(), self.batches.variance()),
        }
    }

    /// Slope of the regression on time, times the duration.
    fn trend(&self) -> Vector3<f64> {
        let seconds = self.bounds.map_or(0.0, |(first, last)| last.seconds_since(first));
        if self.time_squares > 0.0 { self.time_products * (seconds / self.time_squares) } else { Vector3::zeros() }
    }

    /// Method of batch means (Conway 1963): if noise were white, the variance of the means of `batch_size` samples would
    /// be that of one sample over `batch_size`; what it is more is correlation. From the variances of one sample and of a
    /// batch mean.
    fn correlation_about(&self, of_one: f64, of_batch: f64) -> Correlation {
        if self.batches.count() < 2 || of_one <= 0.0 {
            return Correlation::UNKNOWN;
        }
        let inflation = of_batch * self.batch_size as f64 / of_one;
        Correlation { inflation, weight: (self.batches.count() - 1) as f64 }
    }

    /// As many uncorrelated samples. A few batches say little, and what they say by chance must not pass for correlation:
    /// the verdict is shrunk towards that of earlier rests, and towards white.
    fn effective(&self, own: Correlation, usual: Correlation) -> f64 {
        const WHITE: Correlation = Correlation { inflation: 1.0, weight: 2.0 };
        const USUAL: f64 = 20.0;
        /// Below one by chance; counted as such, since what is above one by chance is, too.
        const LEAST: f64 = 0.8;
        let all = own.and(usual.at_most(USUAL)).and(WHITE);
        (self.all.count() as f64 / all.inflation.max(LEAST)).max(1.0)
    }

    /// The trend of noise over a rest has √12 times the error of its mean. A slide is no correlation of the noise, so it
    /// is taken out of both variances: a twelfth of its square.
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

    /// First-order autoregressive noise of unit variance beside a slope, at 100 Hz.
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
        // (1 − ρ)/(1 + ρ) of them in the limit of long batches.
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
