//! Functions of one number.

use crate::scalar::{Elementary, Real, Scalar};

/// `-1`, `0` or `1` by the sign of `x`: the derivative of `|x|` with the value 0 at both zeros.
#[inline(always)]
pub(super) fn sign<R: Real>(x: R) -> R {
    x.select(R::one(), (-x).select(-R::one(), R::zero()))
}

/// `-2 / sqrt(pi)`, the factor of the derivative of `erfc`.
#[inline(always)]
fn minus_two_by_root_pi<R: Real>() -> R {
    R::constant(-R::Scalar::of_f64(2.0) / Real::sqrt(R::Scalar::pi()))
}

/// The normal distribution function.
#[inline(always)]
fn distribution<R: Real>(x: R) -> R {
    R::half() * (-x * R::constant(Real::sqrt(<R::Scalar as Real>::half()))).erfc()
}

/// Its density, `e^(-x^2/2) / sqrt(2 pi)`.
#[inline(always)]
fn density<R: Real>(x: R) -> R {
    let factor = R::Scalar::of_f64(0.5) / R::Scalar::pi();
    R::constant(Real::sqrt(factor)) * (-(R::half() * x * x)).exp()
}

/// `x^exponent * factor`, exactly 0 for the factor 0.
#[inline(always)]
fn power<R: Real>(x: R, factor: i64, exponent: i64) -> R {
    if factor == 0 {
        return R::zero();
    }
    let exponent = exponent.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
    x.powi(exponent) * R::of(factor as f64)
}

