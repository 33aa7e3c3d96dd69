//! Solves and eigenvalues of LAPACK's test matrix types (DDRVSY, DDRVST), judged by double-double residuals.

use crate::common::matrices::{dd, matrices, norm, times, with_spectrum};
use lnn::linalg::{self, Failure, Inertia, LinalgError, Workspace};
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rounding stays below this, algorithms that lose accuracy do not (units of eps times condition).
const R: f64 = 30.0;

/// Worst backward and forward error of `solve` over all types, in units of `n eps` and `kappa eps`.
fn solve_errors<S: Scalar>() -> (f64, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let eps = S::epsilon().to_f64();
    let (mut backward, mut forward) = (0f64, 0f64);
    let mut workspace = Workspace::new();
    // By lanes, and by faer from 47 on.
    for n in (1..=20).chain([46, 47, 53]) {
        let list = matrices::<S>(n, &mut rng);
        let flat: Vec<S> = list.iter().flat_map(|(_, m)| m.iter().copied()).collect();
        let rhs: Vec<S> = (0..list.len() * n).map(|_| S::of_f64(rng.random_range(-1.0..1.0))).collect();
        let mut x = vec![S::of_f64(0.0); rhs.len()];
        linalg::solve(n, &flat, &rhs, &mut x, &mut workspace).unwrap();
        let wide: Vec<Dd> = flat.iter().map(|&m| dd(m)).collect();
        let wide_rhs: Vec<Dd> = rhs.iter().map(|&r| dd(r)).collect();
        let mut exact = vec![Dd::of_f64(0.0); rhs.len()];
        linalg::solve(n, &wide, &wide_rhs, &mut exact, &mut Workspace::new()).unwrap();
        for (b, (name, m)) in list.iter().enumerate() {
            let (x, r, exact) = (&x[b * n..][..n], &rhs[b * n..][..n], &exact[b * n..][..n]);
            let found: Vec<Dd> = x.iter().map(|&x| dd(x)).collect();
            let product = times(n, m, &found);
            let residual = norm((0..n).map(|i| product[i] - dd(r[i])));
            let size = norm(m.iter().map(|&m| dd(m)));
            let scale = size * norm(found.iter().copied()) + norm(r.iter().map(|&r| dd(r)));
            let back = residual / (scale * n as f64 * eps);
            assert!(back < R, "n = {n}, {name}: backward error {back}");
            let kappa = linalg::condition_number(n, &wide[b * n * n..][..n * n], &mut Workspace::new()).unwrap();
            let error = norm((0..n).map(|i| found[i] - exact[i])) / (norm(exact.iter().copied()) * kappa * eps);
            assert!(error < R, "n = {n}, {name}: forward error {error}");
            backward = backward.max(back);
            forward = forward.max(error);
        }
    }
    (backward, forward)
}

#[test]
fn solve_is_backward_stable_on_lapack_types() {
    for (name, (backward, forward)) in [("f32", solve_errors::<f32>()), ("f64", solve_errors::<f64>())] {
        println!("{name}: backward R = {backward:.3}, forward R = {forward:.3}");
        assert!(backward < 3.0 && forward < 3.0, "{name}: {backward} {forward}");
    }
}

