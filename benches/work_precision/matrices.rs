//! Small symmetric matrices: time per matrix against backward error, `lnn::linalg` beside nalgebra and faer.

use super::options::Options;
use super::output::{Section, Table, curve, level};
use super::timing::Timing;
use crate::common::matrices::{matrices, with_spectrum};
use faer::linalg::solvers::Solve;
use lnn::linalg::{self, Workspace};
use lnn::report::Series;
use lnn::scalar::{Dd, Real, Scalar};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;

const TEXT: &str = "\
Two sets of matrices in f64. hard: LAPACK's types (definite and not, condition numbers to 0.01/eps, zero and tiny \
diagonals, units 2^3 apart), where the library takes the time to look whether a matrix is singular; regular: definite \
ones with eigenvalues from 1 to n. A batch is done one after the other; the library works on eight side by side.
Solve: R = |M x - r| / ((|M| |x| + |r|) n eps). Eigen: R = max |M u - w u| / (n eps |M|), max |U U' - I| / (n eps). Residuals \
in double-double, Frobenius norms, the worst matrix.
Inertia: matrices whose signs are not all right, judged by eigenvalues in double-double or by construction; a zero counts \
as wrong, since none of these matrices is singular.
faer: partial pivoting and Bunch-Kaufman, without threads; nalgebra: LU with the size known to the compiler (static) and \
not (dynamic).";

const SIZES: [usize; 5] = [2, 3, 4, 8, 20];

/// Solves a batch `(matrices, rhs)` into `x`; rows that failed and why.
type Solver = fn(usize, &[f64], &[f64], &mut [f64], &mut Workspace<f64>) -> Vec<(usize, String)>;
/// Eigenvalues and eigenvectors as rows, of a batch; rows that failed and why.
type Eigensolver = fn(usize, &[f64], &mut [f64], &mut [f64], &mut Workspace<f64>) -> Vec<(usize, String)>;
/// Signs of a batch: whether those of each matrix are `(positive, negative)`; how many are wrong.
type Signs = fn(usize, &[f64], &[(usize, usize)], &mut [f64], &mut Workspace<f64>) -> usize;

const SOLVERS: [(&str, Solver); 5] = [
    ("lnn", lnn_solve),
    ("nalgebra static", nalgebra_static_solve),
    ("nalgebra dynamic", nalgebra_solve),
    ("faer LU", |n, m, r, x, _| faer_solve(n, m, r, x, |m, r| m.partial_piv_lu().solve(r))),
    ("faer LBLT", |n, m, r, x, _| faer_solve(n, m, r, x, |m, r| m.lblt(faer::Side::Lower).solve(r))),
];

const EIGENSOLVERS: [(&str, Eigensolver); 4] = [
    ("lnn", lnn_eigh),
    ("nalgebra static", nalgebra_static_eigh),
    ("nalgebra dynamic", nalgebra_eigh),
    ("faer", faer_eigh),
];

const SIGNS: [(&str, Signs); 4] =
    [("lnn pivots", lnn_inertia), ("lnn eigenvalues", lnn_signs), ("nalgebra", nalgebra_signs), ("faer", faer_signs)];

/// Matrices of one size with what is known of them.
struct Batch {
    n: usize,
    set: &'static str,
    kinds: Vec<String>,
    matrices: Vec<f64>,
    rhs: Vec<f64>,
    /// Positive and negative eigenvalues.
    signs: Vec<(usize, usize)>,
}

impl Batch {
    /// LAPACK's types, each `rounds` times.
    fn hard(n: usize, rounds: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
        Self::new(n, "hard", (0..rounds).flat_map(|_| matrices::<f64>(n, &mut rng)).collect(), &mut rng)
    }

    /// Well-conditioned definite ones.
    fn regular(n: usize, count: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
        let spectrum: Vec<f64> = (1..=n).map(|k| k as f64).collect();
        let list = (0..count).map(|_| ("regular".into(), with_spectrum(&spectrum, &mut rng))).collect();
        Self::new(n, "regular", list, &mut rng)
    }

    fn new(n: usize, set: &'static str, list: Vec<(String, Vec<f64>)>, rng: &mut ChaCha8Rng) -> Self {
        let (kinds, list): (Vec<String>, Vec<Vec<f64>>) = list.into_iter().unzip();
        let signs = kinds.iter().zip(&list).map(|(kind, m)| exact_signs(n, kind, m)).collect();
        let rhs = (0..kinds.len() * n).map(|_| rng.random_range(-1.0..1.0)).collect();
        Self { n, set, kinds, matrices: list.concat(), rhs, signs }
    }

    fn len(&self) -> usize {
        self.kinds.len()
    }

    fn matrix(&self, row: usize) -> &[f64] {
        &self.matrices[row * self.n * self.n..][..self.n * self.n]
    }
}

