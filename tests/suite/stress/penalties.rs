//! Cases 19 to 21, 23, 24 and 27: penalties at repeated, vanishing and barely negative eigenvalues, out of range, and
//! where they must be exactly zero.

use super::record::{Row, exact};
use crate::common::accuracy::cast;
use crate::common::matrices::{dd, norm, with_spectrum};
use lnn::linalg::{self, Inertia, Workspace};
use lnn::linalg::{SignatureBuffers, Violation, characteristic_scales, eigenvalue_violation, sylvester_violation};
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn eigenvalue<S: Scalar>(n: usize, m: &[S]) -> Violation<S> {
    let mut found = Violation::default();
    eigenvalue_violation(n, m, &mut SignatureBuffers::default(), &mut found).unwrap();
    found
}

/// With the scales of a batch of one.
fn sylvester<S: Scalar>(n: usize, m: &[S], time: Option<usize>) -> Violation<S> {
    let scales = characteristic_scales(n, &m.iter().step_by(n + 1).copied().collect::<Vec<_>>());
    let mut found = Violation::default();
    sylvester_violation(n, m, &scales, time, &mut SignatureBuffers::default(), &mut found).unwrap();
    found
}

/// `G = sum gamma u u^T`.
fn gradient<S: Scalar>(n: usize, found: &Violation<S>) -> Vec<S> {
    let mut g = vec![S::of_f64(0.0); n * n];
    for (&gamma, u) in found.gamma.iter().zip(found.vectors.chunks_exact(n)) {
        (0..n * n).for_each(|k| g[k] += gamma * (u[k / n] * u[k % n]));
    }
    g
}

fn spectrum<S: Scalar>(n: usize, m: &[S]) -> (Vec<Dd>, Vec<Dd>) {
    let (mut w, mut u) = (vec![<Dd as Real>::zero(); n], vec![<Dd as Real>::zero(); n * n]);
    linalg::eigh(n, &cast::<S, Dd>(m), &mut w, &mut u, &mut Workspace::new()).unwrap();
    (w, u)
}

/// The gradient of the eigenvalue penalty is minus the projector on the negative space, whatever clusters in it.
fn repeated<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut rng = ChaCha8Rng::seed_from_u64(19);
    let mut row = Row::new::<S>(19, "gradient at repeated eigenvalues, unit n eps |M| / gap");
    for n in 1..=8 {
        let mut list: Vec<(String, Vec<S>)> = vec![("-I".into(), with_spectrum(&vec![-1.0; n], &mut rng))];
        for k in (0..=60).step_by(2) {
            let d = 2f64.powi(-k);
            let ones = (0..n * n).map(|e| S::of_f64(if e / n == e % n { -2.0 + d } else { d })).collect();
            list.push((format!("-2 I + 2^-{k} E"), ones));
            let clusters: Vec<f64> =
                (0..n).map(|i| if i < n.div_ceil(2) { -1.0 - d * i as f64 } else { 1.0 }).collect();
            list.push((format!("clusters 2^-{k}"), with_spectrum(&clusters, &mut rng)));
        }
        for (name, m) in list {
            let (w, u) = spectrum(n, &m);
            let negative = w.iter().filter(|w| w.to_f64() < 0.0).count();
            let closest = w.iter().fold(f64::INFINITY, |m, w| m.min(w.to_f64().abs()));
            if closest < 1e-3 {
                continue;
            }
            let size = w[0].to_f64().abs().max(w[n - 1].to_f64().abs());
            let gap = if negative == 0 || negative == n { size } else { (w[negative] - w[negative - 1]).to_f64() };
            let found = eigenvalue(n, &m);
            assert_eq!(found.gamma.len(), negative, "{name}");
            let g = gradient(n, &found);
            for k in 0..n * n {
                let projector =
                    (0..negative).fold(<Dd as Real>::zero(), |s, l| s + u[l * n + k / n] * u[l * n + k % n]);
                let error = (dd(g[k]) + projector).to_f64().abs();
                row.see(error * gap / (n as f64 * eps * size), || format!("n = {n}, {name}"));
            }
            let value = w[..negative].iter().fold(<Dd as Real>::zero(), |s, &w| s - w);
            let error = (dd(found.value) - value).to_f64().abs() / (n as f64 * eps * size);
            row.see(error, || format!("n = {n}, {name}, value"));
        }
    }
    row.end();
}

#[test]
fn case_19_repeated_eigenvalues() {
    repeated::<f32>();
    repeated::<f64>();
}

/// Determinant in integers, by expansion along the first row.
fn determinant(n: usize, m: &[i64]) -> i64 {
    let minor = |j: usize| (n..n * n).filter(|k| k % n != j).map(|k| m[k]).collect::<Vec<i64>>();
    match n {
        0 => 1,
        _ => (0..n).map(|j| [1, -1][j % 2] * m[j] * determinant(n - 1, &minor(j))).sum(),
    }
}

