//! Phase-space state `(q, p)` with the rounding errors of its updates carried along.

use crate::scalar::{Real, Scalar};

/// A vector that is updated by small increments; what an update rounds away is added to the next one.
///
/// The value is `high + low` (Kahan 1965, Moller 1965): rounding errors of the updates do not accumulate, so that what
/// is left in a long run are the errors of the increments themselves, a factor `h` smaller.
#[derive(Clone, Debug)]
pub(super) struct Compensated<S> {
    /// Rounded value.
    pub(super) high: Vec<S>,
    /// Rests that the rounding lost.
    pub(super) low: Vec<S>,
}

impl<S: Scalar> Compensated<S> {
    /// An exact value.
    pub(super) fn new(high: Vec<S>) -> Self {
        let low = vec![<S as Real>::zero(); high.len()];
        Self { high, low }
    }

    /// Adds an increment to component `i`.
    #[inline]
    pub(super) fn add(&mut self, i: usize, increment: S) {
        let (high, term) = (self.high[i], self.low[i] + increment);
        let sum = high + term;
        // Knuth's error of a sum, whichever term is larger.
        let shifted = sum - high;
        self.low[i] = (high - (sum - shifted)) + (term - shifted);
        self.high[i] = sum;
    }
}

/// Coordinates and conjugate momenta `p = dL/dv`.
#[derive(Clone, Debug)]
pub(super) struct State<S> {
    pub(super) q: Compensated<S>,
    pub(super) p: Compensated<S>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_million_tenths_in_single_precision() {
        let mut sum = Compensated::new(vec![0.0_f32]);
        (0..10_000_000).for_each(|_| sum.add(0, 0.1));
        let exact = f64::from(0.1_f32) * 1e7;
        assert!((f64::from(sum.high[0]) - exact).abs() <= exact * f64::from(f32::EPSILON));
    }
}
