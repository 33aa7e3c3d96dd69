//! Times of the samples, worked out one by one: ten million of them take no memory.

use super::options::{Options, blur};
use crate::scalar::{Real, Scalar};

/// Elapsed times of samples, ascending from 0.
pub(super) trait Times<S> {
    /// Number of samples.
    fn len(&self) -> usize;
    /// Elapsed time of sample `k`, if there is one.
    fn get(&self, k: usize) -> Option<S>;
}

impl<S: Copy> Times<S> for Vec<S> {
    fn len(&self) -> usize {
        self.as_slice().len()
    }

    fn get(&self, k: usize) -> Option<S> {
        self.as_slice().get(k).copied()
    }
}

/// The samples that options ask for: `t0 + k dt`, and `t_end` as the last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Samples<S> {
    t0: S,
    t_end: S,
    /// `abs(dt)`, and the same with the direction of time.
    step: S,
    signed: S,
    /// Samples before the last.
    regular: usize,
}

impl<S: Scalar> Samples<S> {
    /// Of checked options.
    pub(super) fn new(options: &Options<S>) -> Self {
        let (t0, t_end) = (options.t0, options.t_end);
        let span = t_end - t0;
        let step = options.dt.abs();
        let signed = if span < <S as Real>::zero() { -step } else { step };
        let ratio = span.abs() / step;
        let blur = blur(options);
        let whole = (ratio + blur).floor();
        let count = whole.to_f64() as usize;
        let regular = if (ratio - whole).abs() <= blur { count } else { count + 1 };
        Self { t0, t_end, step, signed, regular }
    }

    /// Time of sample `k`.
    pub(super) fn time(&self, k: usize) -> S {
        if k < self.regular { self.t0 + S::of_f64(k as f64) * self.signed } else { self.t_end }
    }

    /// Elapsed time `abs(t - t0)` of sample `k`.
    pub(super) fn elapsed(&self, k: usize) -> S {
        if k < self.regular { S::of_f64(k as f64) * self.step } else { (self.t_end - self.t0).abs() }
    }
}

impl<S: Scalar> Samples<S> {
    /// Number of samples whose elapsed time is not beyond `end`.
    pub(super) fn count_until(&self, end: S) -> usize {
        let (mut low, mut high) = (0, self.len());
        while low < high {
            let middle = low + (high - low) / 2;
            if self.elapsed(middle) <= end { low = middle + 1 } else { high = middle }
        }
        low
    }
}

/// Samples `first..after` in time elapsed since `start`, and, if it is none of them, the end of their stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part<S> {
    pub(super) all: Samples<S>,
    pub(super) first: usize,
    pub(super) after: usize,
    pub(super) start: S,
    pub(super) end: Option<S>,
}

impl<S: Scalar> Times<S> for Part<S> {
    fn len(&self) -> usize {
        self.after - self.first + usize::from(self.end.is_some())
    }

    fn get(&self, k: usize) -> Option<S> {
        let sample = self.first + k;
        let elapsed = if sample < self.after { Some(self.all.elapsed(sample)) } else { self.end };
        elapsed.filter(|_| k < self.len()).map(|e| S::max(e - self.start, <S as Real>::zero()))
    }
}

impl<S: Scalar> Times<S> for Samples<S> {
    fn len(&self) -> usize {
        self.regular + 1
    }

    fn get(&self, k: usize) -> Option<S> {
        (k <= self.regular).then(|| self.elapsed(k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times<S: Scalar>(options: Options<S>) -> Vec<S> {
        let samples = Samples::new(&options);
        (0..samples.len()).map(|k| samples.time(k)).collect()
    }

    #[test]
    fn sample_times_are_the_requested_ones() {
        let times = |t0: f64, t_end: f64, dt: f64| times(Options { t0, ..Options::new(t_end, dt) });
        assert_eq!(times(0.0, 0.3, 0.1), [0.0, 0.1, 0.2, 0.3]);
        assert_eq!(times(0.0, 0.35, 0.1), [0.0, 0.1, 0.2, 0.1 * 3.0, 0.35]);
        assert_eq!(times(1.0, 0.0, 0.5), [1.0, 0.5, 0.0]);
        assert_eq!(times(-1.0, 1.0, -1.0), [-1.0, 0.0, 1.0]);
        assert_eq!(times(2.0, 2.0, 0.1), [2.0]);
        assert_eq!(times(0.0, 0.05, 0.1), [0.0, 0.05]);
        assert_eq!(times(0.0, 100.0, 0.1).len(), 1001);
        assert_eq!(times(1e6, 1e6 + 1.0, 0.1).len(), 11);
        let single = super::tests::times(Options::<f32>::new(100.0, 0.1));
        assert_eq!(single.len(), 1001);
        assert_eq!(*single.last().unwrap(), 100.0);
        // The last sample is the end, whatever the rounding of the quotient, and none lies beyond it.
        let many = Samples::new(&Options::<f32>::new(200_000.0, 1.0));
        assert_eq!((many.len(), many.get(200_000), many.get(200_001)), (200_001, Some(200_000.0), None));
    }
}
