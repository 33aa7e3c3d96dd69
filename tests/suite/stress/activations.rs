//! Cases 2 to 4: sign changes, reflections, kinks.

use super::record::{Row, exact};
use crate::common::matrices::dd;
use lnn::forward::{Dual, HyperDual, Jet2};
use lnn::network::Activation;
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Program, Replay, ScalarFunction, gradient, hessian};
use std::sync::Arc;

/// Derivatives of GELU where they change sign, against the largest of the terms they are sums of.
fn sign_changes<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut closed = Row::new::<S>(2, "GELU'', ''', '''' at their zeros: closed forms");
    let mut nested = Row::new::<S>(2, "GELU'' at sqrt 2: nested forward numbers");
    let root = |x: f64| ((7.0 + x * 33.0_f64.sqrt()) / 2.0).sqrt();
    for (order, zero) in [(2, 2.0_f64.sqrt()), (3, 0.0), (3, 2.0), (4, root(-1.0)), (4, root(1.0))] {
        for (k, sign) in (-200..=200).flat_map(|k| [(k, 1.0), (k, -1.0)]) {
            let step = if zero == 0.0 { 2.0_f64.powi(-30) } else { eps * 2.0 };
            let x = S::of_f64(sign * zero) + S::of_f64(f64::from(k) * step);
            let wide = Activation::Gelu.derivatives(dd(x))[order];
            let found = Activation::Gelu.derivatives(x)[order];
            let y = x.to_f64().abs();
            let density = (-0.5 * y * y).exp() / (2.0 * std::f64::consts::PI).sqrt();
            let term = density
                * match order {
                    2 => f64::max(2.0, y * y),
                    3 => f64::max(4.0 * y, y.powi(3)),
                    _ => f64::max(4.0, f64::max(7.0 * y * y, y.powi(4))),
                };
            let unit = (eps * term).max(f64::MIN_POSITIVE);
            closed.see((dd(found) - wide).to_f64().abs() / unit, || format!("order {order}, x = {x:?}"));
            // Beyond the rounding of one term the sign is that of the exact derivative.
            if wide.to_f64().abs() > 8.0 * unit {
                assert_eq!(found.to_f64() > 0.0, wide.to_f64() > 0.0, "order {order}, {x:?}");
            }
            if order == 2 {
                let one = <S as Real>::one();
                let jet = Activation::Gelu.apply(HyperDual::new(x, one, one, S::of_f64(0.0)));
                nested.see((dd(jet.st) - wide).to_f64().abs() / unit, || format!("x = {x:?}"));
            }
        }
    }
    closed.end_below(8.0);
    nested.end_below(8.0);
}

#[test]
fn case_02_derivatives_change_sign_where_they_should() {
    sign_changes::<f32>();
    sign_changes::<f64>();
}

/// Errors of `gelu(x) - gelu(-x) = x` and of the same for softplus; parity of the rest to the bit.
fn reflected<S: Scalar>(x: S, rows: &mut [Row; 2]) {
    let jets = |f: Activation| (f.derivatives(x)[0], f.derivatives(-x)[0]);
    // Among the subnormal numbers each value is a whole multiple of the smallest.
    let smallest = S::min_positive().to_f64() * S::epsilon().to_f64();
    let (up, down) = jets(Activation::Gelu);
    let error = |up: S, down: S| (dd(up) - dd(down) - dd(x)).to_f64().abs();
    let size = x.to_f64().abs();
    let gelu = (error(up, down) - smallest).max(0.0) / (S::epsilon().to_f64() * size).max(smallest);
    rows[0].see(gelu, || format!("x = {x:?}"));
    let (up, down) = jets(Activation::Softplus);
    // Both values are ln 2 at 0 and rounded themselves: their size counts, not that of x alone.
    let size = size + down.to_f64().min(up.to_f64());
    rows[1].see(error(up, down) / (S::epsilon().to_f64() * size), || format!("x = {x:?}"));
    for even in [Activation::XTanh, Activation::Quadratic] {
        let (up, down) = jets(even);
        assert_eq!(up, down, "{even} at {x:?}");
    }
    let (up, down) = jets(Activation::Tanh);
    assert_eq!(up, -down, "tanh at {x:?}");
}

fn reflection_rows<S: Scalar>() -> [Row; 2] {
    [Row::new::<S>(3, "gelu(x) - gelu(-x) = x"), Row::new::<S>(3, "softplus(x) - softplus(-x) = x")]
}

/// Every binade from the subnormal numbers to the largest.
fn reflections<S: Scalar>() {
    let mut rows = reflection_rows::<S>();
    let lowest = S::min_positive().ilogb() + S::epsilon().ilogb();
    for exponent in lowest..=S::max_value().ilogb() {
        for k in 0..48 {
            reflected(S::of_f64(1.0 + (f64::from(k) + 0.37) / 48.0).ldexp(exponent), &mut rows);
        }
    }
    rows.into_iter().for_each(|row| row.end_below(2.0));
}

#[test]
fn case_03_reflections_in_every_binade() {
    reflections::<f32>();
    reflections::<f64>();
}

#[test]
#[ignore = "long"]
fn case_03_reflections_of_every_single_precision_number() {
    let mut rows = reflection_rows::<f32>();
    (1..f32::INFINITY.to_bits()).for_each(|bits| reflected(f32::from_bits(bits), &mut rows));
    rows.into_iter().for_each(|row| row.end_below(2.0));
}

/// `max(x, 0)` and `|x|`.
struct Kink(bool);

impl ScalarFunction for Kink {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        if self.0 { x[0].relu() } else { x[0].abs() }
    }
}

/// Both derivatives at both zeros by every kind of number.
fn kinks<S: Scalar>() {
    let (zero, one) = (S::of_f64(0.0), S::of_f64(1.0));
    let mut checks = 0;
    for kink in [Kink(true), Kink(false)] {
        for x in [zero, -zero] {
            let hyper = kink.eval(&[HyperDual::new(x, one, one, zero)]);
            let jet = kink.eval(&[Jet2::<S, 1>::variable(x, 0)]);
            let (_, first, second) = hessian(&kink, &[x]).unwrap();
            let all = [
                kink.eval(&[Dual::new(x, one)]).tangent,
                hyper.s,
                hyper.t,
                hyper.st,
                jet.gradient[0],
                jet.second(0, 0),
                gradient(&kink, &[x]).unwrap().1[0],
                first[0],
                second[0],
            ];
            assert!(all.iter().all(|&d| d == zero), "{all:?}");
            checks += all.len();
            for lanes in [1, 70] {
                let record =
                    Program::<S>::record(1, 0, |x, _| vec![kink.eval(&[Dual::new(x[0], Real::one())]).tangent]);
                let program = record.unwrap();
                let mut slopes = vec![S::nan(); lanes];
                let mut replay = Replay::new(Arc::new(program));
                replay.evaluate(lanes, &[&vec![x; lanes]], &[], &mut [&mut slopes]).unwrap();
                assert!(slopes.iter().all(|&d| d == zero), "{slopes:?}");
                checks += lanes;
            }
        }
        // On either side the slopes are those of the straight lines.
        let smallest = S::min_positive();
        assert_eq!(gradient(&kink, &[smallest]).unwrap().1, [one]);
        assert_eq!(gradient(&kink, &[-smallest]).unwrap().1, [if kink.0 { zero } else { -one }]);
    }
    exact::<S>(4, "relu'(0) = |.|'(0) = 0 at both zeros", checks);
}

#[test]
fn case_04_kinks() {
    kinks::<f32>();
    kinks::<f64>();
    kinks::<Dd>();
}
