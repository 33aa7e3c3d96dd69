//! Regularizers of single mass matrices: zeros, signs, scales, gradients.

use crate::common::properties;
use lnn::linalg::{
    SignatureBuffers, Violation, characteristic_scales, eigenvalue_violation, has_one_negative, has_signature,
    one_negative_violation, sylvester_violation,
};
use lnn::scalar::{Dd, Scalar};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

type Matrix = Vec<f64>;

/// `B B^T + d I`, `d` beyond rounding.
fn positive_definite(n: usize, rng: &mut ChaCha8Rng) -> Matrix {
    let b: Vec<f64> = (0..n * n).map(|_| rng.random_range(-1.0..1.0)).collect();
    let size: f64 = b.iter().map(|b| b * b).sum();
    let shift = 30.0 * n as f64 * f64::EPSILON * size + 1e-9;
    (0..n * n)
        .map(|k| {
            let product: f64 = (0..n).map(|l| b[k / n * n + l] * b[k % n * n + l]).sum();
            product + if k / n == k % n { shift } else { 0.0 }
        })
        .collect()
}

/// A matrix with `M_tt < 0` and a positive definite spatial block.
fn lorentzian(n: usize, t: usize, rng: &mut ChaCha8Rng) -> Matrix {
    let mut m = positive_definite(n, rng);
    for i in 0..n {
        let mixed = rng.random_range(-1.0..1.0);
        (m[t * n + i], m[i * n + t]) = (mixed, mixed);
    }
    m[t * n + t] = -rng.random_range(0.01..2.0);
    m
}

fn cast<S: Scalar>(m: &[f64]) -> Vec<S> {
    m.iter().map(|&x| S::of_f64(x)).collect()
}

fn eigenvalue<S: Scalar>(n: usize, m: &[S]) -> Violation<S> {
    let mut found = Violation::default();
    eigenvalue_violation(n, m, &mut SignatureBuffers::default(), &mut found).unwrap();
    found
}

fn sylvester<S: Scalar>(n: usize, m: &[S], scales: &[S], time: Option<usize>) -> Violation<S> {
    let mut found = Violation::default();
    sylvester_violation(n, m, scales, time, &mut SignatureBuffers::default(), &mut found).unwrap();
    found
}

fn one_negative<S: Scalar>(n: usize, m: &[S], scales: &[S]) -> Violation<S> {
    let mut found = Violation::default();
    one_negative_violation(n, m, scales, &mut SignatureBuffers::default(), &mut found).unwrap();
    found
}

/// `B diag(signs) B^T` with `B` far from singular.
fn of_signs(signs: &[f64], rng: &mut ChaCha8Rng) -> Matrix {
    let n = signs.len();
    let b: Vec<f64> =
        (0..n * n).map(|k| rng.random_range(-0.3..0.3) / n as f64 + if k / n == k % n { 1.0 } else { 0.0 }).collect();
    let element = |k: usize| (0..n).map(|l| b[k / n * n + l] * signs[l] * b[k % n * n + l]).sum();
    (0..n * n).map(element).collect()
}

/// `|M_ii|`: the scales of a batch of one.
fn own_scales<S: Scalar>(n: usize, m: &[S]) -> Vec<S> {
    characteristic_scales(n, &m.iter().step_by(n + 1).copied().collect::<Vec<_>>())
}

