use super::Dd;
use super::table::{VALUES, VALUES_IN_TWO_PARTS};
use crate::scalar::{Real, Scalar};
use num_traits::{FloatConst, FromPrimitive, Num, ToPrimitive};

fn call<R: Real>(name: &str, x: R) -> R {
    match name {
        "exp" => x.exp(),
        "exp_m1" => x.exp_m1(),
        "ln" => x.ln(),
        "ln_1p" => x.ln_1p(),
        "sin" => x.sin(),
        "cos" => x.cos(),
        "tan" => x.tan(),
        "asin" => x.asin(),
        "acos" => x.acos(),
        "atan" => x.atan(),
        "sinh" => x.sinh(),
        "cosh" => x.cosh(),
        "tanh" => x.tanh(),
        "erfc" => Real::erfc(x),
        "logistic" => x.logistic(),
        "softplus" => x.softplus(),
        "sqrt" => Real::sqrt(x),
        other => panic!("no function {other}"),
    }
}

/// Relative error of at most `1e-30`, plus what the trailing part loses where it is subnormal.
fn check(name: &str, x: Dd, value: &str) {
    let exact = Dd::parse(value).unwrap();
    let found = call(name, x);
    let error = Real::abs(found - exact).to_f64();
    let tolerance = 1e-30 * exact.to_f64().abs() + 4.0 * 5e-324;
    assert!(error <= tolerance, "{name}({x:?}) = {found:?}, not {exact:?}: relative {}", error / exact.to_f64().abs());
}

#[test]
fn independent_values() {
    for &(name, x, value) in VALUES {
        check(name, Dd::of_f64(x), value);
    }
    for &(name, high, low, value) in VALUES_IN_TWO_PARTS {
        check(name, Dd::new(high, low), value);
    }
}

#[test]
fn no_argument_panics() {
    let names: std::collections::BTreeSet<_> = VALUES.iter().map(|row| row.0).collect();
    let sizes = [0.0, 5e-324, 1e-300, 1e-17, 0.5, 1.0, 2147483648.5, 1e17, 1e300, f64::MAX, f64::INFINITY];
    for name in names {
        for size in sizes {
            for x in [Dd::of_f64(size), Dd::of_f64(-size)] {
                let (found, plain) = (call(name, x), call(name, x.to_f64()));
                assert_eq!(found.is_nan(), plain.is_nan(), "{name}({x:?}) = {found:?}, f64: {plain}");
                let close = found.to_f64() == plain || (found.to_f64() / plain - 1.0).abs() < 1e-12;
                assert!(plain.is_nan() || close || plain.abs() < 1e-300, "{name}({x:?}) = {found:?}, f64: {plain}");
            }
        }
        assert!(call(name, Dd::nan()).is_nan());
    }
    // Where the exponential's reduction rounds to either side.
    for k in -2000..2000 {
        let x = std::f64::consts::LN_2 / 256.0 * f64::from(2 * k + 1);
        assert!((call("exp", Dd::of_f64(x)).to_f64() / x.exp() - 1.0).abs() < 1e-14);
        assert!((call("sinh", Dd::of_f64(x)).to_f64() / x.sinh() - 1.0).abs() < 1e-14);
    }
}

#[test]
fn arithmetic_at_the_ends_of_the_range() {
    let (inf, one, tiny, max) = (Dd::infinity(), Dd::of_f64(1.0), Dd::of_f64(5e-324), Dd::max_value());
    assert_eq!(inf + one, inf);
    assert_eq!(one - inf, -inf);
    assert!((inf - inf).is_nan());
    assert_eq!(inf * -one, -inf);
    assert!((inf * Dd::of_f64(0.0)).is_nan());
    assert_eq!(one / inf, Dd::of_f64(0.0));
    assert_eq!(one / Dd::of_f64(0.0), inf);
    assert_eq!(max + max, inf);
    assert_eq!(max * max, inf);
    assert_eq!(tiny / tiny, one);
    assert_eq!(max / max, one);
    assert_eq!(Real::recip(tiny), inf);
    assert_eq!(Real::powi(Dd::of_f64(2.0), -1074), tiny);
    assert_eq!(Real::powi(Dd::of_f64(-3.0), 5), Dd::of_f64(-243.0));
    assert!(
        Real::max(Dd::nan(), one).is_nan() && Real::max(one, Dd::nan()).is_nan() && Real::min(one, Dd::nan()).is_nan()
    );
}

