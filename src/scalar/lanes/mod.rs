//! Elementary functions over slices, and the branch-free pieces that vectorised formulas are put together from.

mod double_double;
mod pieces;

/// `e^y` in pieces, so that a product with it is rounded once even where it underflows.
///
/// `e^y = mantissa * first * second`: multiply what belongs together with `mantissa` first, then call
/// [`Exponential::scale`].
#[derive(Clone, Copy, Debug)]
pub struct Exponential<S> {
    /// The part of moderate size.
    pub mantissa: S,
    /// First factor.
    pub first: S,
    /// Second factor.
    pub second: S,
    /// `e^y - 1`, accurate near `y = 0`.
    pub minus_one: S,
}

impl<S: Copy + std::ops::Mul<Output = S>> Exponential<S> {
    /// `factor * first * second`, where `factor` contains the mantissa already.
    #[inline(always)]
    pub fn scale(self, factor: S) -> S {
        factor * self.first * self.second
    }
    /// `e^y`.
    #[inline(always)]
    pub fn value(self) -> S {
        self.scale(self.mantissa)
    }
}

/// What a scalar offers to loops over many numbers.
///
/// The `lane_*` functions have no branch and no call: a loop over them inside [`crate::scalar::vectorized`] becomes
/// vector instructions for `f32` and `f64`. Outside of it they are right but slow (a fused multiply-add without
/// hardware support is a library call). `Dd` answers with its ordinary functions.
pub trait Lanes: Sized + Copy {
    /// `self * factor + summand`, rounded once for `f32` and `f64`.
    fn lane_fused(self, factor: Self, summand: Self) -> Self;
    /// `e^self` in pieces for `self <= 0`; 0 far below the range, `NaN` for `NaN`.
    fn lane_decay(self) -> Exponential<Self>;
    /// `ln(1 + self) / self` for `0 <= self <= 1`; 1 at 0.
    fn lane_log1p_ratio(self) -> Self;
    /// `e^(a^2/2) * Phi(-a)` for `a = self >= 0`, with `Phi` the normal distribution function: half the scaled
    /// complementary error function of `a / sqrt(2)`.
    ///
    /// A polynomial in `(a - K) / (a + K)` over `a + K`, fitted at Chebyshev points with 50 digits (the substitution is
    /// that of M. M. Shepherd and J. G. Laframboise, Math. Comp. 36, 1981).
    fn lane_normal_tail(self) -> Self;
}
