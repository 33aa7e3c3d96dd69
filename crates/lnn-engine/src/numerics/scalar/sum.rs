//! Sums that do not drift, and dot products of contiguous rows in explicit vectors, several at once, so that every number loaded is used more than once.

use super::{AnyFloat, Dd, Real, Scalar};
use crate::scalar::float::Foreign;
use pulp::Simd;

/// A running sum in twice the working precision (Dekker 1971): `N` terms err by about `N eps^2` of the largest partial
/// sum, less than one rounding for any number of terms that a machine can add.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sum<S> {
    /// Rounded sum.
    total: S,
    /// Remainder after rounding, at most half a unit in the last place of `total`.
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

/// Numbers with dot products.
pub trait Dots: Copy {
    /// Dot products of every row `a` with every row `b`, all of one length: those of `b[o]` in element `o`.
    ///
    /// Computes one partial sum per vector lane, which has smaller errors than a single running sum.
    fn dots<V: Simd, const R: usize, const O: usize>(simd: V, a: [&[Self]; R], b: [&[Self]; O]) -> [[Self; R]; O];
}

// Loops over indices, not closures, which would not inherit the instruction set.
macro_rules! dots_in_vectors {
    ($number:ty, $vector:ident, $split:ident, $splat:ident, $load:ident, $multiply_add:ident, $sum:ident) => {
        impl Dots for $number {
            #[inline(always)]
            fn dots<V: Simd, const R: usize, const O: usize>(
                simd: V,
                a: [&[Self]; R],
                b: [&[Self]; O],
            ) -> [[Self; R]; O] {
                let mut left: [(&[V::$vector], &[Self]); R] = [(&[], &[]); R];
                let mut right: [(&[V::$vector], &[Self]); O] = [(&[], &[]); O];
                for r in 0..R {
                    left[r] = V::$split(a[r]);
                }
                for o in 0..O {
                    right[o] = V::$split(b[o]);
                }
                let (count, rest) = (left[0].0.len(), left[0].1.len());
                for r in 0..R {
                    assert!(left[r].0.len() == count && left[r].1.len() == rest);
                }
                for o in 0..O {
                    assert!(right[o].0.len() == count && right[o].1.len() == rest);
                }
                let mut sums = [[simd.$splat(0.0); R]; O];
                let mut own = [simd.$splat(0.0); R];
                for k in 0..count {
                    for r in 0..R {
                        own[r] = left[r].0[k];
                    }
                    for o in 0..O {
                        let other = right[o].0[k];
                        for r in 0..R {
                            sums[o][r] = simd.$multiply_add(other, own[r], sums[o][r]);
                        }
                    }
                }
                if rest > 0 {
                    for r in 0..R {
                        own[r] = simd.$load(left[r].1);
                    }
                    for o in 0..O {
                        let other = simd.$load(right[o].1);
                        for r in 0..R {
                            sums[o][r] = simd.$multiply_add(other, own[r], sums[o][r]);
                        }
                    }
                }
                let mut totals = [[0.0; R]; O];
                for o in 0..O {
                    for r in 0..R {
                        totals[o][r] = simd.$sum(sums[o][r]);
                    }
                }
                totals
            }
        }
    };
}

dots_in_vectors!(f32, f32s, as_simd_f32s, splat_f32s, partial_load_f32s, mul_add_e_f32s, reduce_sum_f32s);
dots_in_vectors!(f64, f64s, as_simd_f64s, splat_f64s, partial_load_f64s, mul_add_e_f64s, reduce_sum_f64s);

/// Dot products by loops, for numbers without vectors: four partial sums.
macro_rules! dots_in_loops {
    ($zero:expr) => {
        #[inline(always)]
        fn dots<V: Simd, const R: usize, const O: usize>(_: V, a: [&[Self]; R], b: [&[Self]; O]) -> [[Self; R]; O] {
            const PARTS: usize = 4;
            let zero: Self = $zero;
            let mut totals = [[zero; R]; O];
            for o in 0..O {
                for r in 0..R {
                    assert!(a[r].len() == b[o].len());
                    let mut parts = [zero; PARTS];
                    for (k, &x) in a[r].iter().enumerate() {
                        parts[k % PARTS] += x * b[o][k];
                    }
                    totals[o][r] = (parts[0] + parts[1]) + (parts[2] + parts[3]);
                }
            }
            totals
        }
    };
}

impl Dots for Dd {
    dots_in_loops!(<Self as num_traits::Zero>::zero());
}

impl<F: Foreign> Dots for AnyFloat<F> {
    dots_in_loops!(<Self as num_traits::Zero>::zero());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Scalar;

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

    struct All<S>(std::marker::PhantomData<S>);

    impl<S: Scalar> pulp::WithSimd for All<S> {
        type Output = ();
        fn with_simd<V: Simd>(self, simd: V) {
            for length in [0, 1, 3, 7, 8, 15, 16, 17, 40, 67] {
                // Small integers: every product and sum is exact in every precision.
                let row = |seed: usize| -> Vec<S> {
                    (0..length).map(|k| S::of_f64(((k * 7 + seed * 5) % 11) as f64 - 5.0)).collect()
                };
                let (a, b) = ([row(1), row(2), row(3)], [row(4), row(5)]);
                let found = S::dots(simd, [&a[0][..], &a[1][..], &a[2][..]], [&b[0][..], &b[1][..]]);
                for (found, b) in found.iter().zip(&b) {
                    for (found, a) in found.iter().zip(&a) {
                        let sum = a.iter().zip(b).fold(S::of_f64(0.0), |sum, (&x, &y)| sum + x * y);
                        assert!(*found == sum, "{} numbers", length);
                    }
                }
            }
        }
    }

    #[test]
    fn dot_products_of_integers_are_exact() {
        pulp::Arch::new().dispatch(All::<f32>(std::marker::PhantomData));
        pulp::Arch::new().dispatch(All::<f64>(std::marker::PhantomData));
        pulp::Arch::new().dispatch(All::<Dd>(std::marker::PhantomData));
        pulp::Arch::new().dispatch(All::<AnyFloat<f64>>(std::marker::PhantomData));
    }
}
