//! Outline of a long signal in constant memory: the range of each axis in each of at most 1,024 spans of time.
//! [`plot`](super::plot) draws it.

use crate::Stamp;

/// Most spans that are kept; when they are full, neighbours are merged.
const SPANS: usize = 1024;

/// Outline of a signal with N axes.
#[derive(Clone, Debug)]
pub struct Envelope<const N: usize> {
    origin: Option<Stamp>,
    /// Length of a span, ns.
    width: i64,
    spans: Vec<Option<[Range; N]>>,
    /// Number of samples taken.
    samples: u64,
    last: Stamp,
}

/// Range of an axis in a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

impl<const N: usize> Default for Envelope<N> {
    fn default() -> Self {
        Self { origin: None, width: 1_000_000, spans: Vec::new(), samples: 0, last: Stamp::default() }
    }
}

impl<const N: usize> Envelope<N> {
    /// Takes a sample. Ignores one from before the first, and one that is not finite.
    pub fn push(&mut self, stamp: Stamp, value: [f64; N]) {
        let since = stamp.since(*self.origin.get_or_insert(stamp));
        if since < 0 || value.iter().any(|value| !value.is_finite()) {
            return;
        }
        while since / self.width >= SPANS as i64 {
            self.merge();
        }
        let span = (since / self.width) as usize;
        self.spans.resize(self.spans.len().max(span + 1), None);
        let Some(place) = self.spans.get_mut(span) else { return };
        let ranges = place.get_or_insert(value.map(|value| Range { low: value, high: value }));
        for (range, value) in ranges.iter_mut().zip(value) {
            *range = Range { low: range.low.min(value), high: range.high.max(value) };
        }
        self.samples += 1;
        self.last = self.last.max(stamp);
    }

    /// First and last stamp; `None` without samples.
    pub fn span(&self) -> Option<(Stamp, Stamp)> {
        self.origin.map(|origin| (origin, self.last.max(origin)))
    }

    /// The ranges in time order, each at the middle of its span, split where the signal was silent.
    pub fn runs(&self) -> Vec<Vec<(Stamp, [Range; N])>> {
        let Some(origin) = self.origin else { return Vec::new() };
        let filled = self.spans.iter().flatten().count().max(1);
        // Ten times the usual distance of filled spans counts as silence.
        let silence = 10 * self.spans.len() / filled;
        let mut runs = Vec::<Vec<_>>::new();
        let mut before = None;
        for (i, ranges) in self.spans.iter().enumerate() {
            let Some(ranges) = ranges else { continue };
            if before.is_none_or(|before| i - before > silence) {
                runs.push(Vec::new());
            }
            before = Some(i);
            let at = origin.plus_nanos(self.width / 2 + self.width.saturating_mul(i as i64));
            runs.last_mut().into_iter().for_each(|run| run.push((at, *ranges)));
        }
        runs
    }

    /// Smallest and largest value over all axes.
    pub fn range(&self) -> Option<Range> {
        let all = self.spans.iter().flatten().flatten().copied();
        all.reduce(|a, b| Range { low: a.low.min(b.low), high: a.high.max(b.high) })
    }

    fn merge(&mut self) {
        self.width = self.width.saturating_mul(2);
        let pairs = self.spans.chunks(2).map(|pair| {
            let both = pair.iter().copied().flatten();
            both.reduce(|a, b| {
                std::array::from_fn(|i| Range { low: a[i].low.min(b[i].low), high: a[i].high.max(b[i].high) })
            })
        });
        self.spans = pairs.collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_sample_lies_inside_and_memory_is_bounded(steps in prop::collection::vec((1_i64..100_000_000_000, -9.0..9.0), 1..3000)) {
            let mut envelope = Envelope::<1>::default();
            let mut now = 5;
            for &(step, value) in &steps {
                envelope.push(Stamp::from_nanos(now), [value]);
                now += step;
            }
            prop_assert!(envelope.spans.len() <= SPANS);
            let low = steps.iter().map(|(_, value)| *value).fold(f64::INFINITY, f64::min);
            let high = steps.iter().map(|(_, value)| *value).fold(f64::NEG_INFINITY, f64::max);
            prop_assert_eq!(envelope.range(), Some(Range { low, high }));
        }
    }

    #[test]
    fn a_silence_cuts_the_outline() {
        let mut envelope = Envelope::<1>::default();
        let stamps = (0..100).chain(300..400).map(|i| Stamp::from_nanos(i * 10_000_000));
        stamps.for_each(|stamp| envelope.push(stamp, [1.0]));
        envelope.push(Stamp::from_nanos(-1), [99.0]);
        envelope.push(Stamp::from_nanos(1), [f64::NAN]);
        assert_eq!(envelope.runs().len(), 2);
        assert_eq!(envelope.range(), Some(Range { low: 1.0, high: 1.0 }));
    }
}
