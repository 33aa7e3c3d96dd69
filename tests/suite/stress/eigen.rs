//! Case 18: eigenvalues of two and three dimensions in closed form.

use super::record::Row;
use crate::common::matrices::dd;
use lnn::linalg::{self, Workspace};
use lnn::scalar::{Dd, Real, Scalar};

/// Errors in units of `eps |M|`.
fn closed_forms<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut row = Row::new::<S>(18, "closed forms of 2x2 and 3x3, unit eps |M|");
    let digits = -S::epsilon().ilogb();
    let mut check = |n: usize, m: &[S], exact: &[Dd], place: &dyn Fn() -> String| -> Vec<S> {
        let mut w = vec![S::nan(); n];
        linalg::eigenvalues(n, m, &mut w, &mut Workspace::new()).unwrap();
        let size = exact.iter().fold(0.0_f64, |m, w| m.max(w.to_f64().abs()));
        for (&w, &exact) in w.iter().zip(exact) {
            row.see((dd(w) - exact).to_f64().abs() / (eps * size), place);
        }
        w
    };
    let (zero, one) = (S::of_f64(0.0), S::of_f64(1.0));
    let wide = |x: f64| Dd::of_f64(x);
    for k in 1..=digits {
        let d = S::of_f64(2f64.powi(-k));
        check(2, &[one, d, d, one], &[wide(1.0) - dd(d), wide(1.0) + dd(d)], &|| format!("1 +- 2^-{k}"));
        // -d / (1 - d/2 + sqrt(1 + d^2/4)) and its partner.
        let root = Real::sqrt(wide(1.0) + dd(d) * dd(d) * wide(0.25));
        let small = -dd(d) / (wide(1.0) - dd(d) * wide(0.5) + root);
        let large = wide(2.0) - dd(d) - small;
        let w = check(2, &[one, one, one, one - d], &[small, large], &|| format!("[[1, 1], [1, 1 - 2^-{k}]]"));
        // |small| is nearly d/2: its sign is beyond rounding up to the last two digits.
        assert!(k > digits - 2 || w[0] < zero, "2^-{k}: {:?}", w[0]);
        // The same beside a third coordinate, on either side of the spectrum.
        for third in [-1.0, 0.5, 3.0] {
            let m = [one, zero, one, zero, S::of_f64(third), zero, one, zero, one - d];
            let mut exact = [small, large, wide(third)];
            exact.sort_by(|a, b| a.partial_cmp(b).unwrap());
            check(3, &m, &exact, &|| format!("3x3 with {third}, 2^-{k}"));
        }
    }
    let diagonal = [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].map(S::of_f64);
    assert_eq!(check(3, &diagonal, &[-1.0, 1.0, 1.0].map(wide), &|| "diag(-1, 1, 1)".into()), [-one, one, one]);
    // 3 I - 2 (1, 1, 1)(1, 1, 1)^T: -3, 3, 3.
    let reflection: Vec<S> = (0..9).map(|k| S::of_f64(if k % 4 == 0 { 1.0 } else { -2.0 })).collect();
    check(3, &reflection, &[-3.0, 3.0, 3.0].map(wide), &|| "reflection".into());
    row.end();
}

#[test]
fn case_18_closed_forms() {
    closed_forms::<f32>();
    closed_forms::<f64>();
}