/// Worst error of eigenvalues and orthogonality and residual of eigenvectors, in units of `n eps |M|`.
fn eigen_errors<S: Scalar>() -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let eps = S::epsilon().to_f64();
    let mut worst = 0f64;
    for n in (1..=12).chain([16, 20, 40]) {
        let mut list = matrices::<S>(n, &mut rng);
        list.push(("zero".into(), vec![S::of_f64(0.0); n * n]));
        list.push(("ones".into(), vec![S::of_f64(1.0); n * n]));
        // Wilkinson's W+: pairs that agree to the last digits.
        let mut w = vec![S::of_f64(0.0); n * n];
        for i in 0..n {
            w[i * n + i] = S::of_f64(((n - 1) as f64 / 2.0 - i as f64).abs());
            if i > 0 {
                w[i * n + i - 1] = S::of_f64(1.0);
                w[(i - 1) * n + i] = S::of_f64(1.0);
            }
        }
        list.push(("Wilkinson".into(), w));
        let cluster: Vec<f64> = (0..n).map(|k| 1.0 + eps * (k % 3) as f64).collect();
        list.push(("cluster".into(), with_spectrum(&cluster, &mut rng)));
        let flat: Vec<S> = list.iter().flat_map(|(_, m)| m.iter().copied()).collect();
        let (mut values, mut vectors) = (vec![S::of_f64(0.0); list.len() * n], flat.clone());
        linalg::eigh(n, &flat, &mut values, &mut vectors, &mut Workspace::new()).unwrap();
        let mut alone = values.clone();
        linalg::eigenvalues(n, &flat, &mut alone, &mut Workspace::new()).unwrap();
        let wide: Vec<Dd> = flat.iter().map(|&m| dd(m)).collect();
        let mut exact = vec![Dd::of_f64(0.0); values.len()];
        linalg::eigenvalues(n, &wide, &mut exact, &mut Workspace::new()).unwrap();
        for (b, (name, m)) in list.iter().enumerate() {
            let (w, u) = (&values[b * n..][..n], &vectors[b * n * n..][..n * n]);
            let size = norm(m.iter().map(|&m| dd(m))).max(f64::MIN_POSITIVE);
            let mut error = 0f64;
            for k in 0..n {
                for w in [w[k], alone[b * n + k]] {
                    error = error.max((dd(w) - exact[b * n + k]).to_f64().abs() / size);
                }
                assert!(k == 0 || w[k - 1] <= w[k], "n = {n}, {name}: ascending");
                let row: Vec<Dd> = u[k * n..][..n].iter().map(|&x| dd(x)).collect();
                let product = times(n, m, &row);
                error = error.max(norm((0..n).map(|i| product[i] - dd(w[k]) * row[i])) / size);
                for j in 0..=k {
                    let dot = (0..n).fold(<Dd as Real>::zero(), |s, i| s + row[i] * dd(u[j * n + i])).to_f64();
                    error = error.max((dot - f64::from(u8::from(j == k))).abs());
                }
            }
            let error = error / (n as f64 * eps);
            assert!(error < R, "n = {n}, {name}: {error}");
            worst = worst.max(error);
        }
    }
    worst
}

#[test]
fn eigenvectors_are_orthogonal_and_eigenvalues_right() {
    for (name, worst) in [("f32", eigen_errors::<f32>()), ("f64", eigen_errors::<f64>())] {
        println!("{name}: eigen R = {worst:.3}");
        assert!(worst < 6.0, "{name}: {worst}");
    }
}

#[test]
fn closed_forms_of_small_eigenvalues() {
    let mut ws = Workspace::new();
    let mut w3 = [0.0; 3];
    linalg::eigenvalues(3, &[-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], &mut w3, &mut ws).unwrap();
    assert_eq!(w3, [-1.0, 1.0, 1.0], "diagonal matrices are exact");
    for k in 1..=52 {
        let d = 2f64.powi(-k);
        let mut w = [0.0; 2];
        // Eigenvalues 1 +- d.
        linalg::eigenvalues(2, &[1.0, d, d, 1.0], &mut w, &mut ws).unwrap();
        assert!((w[0] - (1.0 - d)).abs() <= f64::EPSILON && (w[1] - (1.0 + d)).abs() <= f64::EPSILON, "{k}: {w:?}");
        // The small one is -d / (1 + sqrt(1 + d^2/4) - d/2) nearly -d/2: right to eps |M|, so its sign to k = 50.
        linalg::eigenvalues(2, &[1.0, 1.0, 1.0, 1.0 - d], &mut w, &mut ws).unwrap();
        let exact = -d / (1.0 - 0.5 * d + (1.0 + 0.25 * d * d).sqrt());
        assert!((w[0] - exact).abs() <= 2.0 * f64::EPSILON, "{k}: {} {exact}", w[0]);
        assert!(k > 50 || w[0] < 0.0, "{k}: sign");
    }
    // A graded positive matrix keeps the relative accuracy of its small eigenvalue.
    let tiny = 2f64.powi(-60);
    let mut w = [0.0; 2];
    linalg::eigenvalues(2, &[1.0, 0.5 * tiny.sqrt(), 0.5 * tiny.sqrt(), tiny], &mut w, &mut ws).unwrap();
    assert!((w[0] / (0.75 * tiny) - 1.0).abs() < 4.0 * f64::EPSILON, "{w:?}");
}

