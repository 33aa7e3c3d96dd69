//! Enclosures of numbers, functions and derivatives against exact values.

use super::function::{Derivatives, Function, smooth_bounds};
use super::interval::Interval;
use crate::forward::HyperDual;
use crate::ops::Unary;
use crate::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Functions with ends between which their arguments are drawn.
const FUNCTIONS: [(Unary, f64, f64); 24] = [
    (Unary::Neg, -5.0, 5.0),
    (Unary::Recip, 0.1, 9.0),
    (Unary::Powi(5), -3.0, 3.0),
    (Unary::Powi(-3), -3.0, -0.2),
    (Unary::Sqrt, 0.1, 9.0),
    (Unary::Exp, -9.0, 9.0),
    (Unary::ExpM1, -3.0, 3.0),
    (Unary::Ln, 0.1, 9.0),
    (Unary::Ln1p, -0.9, 5.0),
    (Unary::Sin, -20.0, 20.0),
    (Unary::Cos, -20.0, 20.0),
    (Unary::Tan, -1.2, 1.2),
    (Unary::Asin, -0.9, 0.9),
    (Unary::Acos, -0.9, 0.9),
    (Unary::Atan, -4.0, 4.0),
    (Unary::Sinh, -4.0, 4.0),
    (Unary::Cosh, -4.0, 4.0),
    (Unary::Tanh, -6.0, 6.0),
    (Unary::Erfc, -4.0, 4.0),
    (Unary::Logistic, -20.0, 20.0),
    (Unary::Softplus, -20.0, 20.0),
    (Unary::Gelu, -7.0, 7.0),
    (Unary::XTanh, -20.0, 20.0),
    (Unary::Abs, 0.1, 5.0),
];

pub(super) fn holds(interval: Interval, x: Dd) -> bool {
    Dd::of_f64(interval.low) <= x && x <= Dd::of_f64(interval.high)
}

/// Derivatives over all numbers of an interval.
fn derivatives(f: Unary, x: Interval) -> Derivatives {
    let (centre, distance) = (x.middle(), x.radius());
    Function::Table(f).about(centre, distance).1
}

/// Value and six derivatives by the table of operations in double-double numbers.
fn exact(f: Unary, x: f64) -> [Dd; 7] {
    let (one, zero) = (<Dd as Real>::one(), <Dd as Real>::zero());
    let inner = HyperDual::new(Dd::of_f64(x), one, one, zero);
    let (unit, none) = (HyperDual::lift(one), HyperDual::lift(zero));
    let (value, first, second) = f.jet(HyperDual::new(inner, unit, unit, none));
    let [second, third, fourth] = [second.value, second.s, second.st];
    [value.value.value, first.value.value, second.value, third.value, fourth.value, fourth.s, fourth.st]
}

/// Derivatives of the table lose some digits of double-double numbers, but far fewer than half of them.
fn nearly(interval: Interval) -> Interval {
    let slack = 1e-24 * (1.0 + interval.magnitude());
    Interval { low: interval.low - slack, high: interval.high + slack }
}

#[test]
fn functions_and_derivatives_are_enclosed() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (f, low, high) in FUNCTIONS {
        for k in 0..400 {
            let (a, b) = (random.random_range(low..high), random.random_range(low..high));
            // Points, narrow ranges, wide ranges.
            let b = [a, a + 1e-3 * (b - a), b][k % 3];
            let range = Interval::new(a.min(b), a.max(b));
            let found = derivatives(f, range);
            for part in [0.0, 0.3, 0.7, 1.0] {
                let x = (range.low + part * (range.high - range.low)).clamp(range.low, range.high);
                for (order, (found, exact)) in found.iter().zip(exact(f, x)).enumerate() {
                    assert!(holds(nearly(*found), exact), "{f:?} ({order}) of {range:?} at {x}: {found:?}, {exact}");
                }
            }
            if k % 3 == 0 {
                // A point loses digits only to the condition of the function.
                let width = |x: &Interval| x.high - x.low;
                let size = found.iter().fold(1e-3, |a: f64, x| a.max(x.magnitude()));
                assert!(found.iter().all(|x| width(x) < 1e-11 * size), "{f:?} at {a}: {found:?}");
            }
        }
    }
}

