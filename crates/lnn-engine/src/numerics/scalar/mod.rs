//! Numbers: [`Real`] is what model code may call, [`Scalar`] is an innermost floating-point number.
//!
//! Everything above this module is generic over [`Scalar`] (`f32`, `f64`, [`Dd`], and any [`num_traits::Float`] as [`AnyFloat`]). A
//! Lagrangian is written over [`Real`], which forward numbers and tape variables implement too; nothing in a model may name a float type.
//!
//! ```
//! use lnn::scalar::{Dd, Real, Scalar};
//!
//! // One formula, every number: the distance between two close roots loses digits in `f64` that double-double keeps.
//! fn gap<R: Real>(x: R) -> R {
//!     (x * x + R::one()).sqrt() - x
//! }
//! let exact = 1.0 / 2e8; // to the leading digits, at x = 1e8
//! let (lost, kept) = (gap(1e8_f64), gap(Dd::of_f64(1e8)).to_f64());
//! assert!((lost - exact).abs() > 0.1 * exact && (kept - exact).abs() < 1e-15 * exact);
//! ```

mod compiled;
mod dd;
mod elementary;
mod float;
mod lanes;
mod loops;
mod matrix;
mod primitive;
mod sum;

pub(crate) use compiled::{Compiled, Lagrangians, Networks, Tapes, compiled};
pub use dd::{Dd, UnreadableNumber};
pub(crate) use lanes::sin_cos_lane;
pub(crate) use lanes::{Exponential, Lanes, cos_lanes, exp_lanes, ln_lanes, sin_lanes, sqrt_lanes, tanh_lanes};
pub(crate) use loops::{Column, Simd, WithSimd, are_finite, copy_column, in_lanes, in_vectors, update_column, update3};
pub(crate) use matrix::product_by_loops;
pub use matrix::{MatMut, MatRef, Matrices};