#[test]
fn scale_does_not_matter() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for n in [2, 3, 4, 7] {
        let m: Vec<f64> = with_spectrum(&(0..n).map(|k| k as f64 - 1.5).collect::<Vec<_>>(), &mut rng);
        let (mut w, mut u, mut ws) = (vec![0.0; n], vec![0.0; n * n], Workspace::new());
        linalg::eigh(n, &m, &mut w, &mut u, &mut ws).unwrap();
        for e in [-500, -60, 60, 500] {
            let scaled: Vec<f64> = m.iter().map(|m| Scalar::ldexp(*m, e)).collect();
            let (mut ws_, mut us) = (w.clone(), u.clone());
            linalg::eigh(n, &scaled, &mut ws_, &mut us, &mut ws).unwrap();
            for k in 0..n {
                let difference = Scalar::ldexp(ws_[k], -e) - w[k];
                assert!(difference.abs() < 16.0 * f64::EPSILON, "n = {n}, 2^{e}");
            }
            let (r, mut x) = (vec![1.0; n], vec![0.0; n]);
            linalg::solve(n, &scaled, &r, &mut x, &mut ws).unwrap();
            let mut y = x.clone();
            linalg::solve(n, &m, &r, &mut y, &mut ws).unwrap();
            assert_eq!(x.iter().map(|x| Scalar::ldexp(*x, e)).collect::<Vec<_>>(), y);
            let mut minors = Vec::new();
            linalg::leading_minors(n, &scaled, &mut minors, &mut ws).unwrap();
            let mut plain = Vec::new();
            linalg::leading_minors(n, &m, &mut plain, &mut ws).unwrap();
            for (k, (a, b)) in minors.iter().zip(&plain).enumerate() {
                assert!((a.mantissa / b.mantissa - 1.0).abs() < 1e-13);
                assert_eq!(a.exponent - b.exponent, i64::from(e) * (k as i64 + 1));
            }
        }
    }
}

#[test]
fn a_matrix_gives_the_same_bits_anywhere_in_a_batch() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for n in (1..=6).chain([49]) {
        let batch = 21;
        let m: Vec<f64> = (0..batch)
            .flat_map(|_| {
                with_spectrum::<f64>(&(0..n).map(|_| rng.random_range(-2.0..2.0)).collect::<Vec<_>>(), &mut rng)
            })
            .collect();
        let r: Vec<f64> = (0..batch * n).map(|_| rng.random_range(-1.0..1.0)).collect();
        let mut ws = Workspace::new();
        let (mut x, mut w, mut u) = (r.clone(), r.clone(), m.clone());
        linalg::solve(n, &m, &r, &mut x, &mut ws).unwrap();
        linalg::eigh(n, &m, &mut w, &mut u, &mut ws).unwrap();
        for b in 0..batch {
            let (one, rhs) = (&m[b * n * n..][..n * n], &r[b * n..][..n]);
            let (mut x1, mut w1, mut u1) = (vec![0.0; n], vec![0.0; n], vec![0.0; n * n]);
            linalg::solve(n, one, rhs, &mut x1, &mut ws).unwrap();
            linalg::eigh(n, one, &mut w1, &mut u1, &mut ws).unwrap();
            assert_eq!(x1, x[b * n..][..n]);
            assert_eq!(w1, w[b * n..][..n]);
            assert_eq!(u1, u[b * n * n..][..n * n]);
        }
    }
}