/// `G = sum gamma u u^T`, `(n, n)`.
fn gradient<S: Scalar>(n: usize, found: &Violation<S>) -> Vec<S> {
    let mut g = vec![S::of_f64(0.0); n * n];
    for (&gamma, u) in found.gamma.iter().zip(found.vectors.chunks_exact(n)) {
        for k in 0..n * n {
            g[k] += gamma * (u[k / n] * u[k % n]);
        }
    }
    g
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// `P M P^T` of a permutation of the coordinates.
fn relabelled(n: usize, m: &[f64], order: &[usize]) -> Matrix {
    (0..n * n).map(|k| m[order[k / n] * n + order[k % n]]).collect()
}

proptest! {
    #![proptest_config(properties(128))]

    #[test]
    fn positive_definite_matrices_cost_nothing(n in 1_usize..=8, seed in any::<u64>()) {
        let m = positive_definite(n, &mut ChaCha8Rng::seed_from_u64(seed));
        for found in [eigenvalue(n, &m), sylvester(n, &m, &own_scales(n, &m), None)] {
            prop_assert_eq!(found.value, 0.0);
            prop_assert!(found.gamma.is_empty() && found.vectors.is_empty());
        }
    }

    #[test]
    fn lorentzian_matrices_cost_nothing_and_one_flipped_sign_does(
        n in 2_usize..=6,
        t in 0_usize..6,
        seed in any::<u64>(),
    ) {
        let t = t % n;
        let m = lorentzian(n, t, &mut ChaCha8Rng::seed_from_u64(seed));
        let scales = own_scales(n, &m);
        let found = sylvester(n, &m, &scales, Some(t));
        prop_assert_eq!(found.value, 0.0);
        prop_assert!(found.gamma.is_empty());
        // The eigenvalue penalty and the classical criterion see the one negative direction.
        prop_assert!(eigenvalue(n, &m).value > 0.0);
        prop_assert_eq!(eigenvalue(n, &m).gamma.len(), 1);
        prop_assert!(sylvester(n, &m, &scales, None).value > 0.0);
        for flipped in 0..n {
            let mut wrong = m.clone();
            wrong[flipped * n + flipped] = -wrong[flipped * n + flipped];
            prop_assert!(sylvester(n, &wrong, &scales, Some(t)).value > 0.0, "flipped {}", flipped);
        }
    }

    /// The eigenvalue penalty scales with `M`; Sylvester's does not, up to `eps` beside the scales.
    #[test]
    fn penalties_scale_as_they_should(n in 1_usize..=6, seed in any::<u64>(), factor in 0.01_f64..100.0) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut m = positive_definite(n, &mut rng);
        let flipped = rng.random_range(0..n);
        m[flipped * n + flipped] *= -1.0;
        let scaled: Matrix = m.iter().map(|m| factor * m).collect();
        let (one, other) = (eigenvalue(n, &m).value, eigenvalue(n, &scaled).value);
        prop_assert!(one > 0.0);
        prop_assert!((other - factor * one).abs() <= 30.0 * n as f64 * f64::EPSILON * factor * largest(&m));
        let (c, d) = (own_scales(n, &m), own_scales(n, &scaled));
        let (one, other) = (sylvester(n, &m, &c, None).value, sylvester(n, &scaled, &d, None).value);
        let product = |c: &[f64]| c.iter().scan(1.0, |s, c| { *s *= c; Some(*s) }).fold(f64::INFINITY, f64::min);
        let slack = 2e-8 / product(&c).min(product(&d)) + 1000.0 * n as f64 * f64::EPSILON;
        prop_assert!((other - one).abs() <= slack * one + 1e-14, "{} {} {}", one, other, slack);
    }

    /// Zero for one negative eigenvalue in any direction, whatever the sign of any diagonal element; above zero for every other
    /// number of them, the reversed signature of a spacetime among them.
    #[test]
    fn one_negative_eigenvalue_costs_nothing_and_any_other_number_does(
        n in 1_usize..=6,
        negative in 0_usize..=6,
        seed in any::<u64>(),
        factor in 1e-3_f64..1e3,
    ) {
        let negative = negative.min(n);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let signs: Vec<f64> = (0..n).map(|k| if k < negative { -1.0 } else { 1.0 }).collect();
        let m = of_signs(&signs, &mut rng);
        let scales = own_scales(n, &m);
        let found = one_negative(n, &m, &scales);
        prop_assert_eq!(found.value == 0.0, negative == 1, "{}", found.value);
        prop_assert_eq!(found.gamma.is_empty(), negative == 1);
        prop_assert_eq!(has_one_negative(n, &m, &mut SignatureBuffers::default()), negative == 1);
        prop_assert_eq!(found.gamma.len(), if negative == 0 { 1 } else { negative - 1 });
        // A new unit of every coordinate, and of the Lagrangian, changes nothing.
        let units: Vec<f64> = (0..n).map(|_| 10_f64.powf(rng.random_range(-1.0..1.0))).collect();
        let other: Matrix = m.iter().enumerate().map(|(k, m)| m * units[k / n] * units[k % n] * factor).collect();
        let moved = one_negative(n, &other, &own_scales(n, &other)).value;
        let least = scales.iter().chain(&own_scales(n, &other)).copied().fold(f64::INFINITY, f64::min);
        prop_assert!((moved - found.value).abs() <= (3e-8 / least + 1e-12) * found.value.max(1.0), "{} {}", moved, found.value);
    }

    /// Inside of a horizon the element of the time is positive, and a space-like coordinate's is negative.
    #[test]
    fn the_inside_of_a_horizon_is_right(r in 0.1_f64..8.0, theta in 0.3_f64..2.8) {
        let (f, sine) = (1.0 - 2.0 / r, theta.sin());
        let mut m = vec![0.0; 16];
        (m[0], m[5], m[10], m[15]) = (-f, 1.0 / f, r * r, (r * sine).powi(2));
        let scales = own_scales(4, &m);
        prop_assert_eq!(one_negative(4, &m, &scales).value, 0.0);
        prop_assert_eq!(sylvester(4, &m, &scales, Some(0)).value > 0.0, r < 2.0);
        let minus: Matrix = m.iter().map(|m| -m).collect();
        prop_assert!(one_negative(4, &minus, &scales).value > 0.0);
    }

    /// Eigenvalues know no order; the minors of a definite violation do, yet being zero or not does not depend on it.
    #[test]
    fn relabelling_spatial_coordinates(n in 2_usize..=5, seed in any::<u64>()) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut m = lorentzian(n, 0, &mut rng);
        if rng.random_bool(0.5) {
            let k = rng.random_range(0..n);
            m[k * n + k] *= -1.0;
        }
        let order: Vec<usize> = std::iter::once(0).chain((1..n).rev()).collect();
        let other = relabelled(n, &m, &order);
        let (a, b) = (eigenvalue(n, &m).value, eigenvalue(n, &other).value);
        prop_assert!((a - b).abs() <= 30.0 * n as f64 * f64::EPSILON * largest(&m));
        let (a, b) = (
            sylvester(n, &m, &own_scales(n, &m), Some(0)).value,
            sylvester(n, &other, &own_scales(n, &other), Some(0)).value,
        );
        prop_assert_eq!(a > 0.0, b > 0.0);
        let mut buffers = SignatureBuffers::default();
        prop_assert_eq!(has_signature(n, &m, Some(0), &mut buffers), a == 0.0);
    }

    /// `value(M + h E) - value(M)` against `G . E` for a symmetric direction `E`, in double-double.
    #[test]
    fn gradients_are_slopes(n in 1_usize..=5, seed in any::<u64>(), time in any::<bool>()) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || -> Vec<f64> {
            let x: Vec<f64> = (0..n * n).map(|_| rng.random_range(-1.0..1.0)).collect();
            (0..n * n).map(|k| x[k] + x[k % n * n + k / n]).collect()
        };
        let (m, e) = (draw(), draw());
        let time = time.then_some(n - 1);
        let wide: Vec<Dd> = cast(&m);
        let scales = own_scales(n, &wide);
        let h = Dd::of_f64(2f64.powi(-50));
        let moved: Vec<Dd> = wide.iter().zip(&e).map(|(&m, &e)| m + h * Dd::of_f64(e)).collect();
        for (at, slope) in [
            (eigenvalue(n, &wide), eigenvalue(n, &moved)),
            (sylvester(n, &wide, &scales, time), sylvester(n, &moved, &scales, time)),
            (one_negative(n, &wide, &scales), one_negative(n, &moved, &scales)),
        ] {
            let found: f64 = gradient(n, &at).iter().zip(&e).map(|(g, e)| g.to_f64() * e).sum();
            let expected = ((slope.value - at.value) / h).to_f64();
            // First order in h times the curvature, which an eigenvalue gap or a small scale makes large.
            prop_assert!((found - expected).abs() <= 1e-6 * (1.0 + found.abs()), "{} {}", found, expected);
        }
    }
}

