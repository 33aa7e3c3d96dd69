//! Forward numbers: values with directional derivatives.
//!
//! [`Dual`] carries one tangent, [`HyperDual`] one mixed second-order Taylor coefficient, [`Jet2`] the gradient and the Hessian in `N`
//! variables, [`Jet`] a gradient in more variables than its Hessian. They are [`Real`](crate::scalar::Real) over any `Real`: over floats,
//! over each other and over tape variables. Only the chain, product and quotient rules are here; elementary derivatives come from the
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
mod jet;

pub use dual::{Dual, HyperDual};
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
        fn may_be_finite(self) -> bool {
            self.value.may_be_finite()
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
        impl<$($generics)*> core::ops::$op for $type {
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
mod tests {
    //! Every row of the table: derivatives of one order against differences of the order below, in double-double.

    use super::{Dual, HyperDual, Jet, Jet2};
    use crate::ops::{Binary, Unary};
    use crate::scalar::{Dd, Real, Scalar};

    fn dd(value: f64) -> Dd {
        Dd::of_f64(value)
    }
    /// Central difference of order 6; with `h = 1e-4` and double-double its error is below `1e-20` for these functions.
    fn difference(f: impl Fn(Dd) -> Dd) -> Dd {
        let h = dd(1e-4);
        let odd = |k: f64| f(dd(k) * h) - f(-(dd(k) * h));
        (odd(1.0) * dd(45.0) - odd(2.0) * dd(9.0) + odd(3.0)) / (dd(60.0) * h)
    }
    fn close(got: Dd, want: Dd, what: &str) {
        let scale = 1.0 + want.to_f64().abs();
        assert!((got - want).to_f64().abs() < 1e-17 * scale, "{what}: {got:?} against {want:?}");
    }

    macro_rules! rows {
        ($($name:ident $method:ident)*) => { [$(Unary::$name),*] };
    }

    #[test]
    fn derivatives_of_the_table_follow_from_the_values() {
        for f in crate::ops::unary_methods!(rows).into_iter().chain(Unary::MADE.iter().copied()) {
            // `erfc` of the number type is exercised by its own tests; its derivatives below by identities.
            if f == Unary::Erfc {
                continue;
            }
            for x in [0.3, 0.7, -0.6] {
                if x < 0.0 && matches!(f, Unary::Sqrt | Unary::Ln) {
                    continue;
                }
                check_unary(f, dd(x));
            }
        }
        for n in [-3, -1, 0, 1, 2, 5] {
            check_unary(Unary::Powi(n), dd(-0.7));
        }
        for f in
            [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Powf, Binary::Atan2, Binary::Max, Binary::Min]
        {
            check_binary(f, dd(0.4), dd(1.3));
        }
    }

    fn check_unary(f: Unary, x: Dd) {
        let (y, d, s) = f.jet(x);
        close(d, difference(|h| f.value(x + h)), &format!("{f:?}'"));
        close(s, difference(|h| f.first(x + h, f.value(x + h))), &format!("{f:?}''"));
        let hyper = f.value(HyperDual::new(x, dd(2.0), dd(3.0), dd(5.0)));
        close(hyper.value, y, "value");
        close(hyper.s, dd(2.0) * d, "s");
        close(hyper.t, dd(3.0) * d, "t");
        close(hyper.st, dd(5.0) * d + dd(6.0) * s, "st");
        let nested = f.value(Dual::new(Dual::new(x, dd(2.0)), Dual::new(dd(3.0), dd(5.0))));
        close(nested.tangent.tangent, hyper.st, "nested");
    }

    fn check_binary(f: Binary, a: Dd, b: Dd) {
        let y = f.value(a, b);
        let (da, db) = f.first(a, b, y);
        close(da, difference(|h| f.value(a + h, b)), &format!("{f:?} da"));
        close(db, difference(|h| f.value(a, b + h)), &format!("{f:?} db"));
        let first = |a: Dd, b: Dd| f.first(a, b, f.value(a, b));
        let (daa, dab, dbb) = f.second(a, b, y, (da, db));
        close(daa, difference(|h| first(a + h, b).0), &format!("{f:?} daa"));
        close(dab, difference(|h| first(a, b + h).0), &format!("{f:?} dab"));
        close(dbb, difference(|h| first(a, b + h).1), &format!("{f:?} dbb"));
        let jet = f.value(Jet2::<Dd, 2>::variable(a, 0), Jet2::variable(b, 1));
        for (got, want) in [
            (jet.gradient[0], da),
            (jet.gradient[1], db),
            (jet.second(0, 0), daa),
            (jet.second(1, 0), dab),
            (jet.second(0, 1), dab),
            (jet.second(1, 1), dbb),
        ] {
            close(got, want, &format!("{f:?} jet"));
        }
        let jet = f.value(Jet::<Dd, 1, 1>::variable(a, 0), Jet::variable(b, 1));
        for (got, want) in [(jet.gradient[0], da), (jet.linear[0], db), (jet.second(0, 0), daa)] {
            close(got, want, &format!("{f:?} jet of first order in one variable"));
        }
        let (p, q) = (HyperDual::new(a, dd(1.0), dd(2.0), dd(0.5)), HyperDual::new(b, dd(-1.0), dd(3.0), dd(0.25)));
        let hyper = f.value(p, q);
        let nest = |h: HyperDual<Dd>| Dual::new(Dual::new(h.value, h.s), Dual::new(h.t, h.st));
        close(hyper.st, f.value(nest(p), nest(q)).tangent.tangent, &format!("{f:?} nested"));
    }

    #[test]
    fn erfc_and_its_derivatives_in_f64() {
        for x in [-2.5f64, -0.3, 0.0, 0.4, 3.0] {
            let y = HyperDual::new(x, 1.0, 1.0, 0.0).erfc();
            let density = -std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp();
            assert!((y.s - density).abs() <= 4.0 * f64::EPSILON * density.abs());
            assert!((y.st + 2.0 * x * density).abs() <= 8.0 * f64::EPSILON * (2.0 * x * density).abs());
        }
    }

    #[test]
    fn kinks_follow_the_convention() {
        for zero in [0.0f64, -0.0] {
            assert_eq!(Dual::new(zero, 1.0).abs().tangent, 0.0);
            assert_eq!(Dual::new(zero, 1.0).relu().tangent, 0.0);
            assert_eq!(HyperDual::new(zero, 1.0, 1.0, 0.0).abs().st, 0.0);
        }
        let tie = Real::max(Dual::new(2.0, 1.0), Dual::new(2.0, 0.0));
        assert_eq!((tie.value, tie.tangent), (2.0, 0.5));
        let tie = Real::min(Dual::new(2.0, 1.0), Dual::new(2.0, 0.0));
        assert_eq!((tie.value, tie.tangent), (2.0, 0.5));
        assert_eq!(Real::max(Dual::new(3.0, 1.0), Dual::new(2.0, 5.0)).tangent, 1.0);
        assert_eq!(Real::min(Dual::new(3.0, 1.0), Dual::new(2.0, 5.0)).tangent, 5.0);
        for f in [Dual::<f64>::abs, Dual::relu, Dual::sin, Dual::softplus] {
            let y = f(Dual::new(f64::NAN, 1.0));
            assert!(y.value.is_nan() && y.tangent.is_nan());
        }
        assert!(Real::max(Dual::new(f64::NAN, 0.0), Dual::lift(1.0)).tangent.is_nan());
    }

    #[test]
    fn dead_branch_leaves_no_trace() {
        let x = HyperDual::new(0.0f64, 1.0, 1.0, 0.0);
        let y = x.select(x.sqrt(), HyperDual::lift(0.0));
        assert_eq!((y.value, y.s, y.st), (0.0, 0.0, 0.0));
        // A constant exponent at the edge of the domain.
        let square = Dual::new(0.0f64, 1.0).powf(Dual::lift(2.0));
        assert_eq!((square.value, square.tangent), (0.0, 0.0));
    }

    #[test]
    fn tails_of_the_derivatives_are_relatively_accurate() {
        // sech^2 and sigma(1 - sigma) at x = 30: 4 e^-60 and e^-30, lost entirely by 1 - y^2 and y (1 - y).
        let tanh = Dual::new(30.0f64, 1.0).tanh().tangent;
        let want = 4.0 * (-60.0f64).exp() * (1.0 - 2.0 * (-60.0f64).exp());
        assert!((tanh / want - 1.0).abs() < 8.0 * f64::EPSILON);
        let logistic = Dual::new(40.0f64, 1.0).logistic().tangent;
        assert!((logistic / (-40.0f64).exp() - 1.0).abs() < 8.0 * f64::EPSILON);
        assert_eq!(Dual::new(1000.0f64, 1.0).tanh().tangent, 0.0);
    }
}