#[test]
fn singular_and_foreign_rows_are_reported_and_the_others_solved() {
    let mut ws = Workspace::new();
    #[rustfmt::skip]
    let m = [
        2.0, 0.0, 0.0, 2.0,
        1.0, 1.0, 1.0, 1.0,
        f64::NAN, 0.0, 0.0, 1.0,
        1.0, 1.0, 1.0, 1.0 + f64::EPSILON,
        0.0, 1.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 0.0,
        1.0, f64::INFINITY, f64::INFINITY, 1.0,
        // Units apart, not singular.
        1.0, 0.0, 0.0, 1e-40,
    ];
    let r = [1.0; 16];
    let mut x = [0.0; 16];
    let error = linalg::solve(2, &m, &r, &mut x, &mut ws).unwrap_err();
    assert_eq!(error, LinalgError::Singular { row: 1, condition: f64::INFINITY });
    let rows: Vec<usize> = ws.failures().iter().map(|f| f.0).collect();
    assert_eq!(rows, [1, 2, 3, 5, 6]);
    assert_eq!(ws.failures()[1].1, Failure::NotFinite);
    assert!(matches!(ws.failures()[2].1, Failure::Singular { condition } if condition > 1e15));
    for row in 0..8 {
        assert_eq!(x[2 * row].is_nan(), rows.contains(&row), "row {row}");
        assert_eq!(x[2 * row + 1].is_nan(), rows.contains(&row), "row {row}");
    }
    assert_eq!(x[..2], [0.5, 0.5]);
    assert_eq!(x[8..10], [1.0, 1.0]);
    assert_eq!(x[14..], [1.0, 1e40]);
    // Not a number in the right-hand side.
    let error = linalg::solve(1, &[1.0, 1.0], &[1.0, f64::NAN], &mut x[..2], &mut ws).unwrap_err();
    assert_eq!(error, LinalgError::NotFinite { row: 1 });
    assert!(matches!(linalg::solve(2, &m, &r[..4], &mut x[..4], &mut ws), Err(LinalgError::Shape { .. })));
    let (mut w, mut u) = ([0.0; 16], [0.0; 32]);
    let error = linalg::eigh(2, &m, &mut w, &mut u, &mut ws).unwrap_err();
    assert_eq!(error, LinalgError::NotFinite { row: 2 });
    assert!(w[4].is_nan() && u[8].is_nan() && w[2].abs() < 1e-16 && (w[3] - 2.0).abs() < 1e-15);
}

/// Blocks of two by two at the ends of unit matrices, solved by lanes and by faer.
fn failures_of_size<S: Scalar>(n: usize) {
    let (inf, nan, eps) = (f64::INFINITY, f64::NAN, S::epsilon().to_f64());
    let blocks = [
        [2.0, 0.0, 2.0],
        [1.0, 1.0, 1.0],
        [nan, 0.0, 1.0],
        [1.0, 1.0, 1.0 + eps],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, inf, 1.0],
        // Units apart, not singular.
        [1.0, 0.0, 0.5f64.powi(100)],
        [1e-3, 1.0, 1.0],
    ];
    let mut m = vec![S::of_f64(0.0); blocks.len() * n * n];
    for (m, [a, b, c]) in m.chunks_exact_mut(n * n).zip(blocks) {
        m.iter_mut().step_by(n + 1).for_each(|one| *one = S::of_f64(1.0));
        (m[0], m[n - 1], m[n * n - n], m[n * n - 1]) = (S::of_f64(a), S::of_f64(b), S::of_f64(b), S::of_f64(c));
    }
    let (mut r, mut ws) = (vec![S::of_f64(1.0); blocks.len() * n], Workspace::new());
    let (mut x, mut inverse) = (r.clone(), m.clone());
    for pass in 0..2 {
        let error = if pass == 0 {
            linalg::solve(n, &m, &r, &mut x, &mut ws)
        } else {
            linalg::inverse(n, &m, &mut inverse, &mut ws)
        };
        assert!(matches!(error, Err(LinalgError::Singular { row: 1, condition }) if condition > 0.1 / eps));
        let rows: Vec<usize> = ws.failures().iter().map(|f| f.0).collect();
        assert_eq!(rows, [1, 2, 3, 5, 6], "n = {n}");
        assert!(matches!(ws.failures()[1].1, Failure::NotFinite) && matches!(ws.failures()[4].1, Failure::NotFinite));
        assert!(matches!(ws.failures()[2].1, Failure::Singular { condition } if condition > 0.5 / eps));
        assert!(matches!(ws.failures()[3].1, Failure::Singular { condition } if condition == inf));
        for row in 0..blocks.len() {
            let (x, inverse) = (&x[row * n..][..n], &inverse[row * n * n..][..n * n]);
            let all = if pass == 0 { x } else { inverse };
            assert!(all.iter().all(|x| x.is_nan() == rows.contains(&row)), "row {row} of size {n}");
        }
    }
    for (row, ends) in [(0, [0.5, 0.5]), (4, [1.0, 1.0]), (7, [1.0, 2f64.powi(100)]), (8, [0.0, 1.0])] {
        let x = &x[row * n..][..n];
        let found = [x[0].to_f64(), x[n - 1].to_f64()];
        let error = found.iter().zip(ends).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs() / y.abs().max(1.0)));
        assert!(error <= 4.0 * eps && x[1..n - 1].iter().all(|&x| x == S::of_f64(1.0)), "row {row}: {found:?}");
    }
    // Not a number in the right-hand side.
    r[4 * n + 2] = S::nan();
    let error = linalg::solve(n, &m[4 * n * n..5 * n * n], &r[4 * n..5 * n], &mut x[..n], &mut ws);
    assert_eq!(error, Err(LinalgError::NotFinite { row: 0 }));
}