#[test]
fn repeated_negative_eigenvalues_have_a_basis_free_gradient() {
    // From 1 to beyond the size at which faer takes over.
    for n in [1, 2, 3, 4, 5, 6, 24, 40] {
        let minus: Matrix = (0..n * n).map(|k| if k / n == k % n { -2.0 } else { 0.0 }).collect();
        let found = eigenvalue(n, &minus);
        assert!((found.value - 2.0 * n as f64).abs() <= 4.0 * f64::EPSILON * 2.0 * n as f64);
        for (k, g) in gradient(n, &found).iter().enumerate() {
            let expected = if k / n == k % n { -1.0 } else { 0.0 };
            assert!((g - expected).abs() <= 30.0 * f64::EPSILON, "element {k}: {g}");
        }
        // A perturbation that splits the cluster must not turn the gradient: -P of the negative space is still -I.
        let split: Matrix =
            minus.iter().enumerate().map(|(k, m)| m + 2f64.powi(-45) * ((k / n * (k % n)) as f64).cos()).collect();
        for (k, g) in gradient(n, &eigenvalue(n, &split)).iter().enumerate() {
            let expected = if k / n == k % n { -1.0 } else { 0.0 };
            assert!((g - expected).abs() <= 30.0 * f64::EPSILON, "split, element {k}: {g}");
        }
    }
}

