//! Roots, powers, exponentials and logarithms.

use super::Dd;
use crate::scalar::{Real, Scalar};

const ONE: Dd = Dd::leading(1.0);
const HALF: Dd = Dd::leading(0.5);
pub(super) const LN_2: Dd = Dd { high: std::f64::consts::LN_2, low: 2.3190468138462996e-17 };
/// Rest of the logarithm of 2 behind `LN_2`.
const LN_2_REST: f64 = 5.707708438416212e-34;

impl Dd {
    /// Newton's correction of the root of the leading part (A. H. Karp and P. Markstein, ACM TOMS 23, 1997).
    pub(super) fn square_root(self) -> Self {
        let root = self.high.sqrt();
        if !(root > 0.0 && root.is_finite()) {
            return Self::leading(root);
        }
        // Away from the range where squares lose their trailing part.
        let shift = if self.high < 1e-200 {
            240
        } else if self.high > 1e200 {
            -240
        } else {
            0
        };
        if shift != 0 {
            return self.ldexp(2 * shift).square_root().ldexp(-shift);
        }
        let rest = self - Self::product(root, root);
        Self::sum(root, rest.high / (2.0 * root))
    }

    /// `(k, p)` with `e^self = 2^k (1 + p)`, for `|self| < 1e5`.
    ///
    /// Reduction by multiples of `ln 2` in three parts, the series at `r / 256`, then eight times
    /// `e^(2r) - 1 = 2 p + p^2`.
    fn exponential_parts(self) -> (i32, Self) {
        let k = (self.high * std::f64::consts::LOG2_E).round();
        let r = if k == 0.0 {
            self
        } else {
            let (first, second) = (Self::product(k, LN_2.high), Self::product(k, LN_2.low));
            let rest = Self::leading(self.low) - Self::leading(first.low) - second - Self::leading(k * LN_2_REST);
            Self::sum(self.high, -first.high) + rest
        };
        let s = r.ldexp(-8);
        let series = (2..=11).rev().fold(ONE, |sum, n| ONE + s / Self::leading(f64::from(n)) * sum);
        let p = (0..8).fold(s * series, |p, _| p + p + p * p);
        (k as i32, p)
    }

    pub(super) fn exponential(self) -> Self {
        if self.is_nan() {
            Self::nan()
        } else if self.high > 710.0 {
            Self::infinity()
        } else if self.high < -746.0 {
            Self::leading(0.0)
        } else {
            let (k, p) = self.exponential_parts();
            (ONE + p).ldexp(k)
        }
    }

    pub(super) fn exponential_minus_one(self) -> Self {
        if self.high.abs() < 1e-150 {
            self
        } else if self.high.abs() < 80.0 {
            let (k, p) = self.exponential_parts();
            if k == 0 { p } else { (ONE.ldexp(k) - ONE) + p.ldexp(k) }
        } else {
            self.exponential() - ONE
        }
    }

    /// One Newton step from the logarithm of the leading part.
    pub(super) fn logarithm(self) -> Self {
        if !(self.high > 0.0 && self.high.is_finite()) {
            return Self::leading(self.high.ln());
        }
        let offset = self - ONE;
        if offset.high.abs() < 0.25 {
            return offset.logarithm_one_plus();
        }
        let exponent = self.high.ilogb();
        let fraction = self.ldexp(-exponent);
        let start = Self::leading(fraction.high.ln());
        let mantissa = start + (fraction * (-start).exponential() - ONE);
        mantissa + Self::leading(f64::from(exponent)) * LN_2
    }

    pub(super) fn logarithm_one_plus(self) -> Self {
        if !(self.high > -1.0 && self.high.is_finite()) {
            return if self.high == -1.0 && self.low > 0.0 {
                Self::leading(self.low).logarithm()
            } else {
                Self::leading(self.high.ln_1p())
            };
        }
        if self.high.abs() < 1e-150 {
            return self;
        }
        if self.high.abs() > 0.5 {
            return (ONE + self).logarithm();
        }
        let start = Self::leading(self.high.ln_1p());
        let found = start.exponential_minus_one();
        start + (self - found) / (ONE + found)
    }

    pub(super) fn hyperbolic_sine(self) -> Self {
        let a = Real::abs(self);
        let size = if a.high > 40.0 {
            // Two halves, so that the result overflows no earlier than it must.
            let root = (a * HALF).exponential();
            root * HALF * root
        } else {
            let p = a.exponential_minus_one();
            (p + p / (ONE + p)) * HALF
        };
        if self.high.is_sign_negative() { -size } else { size }
    }

    pub(super) fn hyperbolic_cosine(self) -> Self {
        let root = (Real::abs(self) * HALF).exponential();
        if root.high > 1e9 {
            return root * HALF * root;
        }
        let e = root * root;
        (e + ONE / e) * HALF
    }

    pub(super) fn hyperbolic_tangent(self) -> Self {
        let a = Real::abs(self);
        let p = (a * Self::leading(-2.0)).exponential_minus_one();
        let size = -p / (Self::leading(2.0) + p);
        if self.high.is_sign_negative() { -size } else { size }
    }

    /// Repeated squaring: the error grows like `|exponent|` roundings, as the condition does.
    pub(super) fn integer_power(self, exponent: i32) -> Self {
        let positive = |base: Self| {
            let (mut power, mut square, mut rest) = (ONE, base, exponent.unsigned_abs());
            while rest > 0 {
                if rest & 1 == 1 {
                    power *= square;
                }
                rest >>= 1;
                if rest > 0 {
                    square *= square;
                }
            }
            power
        };
        if exponent >= 0 {
            return positive(self);
        }
        let power = positive(self);
        // The power may leave the range before its reciprocal does.
        if power.high.abs() > 1e-280 && power.is_finite() { ONE / power } else { positive(ONE / self) }
    }

    pub(super) fn real_power(self, exponent: Self) -> Self {
        let whole = exponent.low == 0.0 && exponent.high.fract() == 0.0 && exponent.high.abs() <= 1024.0;
        if whole {
            return self.integer_power(exponent.high as i32);
        }
        if !(self.high > 0.0 && self.is_finite() && exponent.is_finite()) {
            return Self::leading(self.high.powf(exponent.high));
        }
        (exponent * self.logarithm()).exponential()
    }
}