#[test]
fn failures_are_the_same_by_lanes_and_by_faer() {
    for n in [5, 39, 40, 46, 47, 64] {
        failures_of_size::<f32>(n);
        failures_of_size::<f64>(n);
    }
    failures_of_size::<Dd>(47);
}

#[test]
fn inertia_by_pivots_agrees_with_the_spectrum() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut ws = Workspace::new();
    let mut scratch = vec![0.0; 400];
    for n in 1..=20 {
        for negative in 0..=n {
            let w: Vec<f64> =
                (0..n).map(|k| rng.random_range(0.01..3.0) * if k < negative { -1.0 } else { 1.0 }).collect();
            let m: Vec<f64> = with_spectrum(&w, &mut rng);
            let found = linalg::inertia(n, &m, &mut scratch).unwrap();
            assert_eq!(found, Inertia { positive: n - negative, zero: 0, negative });
            assert_eq!(linalg::is_positive_definite(n, &m, &mut scratch), negative == 0);
            let mut minors = Vec::new();
            linalg::leading_minors(n, &m, &mut minors, &mut ws).unwrap();
            let product: f64 = w.iter().product();
            assert!((minors[n - 1].value() / product - 1.0).abs() < 1e-11, "n = {n}, {negative}");
        }
    }
    let tiny = 2f64.powi(-60);
    for (m, expected) in [
        ([tiny, 1.0, 1.0, tiny], (1, 0, 1)),
        ([0.0, 1.0, 1.0, 0.0], (1, 0, 1)),
        ([1.0, 1.0, 1.0, 1.0], (1, 1, 0)),
        ([0.0, 0.0, 0.0, 0.0], (0, 2, 0)),
        ([-1.0, 0.0, 0.0, 1.0], (1, 0, 1)),
        ([1e300, 1e300, 1e300, -1e300], (1, 0, 1)),
        ([1e-300, 0.0, 0.0, 2e-300], (2, 0, 0)),
    ] {
        let found = linalg::inertia(2, &m, &mut scratch).unwrap();
        assert_eq!((found.positive, found.zero, found.negative), expected, "{m:?}");
        assert_eq!(linalg::is_positive_definite(2, &m, &mut scratch), expected.0 == 2);
    }
    assert!(linalg::inertia(1, &[f64::NAN], &mut scratch).is_err());
    assert!(!linalg::is_positive_definite(1, &[f64::NAN], &mut scratch));
}

#[test]
fn inertia_of_hard_matrices_is_that_of_their_exact_spectra() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut scratch = vec![0.0; 400];
    for n in [1, 2, 3, 4, 5, 8, 13, 20] {
        for (name, m) in matrices::<f64>(n, &mut rng) {
            // Units of another size on every other coordinate as well.
            let mixed: Vec<f64> = (0..n * n)
                .map(|k| {
                    Scalar::ldexp(m[k], if k / n % 2 == 0 { 40 } else { -9 } + if k % n % 2 == 0 { 40 } else { -9 })
                })
                .collect();
            let wide: Vec<Dd> = m.iter().map(|&m| dd(m)).collect();
            let mut w = vec![Dd::of_f64(0.0); n];
            linalg::eigenvalues(n, &wide, &mut w, &mut Workspace::new()).unwrap();
            let negative = w.iter().filter(|w| w.to_f64() < 0.0).count();
            let expected = Inertia { positive: n - negative, zero: 0, negative };
            for m in [&m, &mixed] {
                assert_eq!(linalg::inertia(n, m, &mut scratch).unwrap(), expected, "n = {n}, {name}");
            }
        }
    }
}

