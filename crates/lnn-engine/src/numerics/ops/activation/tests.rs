use super::Activation;
use crate::scalar::{Dd, Real, Scalar};

/// 175 points: dense near 0, out to 1000 on both sides, subnormals, and the sign changes of the derivatives.
fn points() -> Vec<f64> {
    let mut magnitudes: Vec<f64> = (0..40).map(|k| f64::from(k) * 0.23).collect();
    magnitudes.extend((0..24).map(|k| 9.5 + 1.27 * f64::from(k)));
    magnitudes.extend([45.0, 88.0, 104.0, 160.0, 360.0, 700.0, 709.5, 745.0, 1000.0]);
    magnitudes.extend([1e-3, 1e-8, 1e-20, 1e-30, 1e-37, 1e-38, 1e-40, 1e-45, 1e-300, 3e-308, 1e-310, 5e-324]);
    magnitudes.extend([std::f64::consts::SQRT_2, 0.792, 2.52]);
    let mut points: Vec<f64> = magnitudes.iter().flat_map(|&m| [m, -m]).collect();
    points.drain(..1);
    points
}

/// Case 1 of the stress list: every derivative against double-double numbers, within its own condition.
fn tails<S: Scalar>(smallest: f64) {
    assert_eq!(points().len(), 175);
    for activation in Activation::ALL {
        for x in points().into_iter().map(S::of_f64) {
            let exact = activation.derivatives(x.cast::<Dd>());
            let found = activation.derivatives(x);
            // The condition of the highest derivative needs one more; a difference quotient is enough for a bound.
            let step = Dd::of_f64(1e-9);
            let fifth = (activation.derivatives(x.cast::<Dd>() + step)[4] - exact[4]) / step;
            for order in 0..5 {
                let next = if order < 4 { exact[order + 1] } else { fifth };
                let slope = (x.to_f64() * next.to_f64()).abs();
                let scale = exact[order].to_f64().abs();
                let tolerance = 8.0 * S::epsilon().to_f64() * (scale + slope) + 2.0 * smallest;
                let error = (found[order].cast::<Dd>() - exact[order]).to_f64().abs();
                assert!(found[order].is_finite(), "{activation} {} order {order} at {x:?}", S::NAME);
                assert!(
                    error <= tolerance,
                    "{activation} {} order {order} at {x:?}: {:?} instead of {:?}, {} of the tolerance",
                    S::NAME,
                    found[order],
                    exact[order],
                    error / tolerance
                );
            }
        }
    }
}

#[test]
fn tails_f64() {
    tails::<f64>(5e-324);
}
#[test]
fn tails_f32() {
    tails::<f32>(1.5e-45);
}

/// Random points over all scales, both signs; odd length for the remainder of the vector loops.
fn cloud<S: Scalar>() -> Vec<S> {
    let mut x = 0.3_f64;
    (0..1003)
        .map(|k| {
            x = 3.9 * x * (1.0 - x);
            S::of_f64((x - 0.5) * 2.0_f64.powi(k % 12 - 4))
        })
        .collect()
}

/// The slices agree bit for bit with the single point.
fn slices_match_points<S: Scalar>() {
    let mut z = cloud::<S>();
    z.extend([0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e30, -1e30, 1e-40].map(S::of_f64));
    let blank = || vec![S::nan(); z.len()];
    let same = |a: S, b: S| a == b || (a.is_nan() && b.is_nan());
    for activation in Activation::ALL {
        let (mut f, mut d1, mut d2, mut d3) = (blank(), blank(), blank(), blank());
        activation.jet3(&z, &mut f, &mut d1, &mut d2, &mut d3);
        let (mut f2, mut d12, mut d22) = (blank(), blank(), blank());
        activation.jet2(&z, &mut f2, &mut d12, &mut d22);
        let (mut f1, mut d11, mut f0) = (blank(), blank(), blank());
        activation.jet1(&z, &mut f1, &mut d11);
        activation.value(&z, &mut f0);
        for (k, &x) in z.iter().enumerate() {
            let jet = activation.derivatives(x);
            for (found, order) in [
                (f[k], 0),
                (d1[k], 1),
                (d2[k], 2),
                (d3[k], 3),
                (f2[k], 0),
                (d12[k], 1),
                (d22[k], 2),
                (f1[k], 0),
                (d11[k], 1),
                (f0[k], 0),
            ] {
                assert!(same(found, jet[order]), "{activation} {} order {order} at {x:?}: {found:?} {jet:?}", S::NAME);
            }
        }
    }
}

#[test]
fn slices_match_points_in_every_precision() {
    slices_match_points::<f32>();
    slices_match_points::<f64>();
    slices_match_points::<Dd>();
}

#[test]
fn gelu_changes_sign_where_it_should() {
    let roots = [(2, 2.0_f64.sqrt()), (4, ((7.0 - 33.0_f64.sqrt()) / 2.0).sqrt())];
    for (order, root) in roots {
        let at = |x: f64| Activation::Gelu.derivatives(x)[order];
        let sign = at(root * (1.0 - 1e-15)).signum();
        assert_eq!(at(root * (1.0 + 2e-15)).signum(), -sign);
        assert!(at(root).abs() <= 8.0 * f64::EPSILON);
    }
    let third = |x: f64| Activation::Gelu.derivatives(x)[3];
    assert_eq!(third(0.0), 0.0);
    assert!(third(1e-300) < 0.0 && third(-1e-300) > 0.0);
    let density = 1.0 / (2.0 * std::f64::consts::PI).sqrt();
    assert!((third(1e-300) / (-4.0 * density * 1e-300) - 1.0).abs() < 8.0 * f64::EPSILON);
}

