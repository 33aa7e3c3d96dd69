//! Sums that do not drift.

use super::{Real, Scalar};

/// A running sum with its rounding error carried along (Neumaier 1974): the error does not grow with the number of terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sum<S> {
    total: S,
    carried: S,
}

impl<S: Scalar> Default for Sum<S> {
    fn default() -> Self {
        Self { total: <S as Real>::zero(), carried: <S as Real>::zero() }
    }
}

impl<S: Scalar> Sum<S> {
    /// Adds a term.
    #[inline]
    pub fn add(&mut self, term: S) {
        let total = self.total + term;
        self.carried +=
            if self.total.abs() >= term.abs() { (self.total - total) + term } else { (term - total) + self.total };
        self.total = total;
    }
    /// The sum so far. `NaN` or infinite if a term was.
    #[inline]
    pub fn value(&self) -> S {
        if self.total.is_finite() { self.total + self.carried } else { self.total }
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
        sum.extend([1.0, 1e100, 1.0, -1e100]);
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