#[test]
fn the_gradient_at_a_singular_minor_is_the_adjugate() {
    // det of the 2 by 2 block is -2^-40: singular but for the last bits, active, gradient -adj.
    let d = 2f64.powi(-40);
    let m = [1.0, 1.0, 1.0, 1.0 - d];
    let found = sylvester(2, &m, &[1.0, 1.0], None);
    let scale = 1.0 + 1e-8;
    assert!((found.value * scale - d).abs() <= 8.0 * f64::EPSILON);
    for (g, expected) in gradient(2, &found).iter().zip([-(1.0 - d), 1.0, 1.0, -1.0]) {
        assert!((g * scale - expected).abs() <= 8.0 * f64::EPSILON, "{g}");
    }
    // On the other side of zero nothing.
    assert!(sylvester(2, &[1.0, 1.0, 1.0, 1.0 + d], &[1.0, 1.0], None).gamma.is_empty());
}

#[test]
fn scales_are_lower_medians() {
    assert_eq!(characteristic_scales(1, &[-3.0]), [3.0]);
    assert_eq!(characteristic_scales(1, &[4.0, -1.0, 3.0, 2.0]), [2.0]);
    assert_eq!(characteristic_scales(1, &[5.0, 5.0, 1.0, 5.0]), [5.0]);
    assert_eq!(characteristic_scales(2, &[1.0, -9.0, 2.0, 7.0, 3.0, 8.0]), [2.0, 8.0]);
    // NaN counts as the largest and never breaks the order.
    assert_eq!(characteristic_scales(1, &[f64::NAN, 2.0, 1.0]), [2.0]);
    assert!(characteristic_scales(1, &[f64::NAN, f64::NAN, 1.0])[0].is_nan());
    assert!(characteristic_scales::<f64>(2, &[]).iter().all(|c| *c == 0.0));
}

/// `n = 20`, scales of 100 or 2^+-60 in single precision, 2^+-500 in double: products of scales leave the range.
#[test]
fn products_of_scales_beyond_the_range_keep_sign_and_size() {
    fn check<S: Scalar>(n: usize, size: f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let unit = positive_definite(n, &mut rng);
        let mut m: Vec<S> = unit.iter().map(|&x| S::of_f64(x) * S::of_f64(size)).collect();
        let scales = own_scales(n, &m);
        assert_eq!(sylvester(n, &m, &scales, None).value.to_f64(), 0.0);
        m[0] = -m[0];
        let found = sylvester(n, &m, &scales, None);
        assert!(found.value.is_finite() && found.value.to_f64() >= 1.0, "{}: {}", S::NAME, found.value);
        assert!(found.gamma.iter().chain(&found.vectors).all(|x| x.is_finite()));
        let g = gradient(n, &found);
        assert!(g.iter().all(|g| g.is_finite()) && g[0].to_f64() < 0.0);
    }
    check::<f32>(20, 100.0);
    check::<f32>(20, 2f64.powi(60));
    check::<f64>(20, 2f64.powi(60));
    check::<f64>(4, 2f64.powi(500));
}

/// Where `eps` outweighs the product of the scales the penalty fades, in proportion, and stays finite.
#[test]
fn the_penalty_fades_where_eps_dominates() {
    let at = |size: f64| {
        let m = [-size, 0.0, 0.0, size];
        sylvester(2, &m, &own_scales(2, &m), None).value
    };
    // Both minors are violated: 1 / (1 + eps/c) + 1 / (1 + eps/c^2).
    for size in [1.0, 1e-3, 1e-6, 1e-12] {
        let expected = 1.0 / (1.0 + 1e-8 / size) + 1.0 / (1.0 + 1e-8 / (size * size));
        assert!((at(size) - expected).abs() <= 30.0 * f64::EPSILON * expected, "{size}: {}", at(size));
    }
    assert!(at(1e-12) < 1.1e-4);
    assert!(at(2f64.powi(-500)).is_finite());
    // A scale of exactly zero leaves eps alone.
    let found: Violation<f64> = sylvester(2, &[0.0, 1e-5, 1e-5, 0.0], &[0.0, 0.0], None);
    assert!((found.value - 1e-2).abs() <= 30.0 * f64::EPSILON);
}

#[test]
fn matrices_that_are_not_finite_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let m = [1.0, bad, bad, 1.0];
        let (mut buffers, mut found) = (SignatureBuffers::default(), Violation::default());
        assert!(eigenvalue_violation(2, &m, &mut buffers, &mut found).is_err());
        assert!(sylvester_violation(2, &m, &[1.0, 1.0], None, &mut buffers, &mut found).is_err());
        assert!(one_negative_violation(2, &m, &[1.0, 1.0], &mut buffers, &mut found).is_err());
        assert!(found.gamma.is_empty() && found.value == 0.0);
    }
}
