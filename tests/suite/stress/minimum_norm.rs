//! Case 22: singular systems that have solutions, by the solution of least norm.

use super::record::{Row, exact};
use crate::common::accuracy::cast;
use crate::common::matrices::{dd, norm, times, with_spectrum};
use crate::common::solve;
use lnn::linalg::{self, LinalgError, MinimumNorm, Workspace, minimum_norm};
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn found<S: Scalar>(n: usize, m: &[S], b: &[S]) -> MinimumNorm<S> {
    minimum_norm(n, m, b, &mut Workspace::new()).unwrap()
}

fn length<S: Scalar>(x: &[S]) -> f64 {
    norm(x.iter().map(|&x| dd(x)))
}

fn distance<S: Scalar>(x: &[S], y: &[Dd]) -> f64 {
    norm(x.iter().zip(y).map(|(&x, &y)| dd(x) - y))
}

/// A chain of bodies joined by springs of integer strength, free to move as a whole: the energy does not change along
/// `(1, .., 1)`, the gauge direction. Forces that add up to zero have a solution, a common force has none.
fn gauge_directions<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut rng = ChaCha8Rng::seed_from_u64(221);
    let mut row = Row::new::<S>(22, "minimum norm: gauge directions, unit n eps kappa |x|");
    for n in 1..=20 {
        let strength: Vec<f64> = (1..n).map(|_| f64::from(rng.random_range(1..5))).collect();
        let mut m = vec![S::of_f64(0.0); n * n];
        for (i, &k) in strength.iter().enumerate() {
            for (a, b, sign) in [(i, i, 1.0), (i + 1, i + 1, 1.0), (i, i + 1, -1.0), (i + 1, i, -1.0)] {
                m[a * n + b] += S::of_f64(sign * k);
            }
        }
        // A displacement in integers, and the forces it takes.
        let y: Vec<S> = (0..n).map(|_| S::of_f64(f64::from(rng.random_range(-9..=9)))).collect();
        let mut b: Vec<S> = (0..n).map(|i| (0..n).fold(S::of_f64(0.0), |s, j| s + m[i * n + j] * y[j])).collect();
        // The shortest displacement is the one with its mean taken away.
        let mean = y.iter().fold(<Dd as Real>::zero(), |s, &y| s + dd(y)) / Dd::of_f64(n as f64);
        let shortest: Vec<Dd> = y.iter().map(|&y| dd(y) - mean).collect();
        let mut spectrum = vec![<Dd as Real>::zero(); n];
        linalg::eigenvalues(n, &cast::<S, Dd>(&m), &mut spectrum, &mut Workspace::new()).unwrap();
        let kappa = if n > 1 { (spectrum[n - 1] / spectrum[1]).to_f64() } else { 1.0 };
        let unit = n as f64 * eps;
        let plain = found(n, &m, &b);
        assert_eq!(plain.rank, n - 1);
        let size = length(&shortest).max(f64::MIN_POSITIVE);
        row.see(distance(&plain.solution, &shortest) / (unit * kappa * size), || format!("n = {n}"));
        // What stands for zero: rounding of the gauge direction.
        let floor = unit * kappa * length(&b).max(f64::MIN_POSITIVE);
        row.see(plain.outside.to_f64() / floor, || format!("n = {n}, outside"));
        // A common force of 3 on each: the same displacement, and 3 sqrt n that nothing answers.
        b.iter_mut().for_each(|b| *b += S::of_f64(3.0));
        let pulled = found(n, &m, &b);
        let push = 3.0 * (n as f64).sqrt();
        row.see((pulled.outside.to_f64() - push).abs() / (unit * length(&b)), || format!("n = {n}, common force"));
        // With a part outside the range the sensitivity is that of least squares: the square of the condition.
        let size = kappa * size + kappa * kappa * push / spectrum[n - 1].to_f64().max(1.0);
        row.see(distance(&pulled.solution, &shortest) / (unit * size), || format!("n = {n}, common force"));
    }
    row.end();
}