#[test]
fn division_and_roots_invert() {
    for k in 1..500 {
        let x = Dd::of_f64(f64::from(k) * 0.37).exp().sin() * Dd::of_f64(1e3);
        let y = Dd::of_f64(f64::from(k) * 0.73).cos();
        assert!(Real::abs(x / y * y - x) <= Real::abs(x) * Dd::epsilon());
        let root = Real::sqrt(Real::abs(x));
        assert!(Real::abs(root * root - Real::abs(x)) <= Real::abs(x) * Dd::epsilon());
        let power = Real::powf(Real::abs(x), y);
        let back = Real::powf(power, Real::recip(y));
        assert!(Real::abs(back / Real::abs(x) - Dd::of_f64(1.0)).to_f64() < 1e-28 / y.to_f64().abs());
    }
}

#[test]
fn angles_of_points() {
    for k in -64..64 {
        let angle = Dd::of_f64(f64::from(k) * 0.0490873) + Dd::of_f64(1e-20);
        let (s, c) = angle.sin_cos();
        for size in [1e-200, 1.0, 1e300] {
            let (y, x) = (s * Dd::of_f64(size), c * Dd::of_f64(size));
            assert!(Real::abs(Real::atan2(y, x) - angle).to_f64() <= 1e-30 * angle.to_f64().abs().max(1e-20));
        }
    }
    let zero = Dd::of_f64(0.0);
    assert_eq!(Real::atan2(zero, -Dd::of_f64(1.0)), <Dd as Scalar>::pi());
    assert_eq!(Real::atan2(-Dd::infinity(), Dd::of_f64(1.0)).to_f64(), -std::f64::consts::FRAC_PI_2);
}

fn wraps<S: Scalar>() {
    let turn = S::pi() + S::pi();
    for k in -300..300 {
        let x = S::of_f64((f64::from(k) * 0.25).sinh() * 1.3);
        let wrapped = x.wrap_angle();
        assert!(wrapped >= <S as Real>::zero() && wrapped < turn, "{x:?} {wrapped:?}");
        let exact = x.cast::<Dd>().wrap_angle();
        let error = (wrapped.cast::<Dd>() - exact).to_f64().abs();
        let error = error.min((error - 2.0 * std::f64::consts::PI).abs());
        assert!(error <= 4.0 * S::epsilon().to_f64() * exact.to_f64().abs().max(1.0), "{x:?}: {wrapped:?} {exact:?}");
        assert!(Real::abs(wrapped.cast::<Dd>().sin() - x.cast::<Dd>().sin()).to_f64() <= 30.0 * S::epsilon().to_f64());
    }
    assert_eq!((-S::min_positive()).wrap_angle().to_f64(), 0.0);
    assert!(S::infinity().wrap_angle().is_nan() && S::nan().wrap_angle().is_nan());
}

#[test]
fn angles_wrap() {
    wraps::<f32>();
    wraps::<f64>();
    wraps::<Dd>();
}

