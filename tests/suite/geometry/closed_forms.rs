//! Curvature against closed forms: in double-double to 26 digits, in every precision within a few roundings.

use super::spaces::{SPACES, Space, dd};
use crate::common::accuracy::configure;
use lnn::geometry::Geometry;
use lnn::scalar::{Dd, Real, Scalar};

fn largest<S: Scalar>(x: &[S]) -> f64 {
    x.iter().map(|x| x.abs().to_f64()).fold(0.0, f64::max)
}

/// Sizes that rounding is measured by: the sums of the absolute values of what is added up in `R` and in `R_abcd R^abcd`, the
/// terms of `R_abcd` among them.
fn sizes<S: Scalar>(space: &Space, q: &[f64], geometry: &Geometry<S>) -> (f64, f64) {
    let n = q.len();
    let model = space.model::<Dd>();
    let jet = &model.metric_jets(&q.iter().map(|&x| dd(x)).collect::<Vec<_>>(), &vec![dd(0.0); n]).unwrap()[0];
    let size = |x: &[Dd], place: usize| x[place].abs().to_f64();
    let (up, down) = (&geometry.connection.symbols, &geometry.connection.lowered);
    let place = |a: usize, b: usize, c: usize, d: usize| ((a * n + b) * n + c) * n + d;
    let inverse: Vec<f64> = geometry.metric.inverse.iter().map(|x| x.abs().to_f64()).collect();
    let mut bounds = vec![0.0; n.pow(4)];
    for (k, bound) in bounds.iter_mut().enumerate() {
        let (a, b, c, d) = (k / n.pow(3), k / n.pow(2) % n, k / n % n, k % n);
        let second = |k, l, i, j| 0.5 * size(&jet.second, place(k, l, i, j));
        let symbols = |e: usize, i: usize, j: usize, k: usize, l: usize| {
            (down[(e * n + i) * n + j] * up[(e * n + k) * n + l]).abs().to_f64()
        };
        let turned: f64 = (0..n).map(|e| symbols(e, b, c, a, d) + symbols(e, b, d, a, c)).sum();
        *bound = second(b, c, a, d) + second(a, d, b, c) + second(a, c, b, d) + second(b, d, a, c) + turned;
    }
    let mut scalar = 0.0;
    let mut invariant = 0.0;
    // |g^ae| |g^bf| B_efcd
    let mut mixed = vec![0.0; n.pow(4)];
    for (k, mixed) in mixed.iter_mut().enumerate() {
        let (a, b, c, d) = (k / n.pow(3), k / n.pow(2) % n, k / n % n, k % n);
        for e in 0..n {
            for f in 0..n {
                *mixed += inverse[a * n + e] * inverse[b * n + f] * bounds[place(e, f, c, d)];
            }
        }
        if a == c && b == d {
            scalar += *mixed;
        }
    }
    // Errors of a product: that of one factor times the size of the other.
    for (k, &bound) in mixed.iter().enumerate() {
        let (a, b, c, d) = (k / n.pow(3), k / n.pow(2) % n, k / n % n, k % n);
        let exact: f64 = (0..n * n)
            .map(|cd| {
                let (e, f) = (cd / n, cd % n);
                let (by_c, by_d) = (&geometry.metric.inverse[c * n + e], &geometry.metric.inverse[d * n + f]);
                (*by_c * *by_d * geometry.curvature.lowered[place(e, f, a, b)]).to_f64()
            })
            .sum();
        invariant += 2.0 * bound * exact.abs();
    }
    (scalar, invariant)
}

/// Largest error of the invariants of a space in roundings of what is added up.
fn worst<S: Scalar>(space: &Space) -> f64 {
    let mut worst = 0f64;
    for q in space.points {
        let (r, k) = (space.invariants)(&q.iter().map(|&x| dd(S::of_f64(x).to_f64())).collect::<Vec<_>>());
        let found = space.at::<S>(q);
        let (size_r, size_k) = sizes(space, q, &found);
        let kretschmann = found.curvature.kretschmann;
        for (found, exact, size) in [(found.curvature.scalar, r, size_r), (kretschmann, k, size_k)] {
            let error = (found.cast::<Dd>() - exact).abs().to_f64();
            let unit = S::epsilon().to_f64() * (size + exact.abs().to_f64());
            worst = worst.max(if error == 0.0 { 0.0 } else { error / unit });
        }
    }
    worst
}

#[test]
fn invariants_are_those_of_the_closed_forms() {
    for space in SPACES {
        let found = [worst::<f32>(space), worst::<f64>(space), worst::<Dd>(space)];
        println!("{}: R = {found:.2?} in f32, f64, dd", space.name);
        assert!(found.iter().all(|&r| r < 30.0), "{}: {found:?}", space.name);
    }
}

#[test]
fn double_double_keeps_26_digits() {
    for space in SPACES {
        for q in space.points {
            let (r, k) = (space.invariants)(&q.iter().map(|&x| dd(x)).collect::<Vec<_>>());
            let found = space.at::<Dd>(q);
            let kretschmann = found.curvature.kretschmann;
            // Where an invariant is 0, the other components say what is small.
            let unit = largest(&found.curvature.lowered).max(1e-3);
            for (found, exact) in [(found.curvature.scalar, r), (kretschmann, k)] {
                let error = (found - exact).abs().to_f64();
                let relative = error / if exact == dd(0.0) { unit } else { exact.abs().to_f64() };
                assert!(relative < 1e-26, "{} at {q:?}: {found} for {exact}", space.name);
            }
        }
    }
}