/// `r` coordinates written as combinations `z = J q` of `n > r` redundant ones: `M = J^T K J`. The shortest solution
/// of `M x = J^T f` is `J^T (J J^T)^-1 K^-1 f`, here in double-double.
fn redundant_coordinates<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut rng = ChaCha8Rng::seed_from_u64(222);
    let mut row = Row::new::<S>(22, "minimum norm: redundant coordinates, unit n eps kappa |x|");
    for n in 1..=20 {
        for r in 1..=n {
            let integer = |rng: &mut ChaCha8Rng| f64::from(rng.random_range(-2..=2));
            let j: Vec<f64> = (0..r * n).map(|k| if k / n == k % n { 15.0 } else { integer(&mut rng) }).collect();
            // Both signs, as of a metric.
            let k: Vec<f64> = (0..r).map(|i| if i % 2 == 0 { 1.0 } else { -2.0 }).collect();
            let product = |a: usize, b: usize| (0..r).map(|i| j[i * n + a] * k[i] * j[i * n + b]).sum::<f64>();
            let m: Vec<S> = (0..n * n).map(|e| S::of_f64(product(e / n, e % n))).collect();
            let f: Vec<f64> = (0..r).map(|_| integer(&mut rng)).collect();
            let b: Vec<S> = (0..n).map(|a| S::of_f64((0..r).map(|i| j[i * n + a] * f[i]).sum())).collect();
            let gram: Vec<Dd> =
                (0..r * r).map(|e| Dd::of_f64((0..n).map(|a| j[e / r * n + a] * j[e % r * n + a]).sum())).collect();
            let z: Vec<Dd> = f.iter().zip(&k).map(|(&f, &k)| Dd::of_f64(f) / Dd::of_f64(k)).collect();
            let z = solve(r, &gram, &z);
            let shortest: Vec<Dd> =
                (0..n).map(|a| (0..r).fold(<Dd as Real>::zero(), |s, i| s + Dd::of_f64(j[i * n + a]) * z[i])).collect();
            let mut spectrum = vec![<Dd as Real>::zero(); n];
            linalg::eigenvalues(n, &cast::<S, Dd>(&m), &mut spectrum, &mut Workspace::new()).unwrap();
            let mut sizes: Vec<f64> = spectrum.iter().map(|w| w.to_f64().abs()).collect();
            sizes.sort_by(f64::total_cmp);
            let kappa = sizes[n - 1] / sizes[n - r];
            let x = found(n, &m, &b);
            assert_eq!(x.rank, r, "n = {n}, condition {kappa:e}");
            let unit = n as f64 * eps * kappa * length(&shortest).max(f64::MIN_POSITIVE);
            let place = || format!("n = {n}, rank {r}, condition {kappa:.1e}");
            row.see(distance(&x.solution, &shortest) / unit, place);
            let outside = x.outside.to_f64() / (n as f64 * eps * kappa * length(&b).max(f64::MIN_POSITIVE));
            row.see(outside, || format!("{}, outside", place()));
        }
    }
    row.end();
}

/// Any symmetric matrix of rank `r` with its range and null space known, right-hand sides with parts in both.
fn inconsistent<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut rng = ChaCha8Rng::seed_from_u64(223);
    let mut stationary = Row::new::<S>(22, "minimum norm: M (b - M x) = 0, unit n eps |M| |b|");
    let mut split = Row::new::<S>(22, "minimum norm: |b|^2 = |M x|^2 + outside^2");
    for n in 1..=20 {
        for rank in 0..=n {
            let w: Vec<f64> = (0..n).map(|k| if k < rank { [1.0, -0.5, 0.25][k % 3] } else { 0.0 }).collect();
            let m: Vec<S> = with_spectrum(&w, &mut rng);
            let b: Vec<S> = (0..n).map(|_| S::of_f64(rng.random_range(-1.0..1.0))).collect();
            let x = found(n, &m, &b);
            assert_eq!(x.rank, rank, "n = {n}");
            let product = times(n, &m, &cast::<S, Dd>(&x.solution));
            let rest: Vec<Dd> = b.iter().zip(&product).map(|(&b, &p)| dd(b) - p).collect();
            let unit = n as f64 * eps * length(&b);
            let place = || format!("n = {n}, rank {rank}");
            stationary.see(norm(times(n, &m, &rest).into_iter()) / unit, place);
            split.see((length(&rest) - x.outside.to_f64()).abs() / unit, place);
            let pythagoras = length(&b).powi(2) - length(&product).powi(2) - x.outside.to_f64().powi(2);
            split.see(pythagoras.abs() / (unit * length(&b)), place);
            if rank == n {
                let mut y = b.clone();
                linalg::solve(n, &m, &b, &mut y, &mut Workspace::new()).unwrap();
                assert_eq!(x.outside.to_f64(), 0.0);
                let gap = distance(&x.solution, &cast::<S, Dd>(&y));
                stationary.see(gap / (n as f64 * eps * 4.0 * length(&y)), || format!("n = {n}, regular"));
            }
        }
    }
    stationary.end();
    split.end();
}