/// Signs by eigenvalues in double-double; a definite matrix stays definite when rows and columns are scaled alike.
fn exact_signs(n: usize, kind: &str, matrix: &[f64]) -> (usize, usize) {
    if kind.starts_with("scaled") {
        return (n, 0);
    }
    let wide: Vec<Dd> = matrix.iter().map(|&m| Dd::of_f64(m)).collect();
    let mut values = vec![Dd::of_f64(0.0); n];
    if linalg::eigenvalues(n, &wide, &mut values, &mut Workspace::new()).is_err() {
        return (0, 0);
    }
    let negative = values.iter().filter(|w| w.to_f64() < 0.0).count();
    (n - negative, negative)
}

/// Measures every engine on every size.
pub fn section(options: &Options) -> Section {
    let mut raw = Table::new(["operation", "engine", "set", "n", "matrices", "worst_r", "worst_matrix", "wrong_signs"]);
    raw.header.extend(Timing::HEADER.map(|name| if name == "repeats" { name.into() } else { format!("ns_{name}") }));
    let summary =
        Table::new(["operation", "engine", "set", "n", "worst R", "wrong signs", "ns per matrix", "worst matrix"]);
    let mut section = Section::new("matrices", "Small symmetric matrices", TEXT, raw, summary);
    for set in ["regular", "hard"] {
        let batch = |&n: &usize| match set {
            "hard" => Batch::hard(n, options.choose(1, 4, 8)),
            _ => Batch::regular(n, options.choose(40, 160, 320)),
        };
        let batches: Vec<Batch> = SIZES.iter().map(batch).collect();
        solves(options, &batches, &mut section);
        eigen(options, &batches, &mut section);
        inertia(options, &batches, &mut section);
    }
    for (engine, solve) in SOLVERS {
        for n in SIZES {
            section.failed(format!("{engine}, matrix of ones, n = {n}"), singular(n, solve));
        }
    }
    section
}

fn solves(options: &Options, batches: &[Batch], section: &mut Section) {
    let (stopwatch, mut workspace) = (options.stopwatch(), Workspace::new());
    let mut curves = Vec::new();
    for (engine, solve) in SOLVERS {
        let mut points = Vec::new();
        for batch in batches {
            let mut x = vec![f64::NAN; batch.rhs.len()];
            let failed = solve(batch.n, &batch.matrices, &batch.rhs, &mut x, &mut workspace);
            let worst = worst(batch, &failed, |row| solve_error(batch, row, &x));
            note(section, batch, engine, &failed);
            let time = stopwatch.measure(|| {
                black_box(solve(batch.n, black_box(&batch.matrices), &batch.rhs, &mut x, &mut workspace));
            });
            points.push((worst.0, row(section, ("solve", engine), batch, Ok(worst), time)));
        }
        curves.push(curve(engine, &points));
    }
    diagram(section, ("solve", "Solve"), batches, curves);
}

fn eigen(options: &Options, batches: &[Batch], section: &mut Section) {
    let (stopwatch, mut workspace) = (options.stopwatch(), Workspace::new());
    let mut curves = Vec::new();
    for (engine, eigh) in EIGENSOLVERS {
        let mut points = Vec::new();
        for batch in batches {
            let (mut w, mut u) = (batch.rhs.clone(), batch.matrices.clone());
            let failed = eigh(batch.n, &batch.matrices, &mut w, &mut u, &mut workspace);
            let worst = worst(batch, &failed, |row| eigen_error(batch, row, &w, &u));
            note(section, batch, engine, &failed);
            let time = stopwatch.measure(|| {
                black_box(eigh(batch.n, black_box(&batch.matrices), &mut w, &mut u, &mut workspace));
            });
            points.push((worst.0, row(section, ("eigen", engine), batch, Ok(worst), time)));
        }
        curves.push(curve(engine, &points));
    }
    diagram(section, ("eigen", "Eigenvalues and vectors"), batches, curves);
}

fn inertia(options: &Options, batches: &[Batch], section: &mut Section) {
    let (stopwatch, mut workspace) = (options.stopwatch(), Workspace::new());
    for (engine, signs) in SIGNS {
        for batch in batches {
            let mut scratch = vec![0.0; batch.rhs.len().max(batch.n * batch.n)];
            let wrong = signs(batch.n, &batch.matrices, &batch.signs, &mut scratch, &mut workspace);
            let time = stopwatch.measure(|| {
                black_box(signs(batch.n, black_box(&batch.matrices), &batch.signs, &mut scratch, &mut workspace));
            });
            row(section, ("inertia", engine), batch, Err(wrong), time);
        }
    }
}

fn diagram(section: &mut Section, (file, title): (&str, &str), batches: &[Batch], mut curves: Vec<Series>) {
    let set = batches.first().map_or("", |batch| batch.set);
    curves.push(level("R = 30", 30.0, &curves));
    let title = format!("{title} of {set} matrices, n = 2, 3, 4, 8, 20");
    section.diagram(format!("{file}_{set}"), &title, "worst R", "time per matrix [ns]", curves);
}