// For the packages of this repository.
#[doc(hidden)]
pub use {
    elementary::Elementary,
    float::{AnyFloat, Foreign},
    lanes::sin_cos_lanes,
    loops::{update, update2, vectorized},
    sum::{Dots, Sum},
};

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::{Debug, Display};
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number that model code computes with: a float, a forward number over one, a tape variable over either.
///
/// Methods follow the usual definitions of the elementary functions. Derivatives at kinks are fixed by convention:
/// `abs`, `max` and `min` use the derivative 0 of `|x|` at `x = 0` (both signed zeros) and pass `NaN` on.
pub trait Real:
    Copy
    + Debug
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// The floating-point type at the bottom.
    type Scalar: Scalar;

    /// A number without derivatives; never recorded on a tape.
    fn constant(value: Self::Scalar) -> Self;

    /// The floating-point value at the bottom, derivatives dropped.
    ///
    /// On a tape that records a replayable program this is a data-dependent read and refused (see `tape`).
    fn primal(self) -> Self::Scalar;

    /// Exactly 0 with all its derivatives, so that a sum may leave it out and a product with it is zero.
    #[inline(always)]
    fn is_exact_zero(self) -> bool {
        self.primal() == Self::Scalar::of_f64(0.0)
    }

    /// `false` for a number known to be infinite or `NaN`. `true` for a number that represents many values, such as one on a tape that
    /// records a program: its products with exact zeros are left out anyway.
    #[inline(always)]
    fn may_be_finite(self) -> bool {
        true
    }

    /// `self * weight`, where a weight of exactly 0 gives 0: an infinite derivative along a direction without change does not count.
    #[inline(always)]
    fn along(self, weight: Self) -> Self {
        if weight.is_exact_zero() { weight } else { self * weight }
    }

    /// The constant nearest to `value`: exact unless the scalar is `f32`.
    #[inline(always)]
    fn of(value: f64) -> Self {
        Self::constant(Self::Scalar::of_f64(value))
    }
    /// The constant `numerator / denominator`, rounded once in the working precision.
    #[inline(always)]
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self::constant(Self::Scalar::of_f64(f64::from(numerator)) / Self::Scalar::of_f64(f64::from(denominator)))
    }
    /// 0.
    #[inline(always)]
    fn zero() -> Self {
        Self::of(0.0)
    }
    /// 1.
    #[inline(always)]
    fn one() -> Self {
        Self::of(1.0)
    }
    /// 2.
    #[inline(always)]
    fn two() -> Self {
        Self::of(2.0)
    }
    /// 1/2.
    #[inline(always)]
    fn half() -> Self {
        Self::of(0.5)
    }

    /// `1 / self`.
    fn recip(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// `e^self`.
    fn exp(self) -> Self;
    /// `e^self - 1`, accurate near 0.
    fn exp_m1(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// `ln(1 + self)`, accurate near 0.
    fn ln_1p(self) -> Self;
    /// Sine of an angle in radians, arguments of any size reduced correctly.
    fn sin(self) -> Self;
    /// Cosine of an angle in radians, arguments of any size reduced correctly.
    fn cos(self) -> Self;
    /// Tangent of an angle in radians.
    fn tan(self) -> Self;
    /// Inverse sine in radians.
    fn asin(self) -> Self;
    /// Inverse cosine in radians.
    fn acos(self) -> Self;
    /// Inverse tangent in radians.
    fn atan(self) -> Self;
    /// Hyperbolic sine.
    fn sinh(self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Complementary error function `2/sqrt(pi) * integral from self to infinity of exp(-t^2)`.
    fn erfc(self) -> Self;
    /// `1 / (1 + e^-self)`, relatively accurate in both tails.
    fn logistic(self) -> Self;
    /// `ln(1 + e^self)`, relatively accurate in both tails.
    fn softplus(self) -> Self;
    /// `ln cosh(self) = ln(1 + 2 sinh^2(self/2))`, relatively accurate everywhere: beyond 40 it grows by `|self|`, to `e^-80`.
    #[inline]
    fn ln_cosh(self) -> Self {
        let bound = Self::of(40.0);
        let near = self.max(-bound).min(bound);
        (Self::two() * (near * Self::half()).sinh().sqr()).ln_1p() + (self.abs() - bound).relu()
    }
    /// Absolute value; derivative 0 at 0.
    fn abs(self) -> Self;
    /// `self^exponent` for an integer exponent.
    fn powi(self, exponent: i32) -> Self;
    /// `self^exponent`, `self > 0`; at `self < 0` only integer exponents have a value, and derivatives along the exponent keep its sign:
    /// `ln |self|` replaces `ln self`.
    fn powf(self, exponent: Self) -> Self;
    /// Angle of the point `(x, self)` in radians.
    fn atan2(self, x: Self) -> Self;
    /// The larger of two numbers; `NaN` if either is.
    fn max(self, other: Self) -> Self;
    /// The smaller of two numbers; `NaN` if either is.
    fn min(self, other: Self) -> Self;
    /// `if_positive` where `self > 0`, `otherwise` where it is not; `NaN` where `self` is. The recordable branch.
    fn select(self, if_positive: Self, otherwise: Self) -> Self;

    /// `f(self)`, where one copy of the chain rule serves every function.
    #[doc(hidden)]
    #[inline(always)]
    fn elementary<F: Elementary>(self, f: F) -> Self {
        f.value(self)
    }

    /// `self * self`.
    #[inline(always)]
    fn sqr(self) -> Self {
        self * self
    }
    /// Sine and cosine together.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    /// `self * factor + summand`; fused where the hardware does it.
    #[inline]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        self * factor + summand
    }
    /// `max(self, 0)`; derivative 0 at 0, `NaN` passed on.
    #[inline(always)]
    fn relu(self) -> Self {
        self.select(self, Self::zero())
    }

    /// `W x + b`, `(outputs)`: `weights` is `W`, `(outputs, x.len())` row-major, `bias` is `b`, `(outputs)`, or empty.
    ///
    /// One operation on a tape that records blocks, where `weights` and `bias` are stretches of its parameters; sums
    /// of products, taken in order, everywhere else.
    ///
    /// # Panics
    /// If `weights` is not made of whole rows or `bias` is shorter than there are rows.
    fn affine(weights: &[Self], bias: &[Self], x: &[Self]) -> Vec<Self> {
        assert!(!x.is_empty() && weights.len().is_multiple_of(x.len()), "a matrix of whole rows");
        assert!(bias.is_empty() || bias.len() == weights.len() / x.len(), "a bias for every row");
        let product = |row: &[Self]| row.iter().zip(x).fold(Self::zero(), |sum, (&w, &x)| sum + w * x);
        let mut rows: Vec<Self> = weights.chunks_exact(x.len()).map(product).collect();
        rows.iter_mut().zip(bias).for_each(|(row, &b)| *row += b);
        rows
    }
}

/// An innermost floating-point number: `f32`, `f64`, [`Dd`] or an [`AnyFloat`].
pub trait Scalar:
    Real<Scalar = Self>
    + Lanes
    + Dots
    + Matrices
    + Compiled<Tapes>
    + Compiled<Lagrangians>
    + Compiled<Networks>
    + PartialEq
    + PartialOrd
    + Default
    + Display
    + num_traits::Zero
    + num_traits::One
    + Send
    + Sync
    + 'static
{
    /// `"f32"`, `"f64"` or `"dd"`; [`AnyFloat`]s are all called `"another float"`.
    const NAME: &'static str;
    /// Distance from 1 to the next number (for [`Dd`]: `2^-104`, the precision its operations keep).
    fn epsilon() -> Self;
    /// Smallest positive normal number.
    fn min_positive() -> Self;
    /// Largest finite number.
    fn max_value() -> Self;
    /// Positive infinity.
    fn infinity() -> Self;
    /// Not a number.
    fn nan() -> Self;
    /// The circle constant.
    fn pi() -> Self;

    /// Nearest number to an `f64`.
    fn of_f64(value: f64) -> Self;
    /// Nearest `f64`.
    fn to_f64(self) -> f64;
    /// Nearest number to a decimal text such as `-1.25e-3`; the grammar of Rust's `f64`, infinities and `NaN` included.
    fn parse(text: &str) -> Option<Self>;
    /// Decimal text that [`Scalar::parse`] reads back to the same number.
    fn to_text(self) -> String;
    /// Neither infinite nor `NaN`.
    fn is_finite(self) -> bool;
    /// `NaN`.
    fn is_nan(self) -> bool;
    /// `self` reduced to `[0, 2 pi)` by an exact quotient, for angles of any finite size.
    fn wrap_angle(self) -> Self;
    /// Largest integer not above `self`.
    fn floor(self) -> Self;
    /// `2^exponent * self`, exact barring overflow and underflow.
    fn ldexp(self, exponent: i32) -> Self;
    /// The exponent `e` with `2^e <= |self| < 2^(e+1)`; `i32::MIN` for zero.
    fn ilogb(self) -> i32;

    /// Leading and trailing part: their exact sum is the number.
    fn parts(self) -> (f64, f64);
    /// Converts between innermost numbers; widening is exact, narrowing rounds to nearest.
    #[inline]
    fn cast<T: Scalar>(self) -> T {
        let (high, low) = self.parts();
        let leading = T::of_f64(high);
        if leading.is_finite() { leading + T::of_f64(low) } else { leading }
    }
}