/// The gradient of the determinant where the matrix has lost one rank, or two (it vanishes).
fn adjugates<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut rng = ChaCha8Rng::seed_from_u64(20);
    let mut row = Row::new::<S>(20, "gradient of det at singular M, unit n eps |M|^(n-1)");
    let mut list: Vec<(usize, Vec<i64>)> = vec![(2, vec![1; 4]), (3, vec![1; 9]), (1, vec![0])];
    for n in 2..=6 {
        for lost in [1, 2].into_iter().filter(|&lost| lost < n) {
            let b: Vec<i64> = (0..n * n).map(|k| if k % n + lost < n { rng.random_range(-2..=2) } else { 0 }).collect();
            let product = |k: usize| (0..n).map(|l| [1, -1][l % 2] * b[k / n * n + l] * b[k % n * n + l]).sum();
            list.push((n, (0..n * n).map(product).collect()));
        }
    }
    for (n, m) in list {
        assert_eq!(determinant(n, &m), 0);
        let numbers: Vec<S> = m.iter().map(|&m| S::of_f64(m as f64)).collect();
        let mut found = vec![S::nan(); n * n];
        let exponent = linalg::adjugate(n, &numbers, &mut found, &mut Workspace::new()).unwrap();
        let (w, _) = spectrum(n, &numbers);
        let size = w[0].to_f64().abs().max(w[n - 1].to_f64().abs());
        for k in 0..n * n {
            let (i, j) = (k / n, k % n);
            let minor: Vec<i64> = (0..n * n).filter(|e| e / n != i && e % n != j).map(|e| m[e]).collect();
            let exact = [1, -1][(i + j) % 2] * determinant(n - 1, &minor);
            let error = (dd(found[k].ldexp(exponent as i32)) - Dd::of_f64(exact as f64)).to_f64().abs();
            row.see(error / (n as f64 * eps * size.powi(n as i32 - 1)), || format!("{m:?}"));
        }
    }
    row.end_below(8.0);
}

#[test]
fn case_20_adjugates_of_singular_matrices() {
    adjugates::<f32>();
    adjugates::<f64>();
}

/// `B B^T + d I` with `d = 30 n eps |B|^2`, in double-double and rounded.
fn positive_definite<S: Scalar>(n: usize, rng: &mut ChaCha8Rng) -> Vec<S> {
    let b: Vec<Dd> = (0..n * n).map(|_| Dd::of_f64(rng.random_range(-1.0..1.0))).collect();
    let shift = Dd::of_f64(30.0 * n as f64 * S::epsilon().to_f64() * norm(b.iter().copied()).powi(2));
    let product = |k: usize| {
        let diagonal = if k / n == k % n { shift } else { <Dd as Real>::zero() };
        (0..n).fold(diagonal, |s, l| s + b[k / n * n + l] * b[k % n * n + l])
    };
    (0..n * n).map(|k| product(k).cast()).collect()
}

/// Determinants and scales far out of range: mantissas are those of the unscaled matrix, penalties stay finite.
fn out_of_range<S: Scalar>(cases: &[(usize, i32)]) {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let mut checks = 0;
    for &(n, exponent) in cases {
        for _ in 0..20 {
            let unit = positive_definite::<S>(n, &mut rng);
            let mut m: Vec<S> = unit.iter().map(|x| x.ldexp(exponent)).collect();
            let (mut plain, mut scaled) = (Vec::new(), Vec::new());
            let mut workspace = Workspace::new();
            linalg::leading_minors(n, &unit, &mut plain, &mut workspace).unwrap();
            linalg::leading_minors(n, &m, &mut scaled, &mut workspace).unwrap();
            for (k, (a, b)) in plain.iter().zip(&scaled).enumerate() {
                assert!(b.mantissa > S::of_f64(0.0) && a.mantissa == b.mantissa, "n = {n}, 2^{exponent}, minor {k}");
                assert_eq!(b.exponent - a.exponent, i64::from(exponent) * (k as i64 + 1));
            }
            for found in [eigenvalue(n, &m), sylvester(n, &m, None)] {
                assert!(found.value == S::of_f64(0.0) && found.gamma.is_empty());
            }
            let flipped = rng.random_range(0..n);
            m[flipped * n + flipped] = -m[flipped * n + flipped];
            linalg::leading_minors(n, &m, &mut scaled, &mut workspace).unwrap();
            assert!(scaled[flipped].mantissa < S::of_f64(0.0), "n = {n}, 2^{exponent}: {flipped}");
            for (name, found) in [("eigenvalue", eigenvalue(n, &m)), ("Sylvester", sylvester(n, &m, None))] {
                assert!(found.value.is_finite(), "{name}, n = {n}, 2^{exponent}: {}", found.value);
                assert!(gradient(n, &found).iter().all(|g| g.is_finite()), "{name}, n = {n}, 2^{exponent}");
                // Sylvester's penalty fades where the product of the scales falls below its eps of 1e-8, and at last is
                // gone, value and gradient alike; the eigenvalue penalty never is.
                if exponent > 0 || name == "eigenvalue" {
                    assert!(found.value > S::of_f64(0.0) && !found.gamma.is_empty(), "{name}, n = {n}, 2^{exponent}");
                } else {
                    assert!(!found.gamma.is_empty() || found.value == S::of_f64(0.0), "{name}, n = {n}, 2^{exponent}");
                }
            }
            checks += 1;
        }
    }
    exact::<S>(21, "minors and penalties out of range", checks);
}

