//! Every function of the table against forward numbers nested twice, in double-double.

use super::Space;
use crate::forward::HyperDual;
use crate::ops::{Binary, Unary};
use crate::scalar::{Dd, Real, Scalar};

type Nested = HyperDual<HyperDual<Dd>>;

fn dd(x: f64) -> Dd {
    Dd::of_f64(x)
}

/// A function of two positions and two velocities.
trait Function {
    fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R;
}

/// Near `base`, every kind of term.
fn mixed<R: Real>(base: f64, q: &[R], v: &[R]) -> R {
    let c = R::of;
    c(base) + c(0.3) * q[0] + c(0.2) * q[1] * q[1] + c(0.5) * v[0] * (q[1] + c(1.0)) + c(0.1) * v[1] * v[0]
        - q[0] * q[1] * v[1]
}

/// A function of one mixed number.
struct One(Unary, f64);
impl Function for One {
    fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R {
        self.0.value(mixed(self.1, q, v))
    }
}

/// A function of two mixed numbers.
struct Two(Binary);
impl Function for Two {
    fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R {
        self.0.value(mixed(0.4, q, v), mixed(1.3, v, q))
    }
}

/// Functions whose arguments are of one kind, or constant.
struct Sparse;
impl Function for Sparse {
    fn of<R: Real<Scalar = Dd>>(&self, q: &[R], v: &[R]) -> R {
        let c = R::of;
        let (sin, cos) = (q[0] * q[1]).sin_cos();
        let powers = (c(2.0) + q[0]).powf(c(1.5)) + c(2.0).powf(v[0] + q[1]) + (c(1.0) + v[1]).powf(c(3.0));
        let branches = q[0].select(v[0] * cos, v[1]) + (c(1.0) - sin).atan2(c(2.0)) + c(2.0).atan2(v[0] - q[1]);
        let weights = [0.3, -0.2, 0.7, 0.1, 0.5, 0.4].map(c);
        let layer = R::affine(&weights, &[c(0.1), c(0.2)], &[q[0] * v[1], c(0.5), v[0].exp()]);
        let free = R::affine(&[q[0], v[1]], &[], &[v[0], q[1]]);
        powers * v[0] + branches * v[1] * v[0] + layer[0] * layer[1].tanh() + free[0] / (c(2.0) + cos)
            - c(3.0) / (c(2.0) + v[0])
    }
}

/// Derivatives by two velocities and two positions, all pairs.
fn check(what: &str, f: &impl Function) {
    let (q, v) = ([dd(0.25), dd(-0.125)], [dd(0.375), dd(0.5)]);
    let mut space = Space::new(2, 2);
    // Numbers of an earlier use leave nothing behind.
    f.of(&[space.position(0, q[0]), space.position(1, q[1])], &[space.velocity(0, v[0]), space.velocity(1, v[1])]);
    space.clear();
    let found = f.of(&[0, 1].map(|i| space.position(i, q[i])), &[0, 1].map(|i| space.velocity(i, v[i])));
    let unit = |on: bool| dd(if on { 1.0 } else { 0.0 });
    for (i, j) in [(0, 0), (1, 0), (1, 1)] {
        let (mut value, mut first, mut second) = (dd(0.0), [dd(0.0); 2], [dd(0.0); 4]);
        space.velocity_hessian(found, (i, j), &mut value, &mut first, &mut second);
        for (k, l) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let zero = HyperDual::lift(dd(0.0));
            let velocity = |m: usize| {
                let [s, t] = [i, j].map(|i| HyperDual::lift(unit(m == i)));
                Nested::new(HyperDual::lift(v[m]), s, t, zero)
            };
            let position = |m: usize| Nested::lift(HyperDual::new(q[m], unit(m == k), unit(m == l), dd(0.0)));
            let exact = f.of(&[0, 1].map(position), &[0, 1].map(velocity)).st;
            for (found, exact) in [(value, exact.value), (first[k], exact.s), (second[2 * k + l], exact.st)] {
                let error = (found - exact).abs().to_f64();
                assert!(error < 1e-26 * (1.0 + exact.abs().to_f64()), "{what} {i}{j} {k}{l}: {found} {exact}");
            }
        }
    }
}

macro_rules! rows {
    ($($name:ident $method:ident)*) => { [$(Unary::$name),*] };
}

#[test]
fn functions_of_the_table_have_their_fourth_derivatives() {
    for f in crate::ops::unary_methods!(rows).into_iter().chain(Unary::MADE.iter().copied()) {
        check(&format!("{f:?}"), &One(f, 0.25));
    }
    for n in [-3, -1, 0, 1, 2, 3, 5] {
        check(&format!("power {n}"), &One(Unary::Powi(n), 0.4));
        check(&format!("power {n} of a negative number"), &One(Unary::Powi(n), -1.5));
    }
    for f in [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Powf, Binary::Atan2, Binary::Max, Binary::Min]
    {
        check(&format!("{f:?}"), &Two(f));
    }
    check("sparse", &Sparse);
}

#[test]
fn integer_powers_are_differentiated_at_zero() {
    let space = Space::<f64>::new(1, 1);
    let v = space.velocity(0, 0.0);
    let (mut value, mut first, mut second) = (0.0, [0.0], [0.0]);
    for (power, exact) in [(v * v, 2.0), (v.powi(3), 0.0), (v.powf(Real::constant(2.0)), 2.0), (v.powi(0), 0.0)] {
        space.velocity_hessian(power * space.position(0, 3.0), (0, 0), &mut value, &mut first, &mut second);
        assert_eq!((value, first[0]), (3.0 * exact, exact));
    }
}
