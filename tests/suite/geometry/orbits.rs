//! Circular orbits, light, horizons and ergosurfaces of exact black holes, in every chart, against closed forms.

use lnn::geometry::{Equator, Sense, Turn};
use lnn::lagrangian::SystemInstance;
use lnn::scalar::{Dd, Scalar};

fn given(list: &[(&str, &str)]) -> Vec<(String, String)> {
    list.iter().map(|&(s, t)| (s.into(), t.into())).collect()
}

/// Radii of Boyer and Lindquist: innermost stable orbit, light, and the impact parameter of light, of mass 1 and spin `a`, negative for
/// orbits against it (Bardeen, Press and Teukolsky 1972).
fn kerr(a: f64) -> [f64; 3] {
    let z1 = 1.0 + (1.0 - a * a).cbrt() * ((1.0 + a).cbrt() + (1.0 - a).cbrt());
    let z2 = (3.0 * a * a + z1 * z1).sqrt();
    let stable = 3.0 + z2 - a.signum() * ((3.0 - z1) * (3.0 + z1 + 2.0 * z2)).sqrt();
    let light = 2.0 * (1.0 + (2.0 / 3.0 * (-a).acos()).cos());
    // w = 1/(a + r^(3/2)) with the spin, -1/(r^(3/2) - a) against it: signs are in a.
    [stable, light, a + light.powf(1.5)]
}

#[test]
fn orbits_of_kerr_are_the_closed_forms_in_both_charts() {
    for spin in ["0.3", "0.9", "0.99"] {
        let a: f64 = spin.parse().unwrap();
        let outer = 1.0 + (1.0 - a * a).sqrt();
        let sky = SystemInstance::<f64>::named("kerr-geodesic", &given(&[("a", spin)])).unwrap().build().unwrap();
        let flat = SystemInstance::<f64>::named("kerr-cartesian", &given(&[("a", spin)])).unwrap().build().unwrap();
        let polar = [0.0, 0.0, std::f64::consts::FRAC_PI_2, 0.7];
        let charts = [
            (Equator { model: &*sky, time: 0, radius: 1, turn: Turn::Angle(3), point: &polar }, 0.0),
            (Equator { model: &*flat, time: 0, radius: 1, turn: Turn::Across(2), point: &[0.0; 4] }, a * a),
        ];
        for (equator, shift) in charts {
            let chart = |r: f64| (r * r + shift).sqrt();
            let near = |found: f64, expected: f64, what: &str| {
                assert!((found / expected - 1.0).abs() < 1e-10, "a = {a}, {what}: {found} for {expected}");
            };
            let range = (chart(outer * 1.0001), 30.0);
            for (sense, signed) in [(Sense::Forward, a), (Sense::Backward, -a)] {
                let [stable, light, impact] = kerr(signed);
                near(equator.innermost_stable(range, sense).unwrap().unwrap().radius, chart(stable), "stable");
                let circle = equator.light(range, sense).unwrap().unwrap();
                near(circle.radius, chart(light), "light");
                near(circle.impact_parameter(), impact, "impact parameter");
                assert_eq!(circle.angular_velocity > 0.0, sense == Sense::Forward);
            }
            near(equator.ergosurface(range).unwrap().unwrap(), chart(2.0), "ergosurface");
            let near_radius = 3.0_f64;
            let dragging = 2.0 * a / (near_radius.powi(3) + a * a * (near_radius + 2.0));
            near(equator.at(chart(near_radius)).unwrap().dragging(), dragging, "dragging");
        }
        // Regular through the horizon; the other chart ends there.
        let through = (1.02, 30.0);
        let horizon = charts[1].0.horizon(through).unwrap().unwrap();
        assert!((horizon / (outer * outer + a * a).sqrt() - 1.0).abs() < 1e-9, "{horizon}");
        assert_eq!(charts[1].0.horizon((outer * 1.5, 30.0)).unwrap(), None);
    }
}

fn schwarzschild<S: Scalar>(tolerance: f64) {
    let flat = SystemInstance::<S>::named("schwarzschild-cartesian", &[]).unwrap().build().unwrap();
    let point = vec![S::of_f64(0.0); 4];
    let equator = Equator { model: &*flat, time: 0, radius: 1, turn: Turn::Across(2), point: &point };
    let range = (S::of_f64(1.2), S::of_f64(30.0));
    let near = |found: S, expected: S| {
        assert!(((found - expected) / expected).to_f64().abs() < tolerance, "{}: {found}", S::NAME);
    };
    for sense in [Sense::Forward, Sense::Backward] {
        near(equator.innermost_stable(range, sense).unwrap().unwrap().radius, S::of_f64(6.0));
        let light = equator.light(range, sense).unwrap().unwrap();
        near(light.radius, S::of_f64(3.0));
        near(light.impact_parameter(), lnn::scalar::Real::sqrt(S::of_f64(27.0)));
    }
    near(equator.horizon(range).unwrap().unwrap(), S::of_f64(2.0));
    near(equator.ergosurface(range).unwrap().unwrap(), S::of_f64(2.0));
}

#[test]
fn orbits_of_schwarzschild_are_found_in_every_precision() {
    schwarzschild::<f64>(1e-12);
    schwarzschild::<Dd>(1e-26);
    schwarzschild::<f32>(1e-3);
}

#[test]
fn a_charge_draws_light_inward_and_flat_space_has_no_orbits() {
    let hole =
        SystemInstance::<f64>::named("reissner-nordstrom-cartesian", &given(&[("Q", "0.8")])).unwrap().build().unwrap();
    let equator = Equator { model: &*hole, time: 0, radius: 1, turn: Turn::Across(2), point: &[0.0; 4] };
    let light = equator.light((1.0, 30.0), Sense::Forward).unwrap().unwrap().radius;
    // r = (3 M + sqrt(9 M^2 - 8 Q^2))/2
    assert!((light - (3.0 + (9.0 - 8.0 * 0.64_f64).sqrt()) / 2.0).abs() < 1e-11, "{light}");
    let horizon = equator.horizon((1.0, 30.0)).unwrap().unwrap();
    assert!((horizon - 1.6).abs() < 1e-11, "{horizon}");
    assert_eq!(equator.light((4.0, 30.0), Sense::Forward).unwrap(), None);
    let short = Equator { point: &[0.0; 3], ..equator };
    assert!(short.at(4.0).unwrap_err().to_string().starts_with("point of the equator: expected 4 numbers, found 3"));
    assert!(Equator { turn: Turn::Across(4), ..equator }.at(4.0).is_err());
}
