//! Solvers, eigensolvers and signs of a batch of small symmetric matrices: `lnn::linalg`, nalgebra and faer.

use faer::linalg::solvers::Solve;
use lnn::linalg::{self, Workspace};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Solves a batch `(matrices, rhs)` into `x`; rows that failed and why.
pub type Solver = fn(usize, &[f64], &[f64], &mut [f64], &mut Workspace<f64>) -> Vec<(usize, String)>;
/// Eigenvalues and eigenvectors as rows, of a batch; rows that failed and why.
pub type Eigensolver = fn(usize, &[f64], &mut [f64], &mut [f64], &mut Workspace<f64>) -> Vec<(usize, String)>;
/// Signs of a batch: whether those of each matrix are `(positive, negative)`; how many are wrong.
pub type Signs = fn(usize, &[f64], &[(usize, usize)], &mut [f64], &mut Workspace<f64>) -> usize;

pub const SOLVERS: [(&str, Solver); 5] = [
    ("lnn", lnn_solve),
    ("nalgebra static", nalgebra_static_solve),
    ("nalgebra dynamic", nalgebra_solve),
    ("faer LU", |n, m, r, x, _| faer_solve(n, m, r, x, |m, r| m.partial_piv_lu().solve(r))),
    ("faer LBLT", |n, m, r, x, _| faer_solve(n, m, r, x, |m, r| m.lblt(faer::Side::Lower).solve(r))),
];

pub const EIGENSOLVERS: [(&str, Eigensolver); 4] = [
    ("lnn", lnn_eigh),
    ("nalgebra static", nalgebra_static_eigh),
    ("nalgebra dynamic", nalgebra_eigh),
    ("faer", faer_eigh),
];

pub const SIGNS: [(&str, Signs); 4] =
    [("lnn pivots", lnn_inertia), ("lnn eigenvalues", lnn_signs), ("nalgebra", nalgebra_signs), ("faer", faer_signs)];

fn lnn_solve(n: usize, m: &[f64], r: &[f64], x: &mut [f64], workspace: &mut Workspace<f64>) -> Vec<(usize, String)> {
    match linalg::solve(n, m, r, x, workspace) {
        Ok(()) => Vec::new(),
        Err(error) => workspace.failures().iter().map(|&(row, _)| (row, error.to_string())).collect(),
    }
}

/// Runs `$run` on every matrix with its size known to the compiler.
macro_rules! sized {
    ($n:expr, $run:ident($($argument:expr),*)) => {
        match $n {
            2 => $run::<2>($($argument),*),
            3 => $run::<3>($($argument),*),
            4 => $run::<4>($($argument),*),
            8 => $run::<8>($($argument),*),
            20 => $run::<20>($($argument),*),
            n => vec![(0, format!("left out: no static size {n}"))],
        }
    };
}

const NO_SOLUTION: &str = "no solution, no reason given";

fn nalgebra_static_solve(
    n: usize,
    m: &[f64],
    r: &[f64],
    x: &mut [f64],
    _: &mut Workspace<f64>,
) -> Vec<(usize, String)> {
    fn run<const N: usize>(m: &[f64], r: &[f64], x: &mut [f64]) -> Vec<(usize, String)>
    where
        nalgebra::Const<N>: nalgebra::DimMin<nalgebra::Const<N>, Output = nalgebra::Const<N>>,
    {
        let mut failed = Vec::new();
        for (row, ((m, r), x)) in m.chunks_exact(N * N).zip(r.chunks_exact(N)).zip(x.chunks_exact_mut(N)).enumerate() {
            let lu = SMatrix::<f64, N, N>::from_column_slice(m).lu();
            match lu.solve(&SVector::<f64, N>::from_column_slice(r)) {
                Some(found) => x.copy_from_slice(found.as_slice()),
                None => failed.push((row, NO_SOLUTION.into())),
            }
        }
        failed
    }
    sized!(n, run(m, r, x))
}

fn nalgebra_solve(n: usize, m: &[f64], r: &[f64], x: &mut [f64], _: &mut Workspace<f64>) -> Vec<(usize, String)> {
    let mut failed = Vec::new();
    for (row, ((m, r), x)) in m.chunks_exact(n * n).zip(r.chunks_exact(n)).zip(x.chunks_exact_mut(n)).enumerate() {
        match DMatrix::from_column_slice(n, n, m).lu().solve(&DVector::from_column_slice(r)) {
            Some(found) => x.copy_from_slice(found.as_slice()),
            None => failed.push((row, NO_SOLUTION.into())),
        }
    }
    failed
}

fn faer_solve(
    n: usize,
    m: &[f64],
    r: &[f64],
    x: &mut [f64],
    solve: impl Fn(faer::MatRef<'_, f64>, faer::MatRef<'_, f64>) -> faer::Mat<f64>,
) -> Vec<(usize, String)> {
    for ((m, r), x) in m.chunks_exact(n * n).zip(r.chunks_exact(n)).zip(x.chunks_exact_mut(n)) {
        let m = faer::MatRef::from_column_major_slice(m, n, n);
        let found = solve(m, faer::MatRef::from_column_major_slice(r, n, 1));
        x.iter_mut().enumerate().for_each(|(i, x)| *x = found[(i, 0)]);
    }
    Vec::new()
}