#[test]
fn gradient_of_the_determinant_is_right_where_it_vanishes() {
    let mut ws = Workspace::new();
    let mut gradient = [0.0; 4];
    let e = linalg::adjugate(2, &[1.0, 1.0, 1.0, 1.0], &mut gradient, &mut ws).unwrap();
    for (g, exact) in gradient.iter().zip([1.0, -1.0, -1.0, 1.0]) {
        assert!((Scalar::ldexp(*g, e as i32) - exact).abs() <= 8.0 * f64::EPSILON);
    }
    let e = linalg::adjugate(1, &[0.0], &mut gradient[..1], &mut ws).unwrap();
    assert_eq!((gradient[0], e), (1.0, 0));
    // adj(M) M = det(M) I, near the ends of the range too.
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for n in 2..=8 {
        let w: Vec<f64> = (0..n).map(|_| rng.random_range(-2.0..2.0)).collect();
        let m: Vec<f64> = with_spectrum(&w, &mut rng);
        let scaled: Vec<f64> = m.iter().map(|m| Scalar::ldexp(*m, 500)).collect();
        let mut adjugate = vec![0.0; n * n];
        let e = linalg::adjugate(n, &scaled, &mut adjugate, &mut ws).unwrap() - 500 * (n as i64 - 1);
        let det: f64 = w.iter().product();
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = (0..n).map(|k| adjugate[i * n + k] * m[k * n + j]).sum();
                let exact = if i == j { det } else { 0.0 };
                assert!((Scalar::ldexp(sum, e as i32) - exact).abs() < 1e-12, "n = {n}");
            }
        }
    }
    let mut zero = vec![1.0; 9];
    let e = linalg::adjugate(3, &[1.0; 9], &mut zero, &mut ws).unwrap();
    assert!(zero.iter().all(|&z| Scalar::ldexp(z, e as i32).abs() < 1e-14), "rank one: the gradient vanishes");
}

#[test]
fn inverses_are_symmetric_and_invert() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for n in (1..=8).chain([41]) {
        let batch = 11;
        let m: Vec<f64> = (0..batch)
            .flat_map(|b| {
                with_spectrum::<f64>(
                    &(0..n).map(|k| if (k + b) % 3 == 0 { -0.5 } else { 2.0 }).collect::<Vec<_>>(),
                    &mut rng,
                )
            })
            .collect();
        let mut inverse = m.clone();
        linalg::inverse(n, &m, &mut inverse, &mut Workspace::new()).unwrap();
        for b in 0..batch {
            for i in 0..n {
                for j in 0..n {
                    let sum: f64 = (0..n).map(|k| m[b * n * n + i * n + k] * inverse[b * n * n + k * n + j]).sum();
                    assert!((sum - f64::from(u8::from(i == j))).abs() < 100.0 * f64::EPSILON);
                    assert_eq!(inverse[b * n * n + i * n + j], inverse[b * n * n + j * n + i]);
                }
            }
        }
    }
}

/// Regular only after scaling: the correction by refinement is as large as the solution.
#[test]
fn a_correction_that_does_not_shrink_is_not_taken() {
    let e = 0.5f64.powi(22);
    let (a, c) = (0.0042724609375, 4.5 * e);
    let matrix = [
        [a, a, -e, -e, c],
        [a, a, -e, -e, 4.0 * c],
        [-e, -e, -e, 0.0, -8.0 * e],
        [-e, -e, 0.0, -8.6e-10, -0.5],
        [c, 4.0 * c, -8.0 * e, -0.5, -0.0546875],
    ]
    .concat();
    let right = [-0.13671875, 0.0, -0.23828125, -9.918212890625e-5, 0.796875];
    let mut x = [0.0; 5];
    linalg::solve(5, &matrix, &right, &mut x, &mut Workspace::new()).unwrap();
    let x = x.map(dd);
    let product = times(5, &matrix, &x);
    let residual = norm((0..5).map(|i| product[i] - dd(right[i])));
    let scale = norm(matrix.iter().map(|&m| dd(m))) * norm(x.into_iter()) + norm(right.map(dd).into_iter());
    let error = residual / (scale * 5.0 * f64::EPSILON);
    assert!(error < R, "backward error {error}");
}