fn identities<S: Scalar>() {
    let two = <S as Real>::two();
    for x in cloud::<S>().into_iter().chain([1e-30, 7.5, 1e20].map(S::of_f64)) {
        for activation in [Activation::Gelu, Activation::Softplus, Activation::Silu] {
            // Both values are rounded: softplus is ln 2 at x = 0.
            let size = Real::abs(x) + activation.derivatives(-Real::abs(x))[0];
            let tolerance = two * S::epsilon() * Real::abs(size);
            let difference = activation.derivatives(x)[0] - activation.derivatives(-x)[0];
            assert!(Real::abs(difference - x) <= tolerance, "{activation} {} at {x:?}", S::NAME);
        }
        assert_eq!(Activation::XTanh.derivatives(x)[0], Activation::XTanh.derivatives(-x)[0]);
        assert_eq!(Activation::Tanh.derivatives(x)[0], -Activation::Tanh.derivatives(-x)[0]);
    }
}

#[test]
fn reflections() {
    identities::<f32>();
    identities::<f64>();
    identities::<Dd>();
}

#[test]
fn limits_at_infinity() {
    fn check<S: Scalar>() {
        let (up, down) = (S::infinity(), -S::infinity());
        let zero = <S as Real>::zero();
        let one = <S as Real>::one();
        assert_eq!(Activation::Gelu.derivatives(up), [up, one, zero, zero, zero]);
        assert_eq!(Activation::Gelu.derivatives(down), [zero; 5]);
        assert_eq!(Activation::Softplus.derivatives(up)[0], up);
        assert_eq!(Activation::Softplus.derivatives(up)[1..], [one, zero, zero, zero]);
        assert_eq!(Activation::Softplus.derivatives(down), [zero; 5]);
        assert_eq!(Activation::XTanh.derivatives(up), [up, one, zero, zero, zero]);
        assert_eq!(Activation::XTanh.derivatives(down), [up, -one, zero, zero, zero]);
        assert_eq!(Activation::Silu.derivatives(up), [up, one, zero, zero, zero]);
        assert_eq!(Activation::Silu.derivatives(down), [zero; 5]);
        assert_eq!(Activation::Tanh.derivatives(down), [-one, zero, zero, zero, zero]);
        for activation in Activation::ALL {
            let jet = activation.derivatives(S::nan());
            assert!(jet[0].is_nan());
            // The slope of a straight line does not depend on its argument.
            assert_eq!(jet[1].is_nan(), activation != Activation::Identity);
        }
    }
    check::<f32>();
    check::<f64>();
    check::<Dd>();
}

/// The reference in plain operations agrees where nothing cancels.
#[test]
fn reference_agrees() {
    fn check<S: Scalar>() {
        let fraction = if S::NAME == "f32" { f64::from(f32::EPSILON) } else { f64::EPSILON };
        let smallest = S::min_positive() * S::of_f64(fraction);
        for x in cloud::<S>() {
            for activation in Activation::ALL {
                let (value, reference) = (activation.derivatives(x), activation.apply(x));
                let slope = Real::abs(x * value[1]) + Real::abs(value[0]);
                let tolerance = S::of_f64(8.0) * S::epsilon() * slope + S::of_f64(64.0) * smallest;
                let error = Real::abs(value[0] - reference);
                assert!(error <= tolerance, "{activation} {} at {x:?}: {:?} {reference:?}", S::NAME, value[0]);
            }
        }
    }
    check::<f32>();
    check::<f64>();
    check::<Dd>();
}

/// Each derivative is the slope of the one below it, in double-double numbers.
#[test]
fn derivatives_are_slopes() {
    let step = Dd::of_f64(1e-7);
    for activation in Activation::ALL {
        for k in -40..=40 {
            let x = Dd::of_f64(f64::from(k) * 0.17);
            let (ahead, behind, here) =
                (activation.derivatives(x + step), activation.derivatives(x - step), activation.derivatives(x));
            for order in 0..4 {
                let slope = (ahead[order] - behind[order]) / (step + step);
                assert!(Real::abs(slope - here[order + 1]).to_f64() < 1e-12, "{activation} order {order} at {x}");
            }
        }
    }
}

#[test]
fn variance_gains_agree_with_quadrature() {
    assert!((Activation::Quadratic.variance_gain() - 0.5).abs() < 1e-12);
    assert!((Activation::Identity.variance_gain() - 1.0).abs() < 1e-12);
    // 30-digit quadrature with mpmath.
    let table = [
        (Activation::Gelu, 1.4811144127083482),
        (Activation::Softplus, 1.8462285453386054),
        (Activation::XTanh, 1.3895197216166868),
        (Activation::Tanh, 1.467413591630795),
        (Activation::Silu, 1.6233202579524975),
    ];
    for (activation, gain) in table {
        assert!((activation.variance_gain() - gain).abs() < 1e-12, "{activation}: {}", activation.variance_gain());
    }
}
