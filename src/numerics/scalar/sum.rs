//! Sums that do not drift.

use super::{Real, Scalar};

/// A running sum in twice the working precision (Dekker 1971): `N` terms err by about `N eps^2` of the largest partial
/// sum, less than one rounding for any number of terms that a machine can add.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sum<S> {
    /// Rounded sum.
    total: S,
    /// Rest that rounding left, at most half a unit in the last place of `total`.
    rest: S,
}

impl<S: Scalar> Default for Sum<S> {
    fn default() -> Self {
        Self { total: <S as Real>::zero(), rest: <S as Real>::zero() }
    }
}

impl<S: Scalar> Sum<S> {
    /// Adds a term.
    #[inline]
    pub fn add(&mut self, term: S) {
        let sum = self.total + term;
        if !sum.is_finite() {
            *self = Self { total: sum, rest: <S as Real>::zero() };
            return;
        }
        let (large, small) = if self.total.abs() >= term.abs() { (self.total, term) } else { (term, self.total) };
        let rest = self.rest + ((large - sum) + small);
        self.total = sum + rest;
        self.rest = (sum - self.total) + rest;
    }
    /// The sum so far. `NaN` or infinite if a term was.
    #[inline]
    pub fn value(&self) -> S {
        self.total
    }
}

impl<S: Scalar> Extend<S> for Sum<S> {
    fn extend<I: IntoIterator<Item = S>>(&mut self, terms: I) {
        terms.into_iter().for_each(|term| self.add(term));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_million_tenths_in_single_precision() {
        let mut sum = Sum::default();
        (0..10_000_000).for_each(|_| sum.add(0.1_f32));
        let exact = 0.1_f32 as f64 * 1e7;
        assert!((sum.value() as f64 - exact).abs() <= exact * f64::from(f32::EPSILON));
    }

    #[test]
    fn large_terms_cancel_without_a_trace() {
        let mut sum = Sum::default();
        sum.extend([1.0, 1e16, 1.0, -1e16]);
        assert_eq!(sum.value(), 2.0);
    }

    #[test]
    fn not_a_number_stays() {
        let mut sum = Sum::default();
        sum.extend([1.0, f64::NAN, 2.0]);
        assert!(sum.value().is_nan());
        let mut sum = Sum::default();
        sum.extend([1.0, f64::INFINITY, 2.0]);
        assert_eq!(sum.value(), f64::INFINITY);
    }
}