/// Powers of two on the matrix and on the right-hand side change nothing but exponents.
fn scaled<S: Scalar>(most: i32) {
    let mut rng = ChaCha8Rng::seed_from_u64(224);
    let mut checks = 0;
    for n in 1..=20 {
        let w: Vec<f64> = (0..n).map(|k| if k % 3 == 2 { 0.0 } else { 1.0 + k as f64 }).collect();
        let m: Vec<S> = with_spectrum(&w, &mut rng);
        let b: Vec<S> = (0..n).map(|_| S::of_f64(rng.random_range(-1.0..1.0))).collect();
        let plain = found(n, &m, &b);
        assert_eq!(plain.rank, n - n / 3);
        for (on_matrix, on_rhs) in
            [(most, 0), (-most, 0), (0, most), (0, -most), (most, most), (-most, -most), (most, -most), (-most, most)]
        {
            let scale = |x: &[S], e: i32| x.iter().map(|x| x.ldexp(e)).collect::<Vec<S>>();
            let other = found(n, &scale(&m, on_matrix), &scale(&b, on_rhs));
            let expected = MinimumNorm {
                solution: scale(&plain.solution, on_rhs - on_matrix),
                rank: plain.rank,
                outside: plain.outside.ldexp(on_rhs),
            };
            assert_eq!(other, expected, "n = {n}, 2^{on_matrix}, 2^{on_rhs}");
            checks += 1;
        }
    }
    exact::<S>(22, "minimum norm: scaled by powers of two", checks);
}

#[test]
fn case_22_gauge_directions() {
    gauge_directions::<f32>();
    gauge_directions::<f64>();
}

#[test]
fn case_22_redundant_coordinates() {
    redundant_coordinates::<f32>();
    redundant_coordinates::<f64>();
}

#[test]
fn case_22_inconsistent_right_hand_sides() {
    inconsistent::<f32>();
    inconsistent::<f64>();
}

#[test]
fn case_22_scales() {
    scaled::<f32>(45);
    scaled::<f64>(300);
    scaled::<Dd>(300);
}

#[test]
fn case_22_what_has_no_solution_of_finite_numbers() {
    let ws = &mut Workspace::new();
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(minimum_norm(2, &[1.0, bad, bad, 1.0], &[1.0; 2], ws), Err(LinalgError::NotFinite { row: 0 }));
        assert_eq!(minimum_norm(1, &[1.0], &[bad], ws), Err(LinalgError::NotFinite { row: 0 }));
    }
    assert_eq!(minimum_norm(1, &[1e-200], &[1e200], ws), Err(LinalgError::NotFinite { row: 0 }));
    assert!(matches!(minimum_norm(2, &[1.0; 3], &[1.0; 2], ws), Err(LinalgError::Shape { .. })));
    assert!(matches!(minimum_norm(2, &[1.0; 4], &[1.0; 3], ws), Err(LinalgError::Shape { .. })));
    let nothing = found::<f64>(2, &[0.0; 4], &[3.0, 4.0]);
    assert_eq!(nothing, MinimumNorm { solution: vec![0.0; 2], rank: 0, outside: 5.0 });
    assert_eq!(found::<f64>(0, &[], &[]), MinimumNorm { solution: vec![], rank: 0, outside: 0.0 });
    // `solve` refuses the same matrix.
    let refused = linalg::solve(2, &[1.0; 4], &[1.0; 2], &mut [0.0; 2], ws);
    assert_eq!(refused, Err(LinalgError::Singular { row: 0, condition: f64::INFINITY }));
}
