//! Small symmetric matrices: time per matrix against backward error, `lnn::linalg` beside nalgebra and faer.

use super::batch::{Batch, eigen_error, solve_error, worst};
use super::options::Options;
use super::output::{Section, Table, curve, level};
use super::rivals::{EIGENSOLVERS, SIGNS, SOLVERS, Solver};
use super::timing::Timing;
use lnn::linalg::Workspace;
use lnn::report::Series;
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