fn lnn_eigh(n: usize, m: &[f64], w: &mut [f64], u: &mut [f64], workspace: &mut Workspace<f64>) -> Vec<(usize, String)> {
    match linalg::eigh(n, m, w, u, workspace) {
        Ok(()) => Vec::new(),
        Err(error) => workspace.failures().iter().map(|&(row, _)| (row, error.to_string())).collect(),
    }
}

fn nalgebra_static_eigh(
    n: usize,
    m: &[f64],
    w: &mut [f64],
    u: &mut [f64],
    _: &mut Workspace<f64>,
) -> Vec<(usize, String)> {
    macro_rules! eigen {
        ($($size:literal)*) => {
            match n {
                $($size => for ((m, w), u) in m
                    .chunks_exact(n * n)
                    .zip(w.chunks_exact_mut(n))
                    .zip(u.chunks_exact_mut(n * n))
                {
                    let found = SMatrix::<f64, $size, $size>::from_column_slice(m).symmetric_eigen();
                    w.copy_from_slice(found.eigenvalues.as_slice());
                    // Columns one after the other.
                    u.copy_from_slice(found.eigenvectors.as_slice());
                },)*
                n => return vec![(0, format!("left out: no static size {n}"))],
            }
        };
    }
    eigen!(2 3 4 8 20);
    Vec::new()
}

fn nalgebra_eigh(n: usize, m: &[f64], w: &mut [f64], u: &mut [f64], _: &mut Workspace<f64>) -> Vec<(usize, String)> {
    for ((m, w), u) in m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)).zip(u.chunks_exact_mut(n * n)) {
        let found = DMatrix::from_column_slice(n, n, m).symmetric_eigen();
        w.copy_from_slice(found.eigenvalues.as_slice());
        u.copy_from_slice(found.eigenvectors.as_slice());
    }
    Vec::new()
}

fn faer_eigh(n: usize, m: &[f64], w: &mut [f64], u: &mut [f64], _: &mut Workspace<f64>) -> Vec<(usize, String)> {
    let mut failed = Vec::new();
    let rows = m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)).zip(u.chunks_exact_mut(n * n));
    for (row, ((m, w), u)) in rows.enumerate() {
        match faer::MatRef::from_column_major_slice(m, n, n).self_adjoint_eigen(faer::Side::Lower) {
            Ok(found) => {
                w.iter_mut().enumerate().for_each(|(k, w)| *w = found.S()[k]);
                u.iter_mut().enumerate().for_each(|(at, u)| *u = found.U()[(at % n, at / n)]);
            }
            Err(error) => failed.push((row, format!("{error:?}"))),
        }
    }
    failed
}

/// How many matrices have other signs than they should.
fn count_wrong<'a>(n: usize, values: impl Iterator<Item = &'a [f64]>, signs: &[(usize, usize)]) -> usize {
    let right = |w: &[f64], &(positive, negative): &(usize, usize)| {
        w.len() == n
            && w.iter().filter(|w| **w > 0.0).count() == positive
            && w.iter().filter(|w| **w < 0.0).count() == negative
    };
    values.zip(signs).filter(|(w, signs)| !right(w, signs)).count()
}

fn lnn_inertia(n: usize, m: &[f64], signs: &[(usize, usize)], scratch: &mut [f64], _: &mut Workspace<f64>) -> usize {
    let mut wrong = 0;
    for (m, &(positive, negative)) in m.chunks_exact(n * n).zip(signs) {
        let right = linalg::inertia(n, m, scratch).is_ok_and(|i| (i.positive, i.negative) == (positive, negative));
        wrong += usize::from(!right);
    }
    wrong
}

fn lnn_signs(n: usize, m: &[f64], signs: &[(usize, usize)], w: &mut [f64], workspace: &mut Workspace<f64>) -> usize {
    let w = &mut w[..n * signs.len()];
    match linalg::eigenvalues(n, m, w, workspace) {
        Ok(()) => count_wrong(n, w.chunks_exact(n), signs),
        Err(_) => signs.len(),
    }
}

fn nalgebra_signs(n: usize, m: &[f64], signs: &[(usize, usize)], w: &mut [f64], _: &mut Workspace<f64>) -> usize {
    for (m, w) in m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)) {
        w.copy_from_slice(DMatrix::from_column_slice(n, n, m).symmetric_eigenvalues().as_slice());
    }
    count_wrong(n, w.chunks_exact(n), signs)
}

fn faer_signs(n: usize, m: &[f64], signs: &[(usize, usize)], w: &mut [f64], _: &mut Workspace<f64>) -> usize {
    for (m, w) in m.chunks_exact(n * n).zip(w.chunks_exact_mut(n)) {
        match faer::MatRef::from_column_major_slice(m, n, n).self_adjoint_eigenvalues(faer::Side::Lower) {
            Ok(found) => w.copy_from_slice(&found),
            Err(_) => w.fill(f64::NAN),
        }
    }
    count_wrong(n, w.chunks_exact(n), signs)
}