#[test]
fn case_21_minors_out_of_range() {
    out_of_range::<f32>(&[(4, 60), (4, -60), (20, 60), (20, -60), (2, 120), (2, -90)]);
    out_of_range::<f64>(&[(4, 500), (4, -500), (20, 60), (20, -60), (2, 1000), (2, -900)]);
}

/// Penalties that must vanish, to the last bit; and one sign flipped.
fn right_signatures<S: Scalar>() {
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let zero = S::of_f64(0.0);
    let (mut classical, mut lorentzian) = (0, 0);
    for n in 1..=20 {
        for _ in 0..30 {
            let mut m = positive_definite::<S>(n, &mut rng);
            for found in [eigenvalue(n, &m), sylvester(n, &m, None)] {
                assert!(found.value == zero && found.gamma.is_empty() && found.vectors.is_empty(), "n = {n}");
            }
            classical += 1;
            if n == 1 {
                continue;
            }
            let t = rng.random_range(0..n);
            for i in (0..n).filter(|&i| i != t) {
                let mixed = S::of_f64(rng.random_range(-1.0..1.0));
                (m[t * n + i], m[i * n + t]) = (mixed, mixed);
            }
            m[t * n + t] = S::of_f64(-rng.random_range(0.01..2.0));
            let found = sylvester(n, &m, Some(t));
            assert!(found.value == zero && found.gamma.is_empty(), "n = {n}, time {t}");
            let signs = Inertia { positive: n - 1, zero: 0, negative: 1 };
            assert_eq!(linalg::inertia(n, &m, &mut vec![zero; n * n]).unwrap(), signs, "n = {n}");
            let (w, _) = spectrum(n, &m);
            assert!(w[0].to_f64() < 0.0 && w[1].to_f64() > 0.0);
            let flipped = rng.random_range(0..n);
            m[flipped * n + flipped] = -m[flipped * n + flipped];
            assert!(sylvester(n, &m, Some(t)).value > zero, "n = {n}, time {t}, flipped {flipped}");
            lorentzian += 1;
        }
    }
    exact::<S>(23, "B B^T + d I costs nothing", classical);
    exact::<S>(24, "Lorentzian signature costs nothing, a flipped sign does", lorentzian);
}

#[test]
fn case_23_24_right_signatures_cost_nothing() {
    right_signatures::<f32>();
    right_signatures::<f64>();
}

/// One eigenvalue `+-2^-k` among others of order 1: active exactly where the exact one is negative, but for rounding;
/// a penalty without a gradient, or a gradient without a penalty, never.
fn barely_negative<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut rng = ChaCha8Rng::seed_from_u64(27);
    let mut row = Row::new::<S>(27, "largest wrongly judged eigenvalue, unit n eps |M|");
    let mut value = Row::new::<S>(27, "value of a barely active penalty, unit n eps |M|");
    for n in 1..=8 {
        for (k, sign) in (1..=60).flat_map(|k| [(k, 1.0), (k, -1.0)]) {
            let w: Vec<f64> =
                (0..n).map(|i| if i == 0 { sign * 2f64.powi(-k) } else { 0.5 + 0.25 * i as f64 }).collect();
            let m: Vec<S> = with_spectrum(&w, &mut rng);
            let (w, _) = spectrum(n, &m);
            let size = w[n - 1].to_f64().abs();
            let (by_eigenvalue, by_minors) = (eigenvalue(n, &m), sylvester(n, &m, None));
            for (name, found) in [("eigenvalue", &by_eigenvalue), ("Sylvester", &by_minors)] {
                let active = found.value > S::of_f64(0.0);
                assert_eq!(active, !found.gamma.is_empty(), "{name}, n = {n}, {sign} 2^-{k}");
                // A positive definite matrix has only positive minors, one with a negative eigenvalue a negative last.
                if active != (w[0].to_f64() < 0.0) {
                    row.see(w[0].to_f64().abs() / (n as f64 * eps * size), || {
                        format!("{name}, n = {n}, {sign} 2^-{k}")
                    });
                }
            }
            let expected = (-w[0]).relu();
            let error = (dd(by_eigenvalue.value) - expected).to_f64().abs();
            value.see(error / (n as f64 * eps * size), || format!("n = {n}, {sign} 2^-{k}"));
        }
    }
    row.end();
    value.end();
}

#[test]
fn case_27_barely_negative_eigenvalues() {
    barely_negative::<f32>();
    barely_negative::<f64>();
}
