//! Means and deviations of a triad over short spans of time, in memory that does not grow with the recording: what near misses
//! are told by, whichever comes first, the readings or the states.

use nalgebra::Vector3;

use crate::Stamp;
use crate::imu::Sample;

/// Most spans that are kept; when they are full, neighbours are merged.
const SPANS: usize = 8192;
/// Length of a span at first, ns: about the window of the statistic.
const WIDTH: i64 = 250_000_000;
/// Fewest readings that tell a deviation.
const FEWEST: f64 = 5.0;

/// Spans of a triad's readings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SpanMeans {
    origin: Option<Stamp>,
    width: i64,
    spans: Vec<Sums>,
}

impl Default for SpanMeans {
    fn default() -> Self {
        Self { origin: None, width: WIDTH, spans: Vec::new() }
    }
}

/// Sums over the readings of a span.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sums {
    count: f64,
    /// Mean of the readings.
    pub(super) mean: Vector3<f64>,
    squares: f64,
}

impl Sums {
    fn push(&mut self, value: Vector3<f64>) {
        self.count += 1.0;
        let off = value - self.mean;
        self.mean += off / self.count;
        self.squares += off.dot(&(value - self.mean));
    }

    fn and(self, other: Self) -> Self {
        let count = self.count + other.count;
        if count <= 0.0 {
            return self;
        }
        let off = other.mean - self.mean;
        let mean = self.mean + off * (other.count / count);
        Self {
            count,
            mean,
            squares: self.squares + other.squares + off.norm_squared() * self.count * other.count / count,
        }
    }

    /// √(Σ variance of the axes).
    pub(super) fn deviation(&self) -> f64 {
        (self.squares / self.count.max(1.0)).max(0.0).sqrt()
    }
}

impl SpanMeans {
    /// Takes a sample. Ignores one from before the first, and one that is not finite.
    pub(super) fn push(&mut self, sample: &Sample) {
        let since = sample.stamp.since(*self.origin.get_or_insert(sample.stamp));
        if since < 0 || !sample.value.iter().all(|axis| axis.is_finite()) {
            return;
        }
        while since / self.width >= SPANS as i64 {
            self.width = self.width.saturating_mul(2);
            let pairs = self.spans.chunks(2).map(|pair| pair.iter().copied().fold(Sums::default(), Sums::and));
            self.spans = pairs.collect();
        }
        let at = (since / self.width) as usize;
        self.spans.resize(self.spans.len().max(at + 1), Sums::default());
        if let Some(span) = self.spans.get_mut(at) {
            span.push(sample.value);
        }
    }

    /// Quietest span from one stamp to another, ns: the stamp of its middle, and its sums.
    pub(super) fn quietest(&self, from: i64, until: i64) -> Option<(i64, Sums)> {
        let origin = self.origin?.nanos();
        let place = |stamp: i64| usize::try_from(stamp.saturating_sub(origin) / self.width).ok();
        let (first, last) = (place(from)?, place(until)?);
        let told = self.spans.iter().enumerate().take(last.saturating_add(1)).skip(first);
        let told = told.filter(|(_, sums)| sums.count >= FEWEST);
        let (at, sums) = told.min_by(|(_, a), (_, b)| a.deviation().total_cmp(&b.deviation()))?;
        Some((origin.saturating_add(self.width.saturating_mul(at as i64)).saturating_add(self.width / 2), *sums))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn push(span_means: &mut SpanMeans, millis: i64, value: [f64; 3]) {
        let stamp = Stamp::from_nanos(millis * 1_000_000);
        span_means.push(&Sample { stamp, log_time: 0, value: value.into() });
    }

    #[test]
    fn the_quietest_span_is_found_and_memory_is_bounded() {
        let mut span_means = SpanMeans::default();
        for i in 0..3_000_i64 {
            let shake = if (1000..1100).contains(&i) { 0.01 } else { 1.0 };
            push(&mut span_means, 10 * i, [(i as f64).sin() * shake, 0.0, 9.8]);
        }
        let (at, sums) = span_means.quietest(0, i64::MAX).unwrap();
        assert!((10_000_000_000..11_000_000_000).contains(&at), "{at}");
        assert!(sums.deviation() < 0.01 && (sums.mean.z - 9.8).abs() < 1e-9, "{sums:?}");
        assert!(span_means.quietest(20_000_000_000, 21_000_000_000).unwrap().1.deviation() > 0.5);
        // A year later.
        for i in 0..100 {
            push(&mut span_means, 31_536_000_000 + 10 * i, [0.0, 0.0, 9.8]);
        }
        push(&mut span_means, 31_536_000_000, [f64::NAN, 0.0, 0.0]);
        push(&mut span_means, -5, [0.0, 0.0, 0.0]);
        assert!(span_means.spans.len() <= SPANS);
        assert_eq!(span_means.spans.iter().map(|sums| sums.count).sum::<f64>(), 3_100.0);
        assert_eq!(SpanMeans::default().quietest(0, 1), None);
    }
}
