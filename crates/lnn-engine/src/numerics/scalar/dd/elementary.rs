//! Roots, powers, exponentials, logarithms, the complementary error function.

use super::Dd;
use crate::platform::float;
use crate::scalar::{Real, Scalar};

const ONE: Dd = Dd::leading(1.0);
const HALF: Dd = Dd::leading(0.5);
pub(super) const LN_2: Dd = Dd { high: core::f64::consts::LN_2, low: 2.3190468138462996e-17 };
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
        let k = float!(f64, round(self.high * core::f64::consts::LOG2_E));
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
        let whole = exponent.low == 0.0 && float!(f64, fract(exponent.high)) == 0.0 && exponent.high.abs() <= 1024.0;
        if whole {
            return self.integer_power(exponent.high as i32);
        }
        if !(self.high > 0.0 && self.is_finite() && exponent.is_finite()) {
            return Self::leading(self.high.powf(exponent.high));
        }
        (exponent * self.logarithm()).exponential()
    }
}

/// `K` of the substitution `s = (x - K) / (x + K)`.
const CENTER: f64 = 3.5;

impl Dd {
    /// Scaled complementary error function `e^(x^2) erfc(x)` for `x >= 0`.
    ///
    /// `(x + K) erfcx(x)` is a Chebyshev series in `s = (x - K) / (x + K)` on `[-1, 1)` (substitution of M. M. Shepherd
    /// and J. G. Laframboise, Math. Comp. 36, 1981), coefficients from interpolation at 64 points with 50 digits.
    pub(in crate::numerics::scalar) fn erfcx(self) -> Self {
        if self.high() == f64::INFINITY {
            return <Self as Real>::zero();
        }
        let center = Self::of_f64(CENTER);
        // Halved, so that the largest numbers do not overflow.
        let half = <Self as Real>::half();
        let denominator = self * half + center * half;
        let s = (self * half - center * half) / denominator;
        let twice = s + s;
        let (mut this, mut next) = (<Self as Real>::zero(), <Self as Real>::zero());
        for &(high, low) in COEFFICIENTS[1..].iter().rev() {
            (this, next) = (twice * this - next + Self { high, low }, this);
        }
        let (high, low) = COEFFICIENTS[0];
        (s * this - next + Self { high, low }) * half / denominator
    }

    /// `erfc(self)`, relatively accurate until it underflows.
    pub(super) fn complementary_error(self) -> Self {
        if self.is_nan() {
            return Self::nan();
        }
        if self.high() < 0.0 {
            return if self.high() < -13.0 {
                <Self as Real>::two()
            } else {
                <Self as Real>::two() - (-self).complementary_error()
            };
        }
        if self.high() > 28.0 {
            return <Self as Real>::zero();
        }
        // x^2 in three parts: its error is an error of the exponent.
        let (square, rest) = exact_square(self);
        // Two halves, so that a subnormal result is rounded once.
        let half = (-(square * <Self as Real>::half())).exp();
        half * (self.erfcx() * (<Self as Real>::one() - Self::of_f64(rest))) * half
    }
}

/// `x^2` as a double-double number, and the remainder.
fn exact_square(x: Dd) -> (Dd, f64) {
    let (high, low) = (x.high(), x.low());
    let square = high * high;
    let square_rest = float!(f64, mul_add(high, high, -square));
    let cross = 2.0 * high * low;
    let cross_rest = float!(f64, mul_add(2.0 * high, low, -cross));
    let middle = Dd::new(square_rest, cross);
    let sum = Dd::new(square, middle.high());
    (sum, middle.low() + cross_rest + low * low)
}

#[rustfmt::skip]
const COEFFICIENTS: [(f64, f64); 53] = [
    (1.526687770473027, -1.0673933654271184e-16),
    (-1.3233576807771161, 6.959462383704453e-17),
    (0.4717745274649548, -1.2522450719623436e-17),
    (-0.13849365251023676, -4.116303809712623e-18),
    (0.032897958759694215, 2.31626172304813e-18),
    (-0.006027840106706338, 3.7440977586014475e-19),
    (0.0007450768613394293, 4.110275435702234e-20),
    (-2.808895819172916e-05, 1.4311662087638229e-21),
    (-1.0543610441854546e-05, -7.752039846286949e-22),
    (2.1071256103931186e-06, -4.888019221929434e-24),
    (-2.8468148375313672e-09, -3.3013678816379115e-28),
    (-5.4190067551376616e-08, -1.726846894955174e-24),
    (4.88726682252626e-09, -2.8802032609177273e-25),
    (1.2184716865087857e-09, -2.5304299362980098e-26),
    (-2.2335069312341743e-10, -1.130084185523206e-26),
    (-2.8659392992231866e-11, -1.5979987097998366e-27),
    (8.510779247322225e-12, 3.5809405660897615e-28),
    (8.020048569047153e-13, 1.454475225509254e-29),
    (-3.1918468348106296e-13, -1.4558896324656034e-29),
    (-2.9415243942604305e-14, 1.2179322133501313e-30),
    (1.217602730645767e-14, -7.3680818680690585e-31),
    (1.3847951691095818e-15, -4.006359204264439e-32),
    (-4.660425706799445e-16, -2.8411839248162095e-32),
    (-7.480839014351964e-17, -5.2935283180537964e-33),
    (1.7058386228653305e-17, 9.636940476534795e-34),
    (4.2022734730013336e-18, 2.568570766903833e-34),
    (-5.324456806596317e-19, 5.107668639455553e-37),
    (-2.3123086925054995e-19, 8.623738801918391e-36),
    (8.487135798179875e-21, 3.7733487330400345e-37),
    (1.1933121128407046e-20, -6.726471156439629e-37),
    (6.131161689340317e-22, 3.308276330487807e-38),
    (-5.465399959056171e-22, 3.760205860962582e-38),
    (-8.593330126143496e-23, 4.592398892727957e-39),
    (1.9583954142492386e-23, 4.5231059116070334e-40),
    (6.764677253277747e-24, -5.240976783112006e-40),
    (-2.6845748464901454e-25, -2.2130650285824203e-41),
    (-4.054089653055227e-25, -1.6545028547104185e-41),
    (-3.699332792071812e-26, 1.97735879080459e-43),
    (1.8058208848625218e-26, -1.0905084680792878e-42),
    (4.634662742387164e-27, 1.0292026762497624e-43),
    (-3.872087073230792e-28, -1.8030828049514132e-44),
    (-3.3169720534413133e-28, 1.0377112055422083e-44),
    (-2.773454562753399e-29, -2.4484065760347675e-45),
    (1.5739417943739197e-29, -2.5519816376041574e-46),
    (4.267446786663343e-30, -1.6963060385358038e-46),
    (-2.644397356418384e-31, -1.668907694540443e-47),
    (-3.1390006260798762e-31, -5.301679374159441e-48),
    (-3.8447419721690504e-32, 1.8625829073454988e-48),
    (1.326510983717964e-32, -7.159668467159469e-49),
    (4.947636014168781e-33, -1.2578698916871396e-49),
    (6.06763370442939e-35, -7.5171507471343e-52),
    (-3.169399671161935e-34, 1.3363823550460978e-51),
    (-6.631621849477712e-35, -2.0045735325691467e-51),
];