#[test]
fn arithmetic_is_rounded_outward() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..20_000 {
        let mut draw = || {
            let (a, b): (f64, f64) = (random.random_range(-2.0..2.0), random.random_range(-2.0..2.0));
            (Interval::new(a.min(b), a.max(b)), a, b)
        };
        let ((x, a, b), (y, c, d)) = (draw(), draw());
        for (p, q) in [(a, c), (a, d), (b, c), (b, d)] {
            let (p, q) = (Dd::of_f64(p), Dd::of_f64(q));
            assert!(holds(x + y, p + q) && holds(x - y, p - q) && holds(x * y, p * q));
            assert!(holds(x / y, p / q), "{x:?} / {y:?}");
            assert!(
                holds(x.square(), p * p)
                    && holds(x.power(3), p * p * p)
                    && holds(-x, -p)
                    && holds(x.abs(), Real::abs(p))
            );
        }
    }
    let third = Interval::point(1.0) / Interval::point(3.0);
    assert!(holds(third, Dd::of_f64(1.0) / Dd::of_f64(3.0)) && !third.is_point());
    let across = Interval::new(-1.0, 2.0);
    assert_eq!(Interval::point(1.0) / across, Interval::ENTIRE);
    for lost in [across.sqrt(), across.ln(), across.asin(), Interval::new(1.0, 2.0).tan(), across.real_power(0.5)] {
        assert_eq!(lost, Interval::ENTIRE);
    }
    assert_eq!(across.square(), Interval::new(0.0, 4.0_f64.next_up()));
    assert!(Interval::new(1.0, 2.0).sin_cos().0.contains(1.0) && Interval::new(3.0, 3.2).sin_cos().1.contains(-1.0));
    assert!(
        Interval::point(800.0).exp().high.is_infinite() && Interval::point(800.0).exp().low >= f64::MAX.next_down()
    );
    assert_eq!(Interval::new(f64::NAN, 1.0), Interval::ENTIRE);
}

/// The seventh derivative of functions with suprema, in intervals.
fn seventh(f: Unary, x: Interval) -> Interval {
    let number = Interval::point;
    let u = x.square();
    // With p = s(x) s(-x), s the logistic function.
    let logistic = |x: Interval| {
        let p = x.logistic() * (-x).logistic();
        p * (number(1.0) - p * (number(126.0) - p * (number(1680.0) - p * number(5040.0))))
    };
    let sixth = |f: Unary, x: Interval| derivatives(f, x)[6];
    match f {
        Unary::Logistic => logistic(x),
        Unary::Softplus => sixth(Unary::Logistic, x),
        Unary::Tanh => number(256.0) * logistic(number(2.0) * x),
        Unary::LnCosh => sixth(Unary::Tanh, x),
        Unary::XTanh => number(2.0) * x * logistic(x) + number(14.0) * sixth(Unary::Logistic, x),
        Unary::Gelu => {
            let density = (-(u * number(0.5))).exp() / (number(2.0) * Interval::pi()).sqrt();
            density * x * (number(-120.0) + u * (number(115.0) + u * (u - number(22.0))))
        }
        _ => {
            let density = number(2.0) / Interval::pi().sqrt() * (-u).exp();
            density * (number(120.0) - u * (number(720.0) - u * (number(480.0) - number(64.0) * u)))
        }
    }
}

/// Suprema by cutting the line, up to where tails fall, into pieces on which they hold.
#[test]
fn suprema_hold() {
    for f in [Unary::Logistic, Unary::Softplus, Unary::Tanh, Unary::LnCosh, Unary::XTanh, Unary::Gelu, Unary::Erfc] {
        let bounds = smooth_bounds(f).unwrap();
        for (order, &bound) in bounds.iter().enumerate().filter(|(_, bound)| bound.is_finite()) {
            let mut pieces: Vec<Interval> =
                (-640..640).map(|k| Interval::new(f64::from(k) / 16.0, f64::from(k + 1) / 16.0)).collect();
            let mut largest = 0.0_f64;
            while let Some(piece) = pieces.pop() {
                let at = |x: Interval| if order == 7 { seventh(f, x) } else { super::function::formulas(f, x)[order] };
                let middle = piece.middle();
                largest = largest.max(at(Interval::point(middle)).mignitude());
                if at(piece).magnitude() <= bound {
                    continue;
                }
                assert!(largest <= bound && piece.radius() > 1e-12, "{f:?} {order}: {bound} at {middle}");
                pieces.extend([Interval::new(piece.low, middle), Interval::new(middle, piece.high)]);
            }
            assert!(largest > 0.9 * bound, "{f:?} {order}: {largest} far below {bound}");
        }
    }
}
