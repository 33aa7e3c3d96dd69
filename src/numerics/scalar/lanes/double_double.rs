//! The pieces for `Dd`: its ordinary functions.

use super::{Exponential, Lanes};
use crate::scalar::{Dd, Real, Scalar};

impl Lanes for Dd {
    #[inline]
    fn lane_fused(self, factor: Self, summand: Self) -> Self {
        self * factor + summand
    }
    fn lane_exp(self) -> Exponential<Self> {
        // Three equal thirds reach below the smallest number together and are normal alone.
        let limit = Dd::of_f64(1600.0);
        let y = if self < -limit { -limit } else { self };
        let y = if y > limit { limit } else { y };
        let third = (y / Dd::of_f64(3.0)).exp();
        Exponential { mantissa: third, first: third, second: third, minus_one: y.exp_m1() }
    }
    fn lane_log1p_ratio(self) -> Self {
        if Real::abs(self).high() < 1e-200 { <Dd as Real>::one() } else { self.ln_1p() / self }
    }
    fn lane_normal_tail(self) -> Self {
        (self * Dd::SQRT_HALF).erfcx() * <Dd as Real>::half()
    }
    #[inline]
    fn lane_ln(self) -> Self {
        self.ln()
    }
    #[inline]
    fn fast_angle() -> Self {
        Dd::max_value()
    }
    #[inline]
    fn lane_sin_cos(self) -> (Self, Self) {
        self.sin_cos()
    }
}
