use super::*;
use crate::scalar::Dd;

/// Arguments over all scales, both signs, with the special values.
fn arguments<S: Scalar>() -> Vec<S> {
    let mut x = 0.37_f64;
    let mut list: Vec<S> = (0..20_003)
        .map(|k| {
            x = 3.97 * x * (1.0 - x);
            S::of_f64((x - 0.47) * 2.0_f64.powi(k % 34 - 20))
        })
        .collect();
    list.extend((1..400).map(|k| S::of_f64(f64::from(k) * std::f64::consts::FRAC_PI_4)));
    list.extend(
        [0.0, -0.0, 1.0, 5e-324, 1e-310, 1e-45, 1e-40, 1e30, -1e30, 1e300, 88.7, -103.5, 709.7, -745.0, -720.0]
            .map(S::of_f64),
    );
    list.extend([
        S::infinity(),
        -S::infinity(),
        S::nan(),
        S::max_value(),
        S::min_positive(),
        S::of_f64(1048576.5),
        S::of_f64(8192.5),
    ]);
    list
}

/// Largest error in units in the last place against double-double numbers.
fn worst<S: Scalar>(name: &str, x: &[S], found: &[S], exact: impl Fn(Dd) -> Dd) -> f64 {
    let smallest = S::min_positive().to_f64() * if S::NAME == "f32" { f64::from(f32::EPSILON) } else { f64::EPSILON };
    let mut worst = 0.0_f64;
    for (&x, &found) in x.iter().zip(found) {
        let exact = exact(x.cast());
        let nearest: S = exact.cast();
        if nearest.is_nan() || !nearest.is_finite() {
            assert!(
                found.is_nan() == nearest.is_nan() && (found == nearest || found.is_nan()),
                "{name}({x:?}) = {found:?}"
            );
            continue;
        }
        // One unit in the last place of the nearest number.
        let unit = Real::abs(nearest).ilogb().max(-2000);
        let unit = (S::epsilon().to_f64() * 2.0_f64.powi(unit)).max(smallest);
        let error = (found.cast::<Dd>() - exact).to_f64().abs() / unit;
        assert!(error <= 2.0, "{name}({x:?}) = {found:?}, not {nearest:?}: {error} units");
        worst = worst.max(error);
    }
    worst
}

fn accurate<S: Scalar>() {
    let x = arguments::<S>();
    let blank = || vec![S::nan(); x.len()];
    let (mut out, mut other) = (blank(), blank());
    let mut report = Vec::new();
    exp_lanes(&x, &mut out);
    report.push(("exp", worst("exp", &x, &out, Real::exp)));
    tanh_lanes(&x, &mut out);
    report.push(("tanh", worst("tanh", &x, &out, Real::tanh)));
    ln_lanes(&x, &mut out);
    report.push(("ln", worst("ln", &x, &out, Real::ln)));
    sqrt_lanes(&x, &mut out);
    report.push(("sqrt", worst("sqrt", &x, &out, Real::sqrt)));
    sin_cos_lanes(&x, &mut out, &mut other);
    report.push(("sin", worst("sin", &x, &out, Real::sin)));
    report.push(("cos", worst("cos", &x, &other, Real::cos)));
    let same = |a: &[S], b: &[S]| a.iter().zip(b).all(|(&a, &b)| a == b || (a.is_nan() && b.is_nan()));
    let mut single = blank();
    sin_lanes(&x, &mut single);
    assert!(same(&single, &out));
    cos_lanes(&x, &mut single);
    assert!(same(&single, &other));
    println!("{}: largest errors in units in the last place {report:?}", S::NAME);
}

#[test]
fn slices_are_accurate() {
    accurate::<f32>();
    accurate::<f64>();
}

#[test]
fn double_double_slices_are_the_functions() {
    let x = [Dd::pi(), Dd::of_f64(-0.3), Dd::of_f64(1e22)];
    let (mut sin, mut cos) = (x, x);
    sin_cos_lanes(&x, &mut sin, &mut cos);
    for ((x, sin), cos) in x.into_iter().zip(sin).zip(cos) {
        assert_eq!((sin, cos), Real::sin_cos(x));
    }
}