#[test]
fn reads_exactly() {
    let third = Dd::parse("0.33333333333333333333333333333333333333333333333333").unwrap();
    assert_eq!(third, Dd::of_f64(1.0) / Dd::of_f64(3.0));
    assert_eq!(Dd::parse("3.14159265358979323846264338327950288419716939937510582097"), Some(<Dd as Scalar>::pi()));
    let tenth = Dd::parse("0.1").unwrap();
    assert_eq!(tenth.parts(), (0.1, -5.551115123125783e-18));
    assert_eq!(Dd::parse("-0.1"), Some(-tenth));
    assert_eq!(Dd::parse("+100e-3"), Some(tenth));
    assert_eq!(Dd::parse("1e999999"), Some(Dd::infinity()));
    assert_eq!(Dd::parse("-1e99999999999999999999999"), Some(-Dd::infinity()));
    assert_eq!(Dd::parse("1e-999999"), Some(Dd::of_f64(0.0)));
    assert_eq!(Dd::parse("4.9e-324"), Some(Dd::of_f64(5e-324)));
    assert_eq!(Dd::parse("1e22"), Some(Dd::of_f64(1e22)));
    assert!(Dd::parse("NaN").is_some_and(Scalar::is_nan));
    for wrong in ["", " 1", "1 ", "1,0", "0x1", "1e", ".", "--1", "1e5.0"] {
        assert_eq!(Dd::parse(wrong), None, "{wrong}");
    }
    // Digits beyond those kept still decide.
    let long = format!("1{}1e-3000", "0".repeat(3000));
    assert_eq!(Dd::parse(&long), Some(Dd::of_f64(10.0)));
    let zeros = format!("0.{}1e5001", "0".repeat(5000));
    assert_eq!(Dd::parse(&zeros), Some(Dd::of_f64(1.0)));
}

proptest::proptest! {
    #[test]
    fn text_reads_back(high: f64, low in -1.0..1.0_f64, gap in 53..400_i32) {
        let x = Dd::new(high, high * low * 2.0_f64.powi(-gap));
        let back = Dd::parse(&x.to_text()).unwrap();
        proptest::prop_assert!(back == x || x.is_nan(), "{x:?} {} {back:?}", x.to_text());
    }

    #[test]
    fn primitive_text_reads_back(x: f64, y: f32) {
        proptest::prop_assert!(f64::parse(&x.to_text()) == Some(x) || x.is_nan());
        proptest::prop_assert!(f32::parse(&y.to_text()) == Some(y) || y.is_nan());
    }
}

#[test]
fn writes_reasonably() {
    assert_eq!(Dd::of_f64(0.5).to_text(), "0.5");
    assert_eq!(Dd::parse("0.1").unwrap().to_text(), "0.1");
    assert_eq!(<Dd as Scalar>::pi().to_text(), "3.1415926535897932384626433832795");
    assert_eq!((-Dd::infinity()).to_text(), "-inf");
    assert_eq!(Dd::new(1.0, 1e-200).to_text().parse(), Ok(Dd::new(1.0, 1e-200)));
}

#[test]
fn converts() {
    assert_eq!(Dd::from_i64(i64::MAX).and_then(|x| x.to_i64()), Some(i64::MAX));
    assert_eq!(Dd::from_i64(i64::MIN).and_then(|x| x.to_i64()), Some(i64::MIN));
    assert_eq!(Dd::from_u64(u64::MAX).and_then(|x| x.to_u64()), Some(u64::MAX));
    assert_eq!(Dd::from_u64(u64::MAX).and_then(|x| x.to_i64()), None);
    assert_eq!(Dd::from_i128(i128::MAX).map(|x| x.to_f64()), Some(2.0_f64.powi(127)));
    assert_eq!(Dd::nan().to_i64(), None);
    assert_eq!(Dd::new(-2.0, 1e-20).to_i64(), Some(-1));
    assert_eq!(Dd::from_str_radix("2.5", 10), Ok(Dd::of_f64(2.5)));
    assert!(Dd::from_str_radix("2.5", 2).is_err());
    assert_eq!(Dd::of_f64(7.5) % Dd::of_f64(2.0), Dd::of_f64(1.5));
    assert_eq!(Dd::of_f64(-7.5) % Dd::of_f64(2.0), Dd::of_f64(-1.5));
    let close = |a: Dd, b: Dd| Real::abs(a - b) <= Real::abs(b) * Dd::epsilon();
    assert!(close(Dd::E(), Dd::of_f64(1.0).exp()));
    assert!(close(Dd::LN_10(), Dd::of_f64(10.0).ln()));
    assert!(close(Dd::SQRT_2(), Real::sqrt(Dd::of_f64(2.0))));
    assert!(close(Dd::FRAC_PI_3() * Dd::of_f64(3.0), <Dd as Scalar>::pi()));
    assert!(close(Dd::LOG2_10() * Dd::LOG10_2(), Dd::of_f64(1.0)));
}
