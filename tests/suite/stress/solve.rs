//! Case 16: tiny and vanishing pivots.

use super::record::{Row, exact};
use crate::common::matrices::dd;
use lnn::linalg::{self, Inertia, Workspace};
use lnn::scalar::Scalar;

/// `[[d, 1], [1, d]] x = (1, 2)`: `x = ((d - 2), (2 d - 1)) / (d^2 - 1)`, elementwise.
fn tiny_pivots<S: Scalar>() {
    let mut row = Row::new::<S>(16, "[[d, 1], [1, d]] x = (1, 2)");
    let (one, two) = (S::of_f64(1.0), S::of_f64(2.0));
    for k in (2..=60).chain([200, 500, 1000]) {
        let d = S::of_f64(2f64.powi(-k));
        let mut x = [S::nan(); 2];
        linalg::solve(2, &[d, one, one, d], &[one, two], &mut x, &mut Workspace::new()).unwrap();
        let (d, one, two) = (dd(d), dd(one), dd(two));
        let exact = [(d - two) / (d * d - one), (two * d - one) / (d * d - one)];
        for (x, exact) in x.into_iter().zip(exact) {
            row.see(((dd(x) - exact) / exact).to_f64().abs() / S::epsilon().to_f64(), || format!("d = 2^-{k}"));
        }
        let inertia = linalg::inertia(
            2,
            &[S::of_f64(2f64.powi(-k)), S::of_f64(1.0), S::of_f64(1.0), S::of_f64(0.0)],
            &mut [S::nan(); 4],
        );
        assert_eq!(inertia, Ok(Inertia { positive: 1, zero: 0, negative: 1 }), "d = 2^-{k}");
    }
    row.end_below(4.0);
}

/// Matrices of ones without their diagonal, and exchanges: integer solutions and known signs.
fn zero_diagonals<S: Scalar>() {
    let mut row = Row::new::<S>(16, "zero diagonals, unit n eps |x|");
    let (zero, one) = (S::of_f64(0.0), S::of_f64(1.0));
    let mut checks = 0;
    for n in 2..=20 {
        // Eigenvalues n - 1, once, and -1.
        let ones: Vec<S> = (0..n * n).map(|k| if k / n == k % n { zero } else { one }).collect();
        // Exchanges the ends: +-1 in turn.
        let exchange: Vec<S> = (0..n * n).map(|k| if k / n + k % n == n - 1 { one } else { zero }).collect();
        let middle = n % 2;
        let expected: Vec<S> = (0..n).map(|i| S::of_f64(i as f64 - 3.0)).collect();
        for (name, m, positive) in [("ones", ones, 1), ("exchange", exchange, n / 2 + middle)] {
            let inertia = linalg::inertia(n, &m, &mut vec![zero; n * n]).unwrap();
            assert_eq!(inertia, Inertia { positive, zero: 0, negative: n - positive }, "{name} {n}");
            let rhs: Vec<S> = (0..n).map(|i| (0..n).fold(zero, |s, j| s + m[i * n + j] * expected[j])).collect();
            let mut x = vec![S::nan(); n];
            linalg::solve(n, &m, &rhs, &mut x, &mut Workspace::new()).unwrap();
            let size = expected.iter().fold(0.0_f64, |m, x| m.max(x.to_f64().abs()));
            for (x, y) in x.iter().zip(&expected) {
                row.see((*x - *y).to_f64().abs() / (n as f64 * S::epsilon().to_f64() * size), || format!("{name} {n}"));
            }
            checks += 1;
        }
    }
    row.end_below(4.0);
    exact::<S>(16, "inertia of zero diagonals", checks);
}

#[test]
fn case_16_pivots() {
    tiny_pivots::<f32>();
    tiny_pivots::<f64>();
    zero_diagonals::<f32>();
    zero_diagonals::<f64>();
}