/// `R_abcd = K (g_ac g_bd - g_ad g_bc)`; Weyl's tensor vanishes.
#[test]
fn spaces_of_constant_curvature_are_isotropic() {
    for (space, constant) in SPACES.iter().filter_map(|space| Some((space, space.constant?))) {
        for q in space.points {
            let found = space.at::<Dd>(q);
            let (n, g, k) = (q.len(), &found.metric.components, dd(constant));
            // 1/9 is not a double: one ninth, sixteenth.
            let k = if constant > 0.0 { dd(1.0) / dd((1.0 / constant).round()) } else { k };
            let unit = largest(&found.curvature.lowered).max(1.0) * 1e-26;
            for (place, &value) in found.curvature.lowered.iter().enumerate() {
                let (a, b, c, d) = (place / n.pow(3), place / n.pow(2) % n, place / n % n, place % n);
                let exact = k * (g[a * n + c] * g[b * n + d] - g[a * n + d] * g[b * n + c]);
                assert!((value - exact).abs().to_f64() < unit, "{} at {q:?}: {place}", space.name);
            }
            assert!(largest(&found.curvature.weyl) < unit, "{}", space.name);
            if n > 1 {
                let mut u = vec![dd(0.0); n];
                let mut w = vec![dd(0.25); n];
                (u[n - 1], w[0]) = (dd(1.0), dd(-0.125));
                let sectional = found.curvature.sectional(&found.metric, &u, &w);
                assert!((sectional - k).abs().to_f64() < 1e-26, "{}: {sectional}", space.name);
            }
        }
    }
}

#[test]
fn empty_space_has_no_ricci_tensor_and_all_of_it_is_weyls() {
    for space in SPACES.iter().filter(|space| space.vacuum) {
        for q in space.points {
            let found = space.at::<Dd>(q);
            let unit = 1e-26 * largest(&found.curvature.lowered).max(largest(&found.curvature.riemann)).max(1.0);
            assert!(largest(&found.curvature.ricci) < unit, "{} at {q:?}", space.name);
            assert!(largest(&found.curvature.einstein) < unit, "{}", space.name);
            if q.len() > 3 {
                let weyl = &found.curvature.weyl;
                let rest: Vec<Dd> = weyl.iter().zip(&found.curvature.lowered).map(|(&c, &r)| c - r).collect();
                assert!(largest(&rest) < unit && largest(weyl) > 1e-8, "{}", space.name);
            }
        }
    }
}

/// Tides of a mass: `2 M/r^3` along the radius, `-M/r^3` across, for a body at rest; signs of the connection.
#[test]
fn tides_and_acceleration_outside_a_mass_are_newtons() {
    let space = SPACES.iter().find(|space| space.name == "schwarzschild").unwrap();
    let found = space.at::<f64>(&[0.0, 8.0, 1.0, 0.0]);
    let lapse: f64 = 1.0 - 2.0 / 8.0;
    let u = [lapse.sqrt().recip(), 0.0, 0.0, 0.0];
    let tide = |i: usize| {
        let separation: [f64; 4] = std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 });
        found.curvature.geodesic_deviation(&u, &separation)[i]
    };
    for (i, exact) in [(1, 2.0 / 512.0), (2, -1.0 / 512.0), (3, -1.0 / 512.0)] {
        assert!((tide(i) - exact).abs() < 1e-16, "{i}: {}", tide(i));
    }
    // G^r_tt u^t u^t = M/r^2.
    assert!((found.connection.symbols[16] * u[0] * u[0] - 1.0 / 64.0).abs() < 1e-16);
    assert_eq!((found.metric.signature.negative, found.metric.signature.positive), (1, 3));
    let determinant = -(8f64.powi(4)) * 1f64.sin().powi(2);
    assert!((found.metric.determinant / determinant - 1.0).abs() < 1e-15);
}

/// Electric field of a charge: `G^t_t = G^r_r = -Q^2/r^4`, the others opposite.
#[test]
fn einsteins_tensor_of_a_charge_is_maxwells() {
    let space = SPACES.iter().find(|space| space.name == "reissner-nordstroem").unwrap();
    let found = space.at::<Dd>(&[0.0, 2.5, 1.0, 0.0]);
    let einstein = &found.curvature.einstein;
    for (i, sign) in [-1.0, -1.0, 1.0, 1.0].into_iter().enumerate() {
        let mixed = found.metric.inverse[i * 5] * einstein[i * 5];
        let exact = dd(sign * 0.5) / dd(2.5).powi(4);
        assert!((mixed - exact).abs().to_f64() < 1e-28, "{i}: {mixed} for {exact}");
    }
}

/// The catalogue's Lagrangians carry the factor 1/2; the sphere's carries a mass too, which divides the curvature.
#[test]
fn the_metric_is_the_mass_matrix_as_it_is() {
    for (name, q, exact) in [
        ("ads2-geodesic", vec![0.5, 0.75], -2.0),
        ("ads3-geodesic", vec![0.5, -1.0, 2.0], -6.0),
        ("ads4-geodesic", vec![0.5, -1.0, 3.0, 4.0], -12.0),
        ("sphere-geodesic", vec![1.0, 2.0], 2.0),
    ] {
        let model = configure::<f64>(name, &[]).build().unwrap();
        let found = Geometry::of(&*model, &q, &vec![0.0; q.len()]).unwrap().remove(0).unwrap();
        assert!((found.curvature.scalar / exact - 1.0).abs() < 1e-14, "{name}: {}", found.curvature.scalar);
    }
    let heavy = configure::<f64>("sphere-geodesic", &[("m", "4"), ("R", "0.5")]).build().unwrap();
    let found = Geometry::of(&*heavy, &[1.0, 2.0], &[0.0; 2]).unwrap().remove(0).unwrap();
    assert!((found.curvature.scalar - 2.0).abs() < 1e-14 && found.metric.components[0] == 1.0);
}