/// Adds a row of both tables; returns the nanoseconds per matrix.
fn row(
    section: &mut Section,
    (operation, engine): (&str, &str),
    batch: &Batch,
    judged: Result<(f64, String), usize>,
    time: Timing,
) -> f64 {
    let (r, kind, wrong) = match judged {
        Ok((r, kind)) => (format!("{r:.3}"), kind, String::new()),
        Err(wrong) => (String::new(), String::new(), wrong.to_string()),
    };
    let scale = 1e9 / batch.len() as f64;
    let head = [operation.to_string(), engine.to_string(), batch.set.to_string(), batch.n.to_string()];
    let mut raw = head.to_vec();
    raw.extend([batch.len().to_string(), r.clone(), kind.clone(), wrong.clone()]);
    raw.extend(time.cells(scale));
    section.raw.rows.push(raw);
    let shown = if wrong.is_empty() { wrong } else { format!("{wrong} of {}", batch.len()) };
    section.summary.rows.push([&head[..], &[r, shown, format!("{:.1}", time.median * scale), kind]].concat());
    time.median * scale
}

/// Notes rows that an engine could not do, one line for each kind of matrix.
fn note(section: &mut Section, batch: &Batch, engine: &str, failed: &[(usize, String)]) {
    let mut kinds: Vec<&str> = Vec::new();
    for (row, reason) in failed {
        let kind = &*batch.kinds[*row];
        if !kinds.contains(&kind) {
            kinds.push(kind);
            section.failed(format!("{engine}, {kind}, n = {}", batch.n), reason);
        }
    }
}

/// The largest error of the rows that did not fail, and the kind of matrix; infinite for one that is not finite.
fn worst(batch: &Batch, failed: &[(usize, String)], error: impl Fn(usize) -> f64) -> (f64, String) {
    let mut worst = (0.0, String::new());
    for row in (0..batch.len()).filter(|row| failed.iter().all(|(failed, _)| failed != row)) {
        let error = error(row);
        let error = if error.is_nan() { f64::INFINITY } else { error };
        if error > worst.0 {
            worst = (error, batch.kinds[row].clone());
        }
    }
    worst
}

fn wide(x: f64) -> Dd {
    Dd::of_f64(x)
}

fn norm(x: impl Iterator<Item = Dd>) -> f64 {
    x.fold(0.0, |sum, x| sum + x.to_f64() * x.to_f64()).sqrt()
}

fn product(n: usize, m: &[f64], x: &[f64]) -> Vec<Dd> {
    let dot = |row: &[f64]| row.iter().zip(x).fold(<Dd as Real>::zero(), |s, (&m, &x)| s + wide(m) * wide(x));
    m.chunks_exact(n).map(dot).collect()
}

fn solve_error(batch: &Batch, row: usize, x: &[f64]) -> f64 {
    let n = batch.n;
    let (m, r, x) = (batch.matrix(row), &batch.rhs[row * n..][..n], &x[row * n..][..n]);
    let residual = norm(product(n, m, x).into_iter().zip(r).map(|(p, &r)| p - wide(r)));
    let size = |x: &[f64]| norm(x.iter().map(|&x| wide(x)));
    residual / ((size(m) * size(x) + size(r)) * n as f64 * f64::EPSILON)
}

fn eigen_error(batch: &Batch, row: usize, w: &[f64], u: &[f64]) -> f64 {
    let n = batch.n;
    let (m, w, u) = (batch.matrix(row), &w[row * n..][..n], &u[row * n * n..][..n * n]);
    let size = norm(m.iter().map(|&m| wide(m)));
    let mut worst = 0f64;
    for (k, vector) in u.chunks_exact(n).enumerate() {
        let residual = norm(product(n, m, vector).into_iter().zip(vector).map(|(p, &x)| p - wide(w[k]) * wide(x)));
        let others = product(n, u, vector).into_iter().enumerate();
        let skew = norm(others.map(|(j, p)| p - wide(f64::from(u8::from(j == k)))));
        for error in [residual / size, skew] {
            worst = if error.is_nan() { f64::NAN } else { worst.max(error) };
        }
    }
    worst / (n as f64 * f64::EPSILON)
}

/// What a solver says to a matrix of ones, which is singular.
fn singular(n: usize, solve: Solver) -> String {
    let (m, r) = (vec![1.0; n * n], (0..n).map(|i| i as f64).collect::<Vec<_>>());
    let mut x = vec![f64::NAN; n];
    match solve(n, &m, &r, &mut x, &mut Workspace::new()).pop() {
        Some((_, reason)) => format!("refused: {reason}"),
        None if x.iter().all(|x| x.is_finite()) => "solved without a word, finite numbers".into(),
        None => "solved without a word, numbers not finite".into(),
    }
}

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