/// Builds the enum, its value and its derivatives from rows of two kinds: functions that are a method of [`Real`],
/// `Name method(x, y, d) = first derivative, second derivative;`, then functions made of these,
/// `Name(x, y, d) = value, first derivative, second derivative;`, with the argument `x`, the value `y` and the first derivative `d`.
///
/// A function of the second kind is one operation on a tape if it is called by [`Real::elementary`].
macro_rules! table {
    (
        $($(#[$doc:meta])* $name:ident $method:ident ($x:ident, $y:ident, $d:ident) = $first:expr, $second:expr;)*
        @ made of these:
        $($(#[$made_doc:meta])* $made:ident ($mx:ident, $my:ident, $md:ident) = $value:expr, $made_first:expr, $made_second:expr;)*
    ) => {
        /// A function of one number.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Unary {
            $($(#[$doc])* $name,)*
            $($(#[$made_doc])* $made,)*
            /// `-x`.
            Neg,
            /// `x^n` for an integer `n`.
            Powi(i32),
        }

        impl Unary {
            /// `f(x)`.
            #[inline(always)]
            pub fn value<R: Real>(self, x: R) -> R {
                match self {
                    $(Self::$name => x.$method(),)*
                    $(Self::$made => {
                        #[inline]
                        fn made<R: Real>($mx: R) -> R {
                            $value
                        }
                        made(x)
                    })*
                    Self::Neg => -x,
                    Self::Powi(n) => x.powi(n),
                }
            }
            /// `f'(x)`, given `y = f(x)`.
            #[inline(always)]
            #[allow(unused_variables)]
            pub fn first<R: Real>(self, x: R, y: R) -> R {
                match self {
                    $(Self::$name => { let ($x, $y) = (x, y); $first })*
                    $(Self::$made => {
                        #[inline]
                        fn made<R: Real>($mx: R, $my: R) -> R {
                            $made_first
                        }
                        made(x, y)
                    })*
                    Self::Neg => -R::one(),
                    Self::Powi(n) => power(x, i64::from(n), i64::from(n) - 1),
                }
            }
            /// `f''(x)`, given `y = f(x)` and `d = f'(x)`.
            #[inline(always)]
            #[allow(unused_variables)]
            pub fn second<R: Real>(self, x: R, y: R, d: R) -> R {
                match self {
                    $(Self::$name => { let ($x, $y, $d) = (x, y, d); $second })*
                    $(Self::$made => {
                        #[inline]
                        fn made<R: Real>($mx: R, $my: R, $md: R) -> R {
                            $made_second
                        }
                        made(x, y, d)
                    })*
                    Self::Neg => R::zero(),
                    Self::Powi(n) => {
                        let n = i64::from(n);
                        power(x, n * (n - 1), n - 2)
                    }
                }
            }
        }

        impl Unary {
            /// The functions that are made of others.
            pub(crate) const MADE: &[Self] = &[$(Self::$made),*];
        }

        /// Calls back with the name and the method of every row that has one, to generate the methods of [`Real`].
        #[doc(hidden)]
        #[macro_export]
        macro_rules! unary_methods {
            ($callback:ident) => { $callback! { $($name $method)* } };
        }
        pub(crate) use unary_methods;
    };
}

table! {
    /// `1 / x`.
    Recip recip(x, y, d) = -(y * y), -(y * d + y * d);
    /// Square root.
    Sqrt sqrt(x, y, d) = R::half() / y, -R::half() * d / x;
    /// `e^x`.
    Exp exp(x, y, d) = y, y;
    /// `e^x - 1`; the derivative is `e^x` itself, which `y + 1` loses for `x << 0`.
    ExpM1 exp_m1(x, y, d) = x.exp(), d;
    /// Natural logarithm.
    Ln ln(x, y, d) = x.recip(), -(d * d);
    /// `ln(1 + x)`.
    Ln1p ln_1p(x, y, d) = (R::one() + x).recip(), -(d * d);
    /// Sine.
    Sin sin(x, y, d) = x.cos(), -y;
    /// Cosine.
    Cos cos(x, y, d) = -x.sin(), -y;
    /// Tangent.
    Tan tan(x, y, d) = R::one() + y * y, R::two() * y * d;
    /// Inverse sine; `(1 - x)(1 + x)` keeps the digits that `1 - x^2` loses near 1.
    Asin asin(x, y, d) = ((R::one() - x) * (R::one() + x)).sqrt().recip(), x * d * d * d;
    /// Inverse cosine.
    Acos acos(x, y, d) = -((R::one() - x) * (R::one() + x)).sqrt().recip(), x * d * d * d;
    /// Inverse tangent.
    Atan atan(x, y, d) = (R::one() + x * x).recip(), -R::two() * x * d * d;
    /// Hyperbolic sine.
    Sinh sinh(x, y, d) = x.cosh(), y;
    /// Hyperbolic cosine.
    Cosh cosh(x, y, d) = x.sinh(), y;
    /// Hyperbolic tangent; `1/cosh^2` is relatively accurate where `1 - y^2` is not.
    Tanh tanh(x, y, d) = x.cosh().recip().sqr(), -R::two() * y * d;
    /// Complementary error function.
    Erfc erfc(x, y, d) = minus_two_by_root_pi::<R>() * (-(x * x)).exp(), -R::two() * x * d;
    /// `1 / (1 + e^-x)`.
    Logistic logistic(x, y, d) = y * (-x).logistic(), -d * (R::half() * x).tanh();
    /// `ln(1 + e^x)`.
    Softplus softplus(x, y, d) = x.logistic(), d * (-x).logistic();
    /// `ln cosh(x)`.
    LnCosh ln_cosh(x, y, d) = x.tanh(), x.cosh().recip().sqr();
    /// Absolute value; 0 at 0 for the derivative, `NaN` passed on.
    Abs abs(x, y, d) = sign(x), d * R::zero();

    @ made of these:
    /// `x Phi(x)`, `Phi` the normal distribution function with the density `phi`: `Phi + x phi`, `phi (2 - x^2)`.
    Gelu(x, y, d) = x * distribution(x), distribution(x) + x * density(x), density(x) * (R::two() - x * x);
    /// `x tanh(x/2)`: `tanh(x/2) + (x/2) / cosh^2(x/2)`, `(1 - (x/2) tanh(x/2)) / cosh^2(x/2)`.
    XTanh(x, y, d) = x * (x * R::half()).tanh(), { let h = x * R::half(); h.tanh() + h * h.cosh().recip().sqr() }, {
        let h = x * R::half();
        h.cosh().recip().sqr() * (R::one() - h * h.tanh())
    };
    /// `x s(x)`, `s` the logistic function: `s + x s'`, `s' (2 - x tanh(x/2))`.
    Silu(x, y, d) = x * x.logistic(), { let s = x.logistic(); s + y * (-x).logistic() }, {
        let slope = x.logistic() * (-x).logistic();
        slope * (R::two() - x * (x * R::half()).tanh())
    };
}

impl Unary {
    /// The row of the table that an elementary function is, if it is made of others and therefore no method of a number.
    pub fn made<F: Elementary>(f: F) -> Option<Self> {
        let row: Option<&Self> = (&f as &dyn core::any::Any).downcast_ref();
        row.copied().filter(|f| Self::MADE.contains(f))
    }
    /// `f(x)`, compiled once for a kind of number: for interpreters, which choose `f` at run time.
    #[inline(never)]
    pub fn evaluate<R: Real>(self, x: R) -> R {
        match self {
            Self::Neg => -x,
            _ => x.elementary(self),
        }
    }
    /// `(f(x), f'(x))`, sharing the work where the two are found together.
    #[inline(always)]
    pub fn value_first<R: Real>(self, x: R) -> (R, R) {
        match self {
            Self::Sin => x.sin_cos(),
            Self::Cos => {
                let (sin, cos) = x.sin_cos();
                (cos, -sin)
            }
            _ => {
                let y = self.value(x);
                (y, self.first(x, y))
            }
        }
    }
    /// `(f(x), f'(x), f''(x))`.
    #[inline(always)]
    pub fn jet<R: Real>(self, x: R) -> (R, R, R) {
        let (y, d) = self.value_first(x);
        (y, d, self.second(x, y, d))
    }
}

impl Elementary for Unary {
    #[inline(always)]
    fn value<R: Real>(self, x: R) -> R {
        Self::value(self, x)
    }
    #[inline(always)]
    fn value_first<R: Real>(self, x: R) -> (R, R) {
        Self::value_first(self, x)
    }
    #[inline(always)]
    fn jet<R: Real>(self, x: R) -> (R, R, R) {
        Self::jet(self, x)
    }
}
