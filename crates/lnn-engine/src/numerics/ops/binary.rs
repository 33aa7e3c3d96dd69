//! Functions of two numbers.

use super::unary::sign;
use crate::scalar::Real;

/// Builds the enum, its value and its partial derivatives from rows
/// `Name method(a, b, y, da, db) = (df/da, df/db), (d2f/da2, d2f/da db, d2f/db2);`
/// with the arguments, the value `y` and the first partial derivatives in scope.
macro_rules! table {
    ($($(#[$doc:meta])* $name:ident $method:ident ($a:ident, $b:ident, $y:ident, $da:ident, $db:ident)
        = $first:expr, $second:expr;)*) => {
        /// A function of two numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Binary {
            $($(#[$doc])* $name,)*
        }

        impl Binary {
            /// `f(a, b)`.
            #[inline(always)]
            pub fn value<R: Real>(self, a: R, b: R) -> R {
                match self {
                    $(Self::$name => a.$method(b),)*
                }
            }
            /// `(df/da, df/db)`, given `y = f(a, b)`.
            #[inline(always)]
            #[allow(unused_variables)]
            pub fn first<R: Real>(self, a: R, b: R, y: R) -> (R, R) {
                match self {
                    $(Self::$name => { let ($a, $b, $y) = (a, b, y); $first })*
                }
            }
            /// `(d2f/da2, d2f/da db, d2f/db2)`, given the value and the first partial derivatives.
            #[inline(always)]
            #[allow(unused_variables)]
            pub fn second<R: Real>(self, a: R, b: R, y: R, first: (R, R)) -> (R, R, R) {
                match self {
                    $(Self::$name => { let ($a, $b, $y, ($da, $db)) = (a, b, y, first); $second })*
                }
            }
        }
    };
}

/// `(1 + sign(a - b)) / 2` and its complement: all to the larger, half each at a tie.
#[inline(always)]
fn shares<R: Real>(a: R, b: R) -> (R, R) {
    let half = R::half() * sign(a - b);
    (R::half() + half, R::half() - half)
}

/// Second derivatives of a piecewise linear function: 0, or `NaN` where the first one is.
#[inline(always)]
fn flat<R: Real>(first: R) -> (R, R, R) {
    let zero = first * R::zero();
    (zero, zero, zero)
}

/// `ln |a|`, 0 at `a = 0`, where `a^b ln a` tends to 0.
#[inline(always)]
fn log<R: Real>(a: R) -> R {
    let size = a.abs();
    size.select(size.ln(), R::zero())
}

table! {
    /// `a + b`.
    Add add(a, b, y, da, db) = (R::one(), R::one()), (R::zero(), R::zero(), R::zero());
    /// `a - b`.
    Sub sub(a, b, y, da, db) = (R::one(), -R::one()), (R::zero(), R::zero(), R::zero());
    /// `a b`.
    Mul mul(a, b, y, da, db) = (b, a), (R::zero(), R::one(), R::zero());
    /// `a / b`.
    Div div(a, b, y, da, db) = { let r = b.recip(); (r, -(y * r)) }, (R::zero(), -(da * da), -(db * da + db * da));
    /// `a^b`, `a > 0`. At `a < 0` only integer `b` have a value, and derivatives along `b` keep its sign: `ln |a|` replaces `ln a`.
    Powf powf(a, b, y, da, db) = (b * a.powf(b - R::one()), y * log(a)), {
        let (one, log) = (R::one(), log(a));
        (
            b * (b - one) * a.powf(b - R::two()),
            a.powf(b - one) * (one + b * log),
            db * log,
        )
    };
    /// Angle of the point `(b, a)`.
    Atan2 atan2(a, b, y, da, db) = { let r = (a * a + b * b).recip(); (b * r, -(a * r)) }, {
        let twice = R::two() * da * db;
        (twice, db * db - da * da, -twice)
    };
    /// The larger one.
    Max max(a, b, y, da, db) = shares(a, b), flat(da);
    /// The smaller one.
    Min min(a, b, y, da, db) = shares(b, a), flat(da);
}

impl Binary {
    /// `f(a, b)`, compiled once for a kind of number: for interpreters, which choose `f` at run time.
    #[inline(never)]
    pub fn evaluate<R: Real>(self, a: R, b: R) -> R {
        self.value(a, b)
    }
}
