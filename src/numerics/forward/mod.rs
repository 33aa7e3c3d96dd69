//! Forward numbers: values with directional derivatives.
//!
//! [`Dual`] carries one tangent, [`HyperDual`] one mixed second-order Taylor coefficient, [`Jet2`] the gradient and the
//! Hessian in `N` variables, [`Jet`] a gradient in more variables than its Hessian. They are [`Real`](crate::scalar::Real) over any `Real`: over floats, over each other and
//! over tape variables. Only the chain, product and quotient rules stand here; elementary derivatives come from the
//! [table of operations](crate::ops).
//!
//! ```
//! use lnn::forward::Jet2;
//! use lnn::scalar::Real;
//!
//! // x^2 sin y at (2, 0): the gradient is (0, 4), the mixed second derivative 2 x cos y = 4.
//! let (x, y) = (Jet2::<f64, 2>::variable(2.0, 0), Jet2::variable(0.0, 1));
//! let f = x.sqr() * y.sin();
//! assert_eq!((f.value, f.gradient, f.second(0, 1)), (0.0, [0.0, 4.0], 4.0));
//! ```

mod dual;
mod hyper;
mod jet;

pub use dual::Dual;
pub use hyper::HyperDual;
pub(crate) use jet::array;
pub use jet::{Jet, Jet2};

/// The part of [`Real`](crate::scalar::Real) that is the same for every forward number, given `constant`, `chain1`
/// (a table entry of one number), `chain2` (of two) and the base type `T`.
macro_rules! forward_real {
    () => {
        type Scalar = T::Scalar;

        #[inline(always)]
        fn constant(value: T::Scalar) -> Self {
            Self::lift(T::constant(value))
        }
        #[inline(always)]
        fn primal(self) -> T::Scalar {
            self.value.primal()
        }
        #[inline(always)]
        fn elementary<E: crate::scalar::Elementary>(self, f: E) -> Self {
            self.chain1(f)
        }
        crate::ops::unary_methods! { forward_unary }
        #[inline(always)]
        fn powi(self, exponent: i32) -> Self {
            self.chain1(crate::ops::Unary::Powi(exponent))
        }
        #[inline(always)]
        fn powf(self, exponent: Self) -> Self {
            self.chain2(exponent, crate::ops::Binary::Powf)
        }
        #[inline(always)]
        fn atan2(self, x: Self) -> Self {
            self.chain2(x, crate::ops::Binary::Atan2)
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            self.chain2(other, crate::ops::Binary::Max)
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            self.chain2(other, crate::ops::Binary::Min)
        }
    };
}
/// Callback of `unary_methods`: one method of `Real` per row of the table.
macro_rules! forward_unary {
    ($($name:ident $method:ident)*) => {$(
        #[inline(always)]
        fn $method(self) -> Self {
            self.chain1(crate::ops::Unary::$name)
        }
    )*};
}
/// `+=` and its kin from `+` and its kin, for a type with generics.
macro_rules! assign_operators {
    ([$($generics:tt)*] $type:ty) => {
        assign_operators!(@ [$($generics)*] $type, AddAssign add_assign +);
        assign_operators!(@ [$($generics)*] $type, SubAssign sub_assign -);
        assign_operators!(@ [$($generics)*] $type, MulAssign mul_assign *);
        assign_operators!(@ [$($generics)*] $type, DivAssign div_assign /);
    };
    (@ [$($generics:tt)*] $type:ty, $op:ident $method:ident $sign:tt) => {
        impl<$($generics)*> std::ops::$op for $type {
            #[inline(always)]
            fn $method(&mut self, other: Self) {
                *self = *self $sign other;
            }
        }
    };
}
pub(crate) use assign_operators;
use forward_real;
use forward_unary;

#[cfg(test)]
mod tests;
