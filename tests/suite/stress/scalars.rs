//! Case 6: angles of any size.

use super::record::Row;
use crate::common::matrices::dd;
use lnn::scalar::{Real, Scalar, sin_cos_lanes};

/// Sine and cosine at powers of two and next to multiples of `pi/2`, in units of the last place.
fn large_angles<S: Scalar>(most: i32) {
    let mut angles: Vec<S> = (0..=most).map(|k| S::of_f64(1.0).ldexp(k)).collect();
    // The double nearest to a multiple of pi/2 (Muller et al., Handbook of Floating-Point Arithmetic).
    let hard = S::of_f64(6381956970095103.0).ldexp(797);
    angles.extend(hard.is_finite().then_some(hard));
    for k in 1..2000 {
        let multiple = S::of_f64(f64::from(k * k) * std::f64::consts::FRAC_PI_2);
        angles.extend([multiple, -multiple, multiple.ldexp(k % (most - 22))]);
    }
    let mut single = Row::new::<S>(6, "sin, cos of large angles, one at a time");
    let mut lanes = Row::new::<S>(6, "sin, cos of large angles, slices");
    let (mut sin, mut cos) = (angles.clone(), angles.clone());
    sin_cos_lanes(&angles, &mut sin, &mut cos);
    for (k, &x) in angles.iter().enumerate() {
        let (exact_sin, exact_cos) = dd(x).sin_cos();
        let both = x.sin_cos();
        for (exact, alone, slices) in [(exact_sin, [x.sin(), both.0], sin[k]), (exact_cos, [x.cos(), both.1], cos[k])] {
            let nearest: S = exact.cast();
            let unit = S::epsilon().to_f64() * 2.0_f64.powi(nearest.ilogb());
            let error = |found: S| (dd(found) - exact).to_f64().abs() / unit;
            alone.into_iter().for_each(|found| single.see(error(found), || format!("x = {x:?}")));
            lanes.see(error(slices), || format!("x = {x:?}"));
        }
    }
    single.end_below(1.0);
    lanes.end_below(2.0);
}

#[test]
fn case_06_large_angles() {
    large_angles::<f32>(127);
    large_angles::<f64>(1000);
}
