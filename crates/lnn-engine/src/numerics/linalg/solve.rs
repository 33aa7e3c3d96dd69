//! Batched solution of symmetric, possibly indefinite systems: one elimination for all rows, and a closer examination of rows that need it.

use super::batch::{Aligned, LANES, Lane, Retry, with_size};
use super::thresholds::{LARGE_GROWTH, SMALL_PIVOT, SUSPICIOUS_ROUNDINGS};
use super::{Failure, LinalgError, Workspace, condition, elimination, expect_length};
use crate::scalar::{Real, Scalar, in_lanes};
use alloc::vec::Vec;

/// Solves `M_b x_b = r_b` for a batch of square matrices.
///
/// Gaussian elimination with partial pivoting, on lanes, or faer's for `f32` and `f64` matrices of 47 rows and more with the feature
/// `faer`; one step of iterative refinement if a pivot is small or elements grow. `matrices` is `(batch, n, n)`, `rhs` and `solution` are
/// `(batch, n)`.
///
/// # Errors
/// [`LinalgError::Shape`] for slices of the wrong length. Otherwise the error of the first row that is singular
/// (condition number of the matrix scaled to unit diagonal above `1/eps`, so that a choice of units never matters)
/// or not finite; [`Workspace::failures`] lists all such rows, their solutions are `NaN`, the other rows are right.
pub fn solve<S: Scalar>(
    n: usize,
    matrices: &[S],
    rhs: &[S],
    solution: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    Systems::of(n, matrices, rhs, solution)?.solve(solution, workspace);
    workspace.outcome()
}

/// [`solve`](fn@super::solve) for symmetric matrices, such as mass matrices: of five rows and more each is first taken to be positive
/// definite, `L D L^T` in half the work, and only where it is not safely so a pivot is searched for. Of the matrices the upper triangle counts.
///
/// # Errors
/// As [`solve`](fn@super::solve).
pub fn solve_symmetric<S: Scalar>(
    n: usize,
    matrices: &[S],
    rhs: &[S],
    solution: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    let systems = Systems::of(n, matrices, rhs, solution)?;
    workspace.clear_failures();
    let refused = systems.solve_definite(solution, workspace);
    systems.solve_refused(refused, solution, workspace);
    workspace.outcome()
}

/// Inverses of a batch of symmetric matrices, `(batch, n, n)`, symmetric by construction.
///
/// Of five rows and more each is first taken to be positive definite, as by [`solve_symmetric`]. Otherwise column `k` solves `M x = e_k`, and
/// the mean of the two triangles is returned.
///
/// # Errors
/// As [`solve`](fn@super::solve); inverses of failed rows are `NaN`.
pub fn inverse<S: Scalar>(
    n: usize,
    matrices: &[S],
    inverses: &mut [S],
    workspace: &mut Workspace<S>,
) -> Result<(), LinalgError> {
    let size = n * n;
    let batch = matrices.len() / size.max(1);
    expect_length("matrices", batch * size, matrices.len())?;
    expect_length("inverses", batch * size, inverses.len())?;
    let systems = Systems { n, m: n, matrices, right: None };
    workspace.clear_failures();
    let refused = systems.invert_definite(inverses, workspace);
    systems.solve_refused(refused, inverses, workspace);
    workspace.outcome()
}

/// A batch of systems `A X = B`.
#[derive(Clone, Copy)]
pub(super) struct Systems<'a, S> {
    /// Size of a matrix.
    pub n: usize,
    /// Right-hand sides per matrix.
    pub m: usize,
    /// `(batch, n, n)`.
    pub matrices: &'a [S],
    /// `(batch, n, m)`; the identity if not given, `m = n`, and `X` is made symmetric.
    pub right: Option<&'a [S]>,
}

/// Below this ratio of smallest pivot to largest element a matrix may be singular.
pub(super) fn suspicious<S: Scalar>(n: usize) -> S {
    S::epsilon() * S::of_f64(SUSPICIOUS_ROUNDINGS * (n * n) as f64)
}

impl<'a, S: Scalar> Systems<'a, S> {
    /// Systems of one right-hand side each.
    fn of(n: usize, matrices: &'a [S], rhs: &'a [S], solution: &[S]) -> Result<Self, LinalgError> {
        let batch = rhs.len() / n.max(1);
        expect_length("right-hand sides", batch * n, rhs.len())?;
        expect_length("matrices", batch * n * n, matrices.len())?;
        expect_length("solutions", batch * n, solution.len())?;
        Ok(Self { n, m: 1, matrices, right: Some(rhs) })
    }

    /// Solves all; `solutions` is `(batch, n, m)`, `NaN` in the rows that fail.
    pub fn solve(&self, solutions: &mut [S], workspace: &mut Workspace<S>) {
        workspace.clear_failures();
        self.solve_pivoted(solutions, workspace);
    }

    /// Solves with pivots the rows that were refused as not definite; all if nothing was tried.
    fn solve_refused(&self, refused: Option<Vec<usize>>, solutions: &mut [S], workspace: &mut Workspace<S>) {
        let &Self { n, m, .. } = self;
        let refused = match refused {
            Some(refused) if refused.is_empty() => return,
            Some(refused) if refused.len() * n * m < solutions.len() => refused,
            _ => return self.solve_pivoted(solutions, workspace),
        };
        let gathered = |from: &[S], size: usize| -> Vec<S> {
            refused.iter().flat_map(|row| &from[row * size..][..size]).copied().collect()
        };
        let matrices = gathered(self.matrices, n * n);
        let right = self.right.map(|right| gathered(right, n * m));
        let mut found = vec![S::nan(); refused.len() * n * m];
        Systems { matrices: &matrices, right: right.as_deref(), ..*self }.solve_pivoted(&mut found, workspace);
        for (&row, found) in refused.iter().zip(found.chunks_exact(n * m)) {
            solutions[row * n * m..][..n * m].copy_from_slice(found);
        }
        workspace.failures_mut().iter_mut().for_each(|(failed, _)| *failed = refused[*failed]);
    }

    /// As `solve` with pivots, adding failures to the known ones.
    fn solve_pivoted(&self, solutions: &mut [S], workspace: &mut Workspace<S>) {
        if self.solve_large(solutions, workspace) {
            return;
        }
        let batch = solutions.len() / (self.n * self.m).max(1);
        if const { size_of::<S>() < size_of::<f64>() } {
            self.split::<{ 2 * LANES }>(batch, solutions, workspace);
        } else {
            self.split::<LANES>(batch, solutions, workspace);
        }
    }

    /// In blocks of `W`, with a single row at the end alone.
    fn split<const W: usize>(&self, batch: usize, solutions: &mut [S], workspace: &mut Workspace<S>) {
        let together = batch - usize::from(batch % W == 1);
        let done = if self.blocks::<W>(0, together, solutions, workspace) { together } else { 0 };
        self.blocks::<1>(done, batch, solutions, workspace);
    }

    /// The rows `start..end` in blocks of `W`; `false`, with nothing done, if the CPU does not support this many lanes.
    fn blocks<const W: usize>(
        &self,
        start: usize,
        end: usize,
        solutions: &mut [S],
        workspace: &mut Workspace<S>,
    ) -> bool {
        if start == end {
            return true;
        }
        let &Self { n, m, matrices, right } = self;
        let (buffer, second, failures) = workspace.parts();
        let single = m == 1 && right.is_some();
        in_lanes::<W, _>(
            #[inline(always)]
            || {
                if single {
                    with_size!((S, W) n, buffer, |n| n * (n + 1), |system| {
                        for start in (start..end).step_by(W) {
                            let largest = elimination::load((n, 1), matrices, right, start, system);
                            let pivots = elimination::solve((n, 1), system);
                            if store((n, 1), system, &pivots, &largest, false, solutions, start) {
                                self.refine::<W>(solutions, start, second, failures);
                            }
                        }
                    });
                } else {
                    with_size!((S, W) n, buffer, |n| n * (n + n), |system| {
                        for start in (start..end).step_by(W) {
                            let largest = elimination::load((n, n), matrices, right, start, system);
                            let pivots = elimination::solve((n, n), system);
                            if store((n, n), system, &pivots, &largest, right.is_none(), solutions, start) {
                                self.refine::<W>(solutions, start, second, failures);
                            }
                        }
                    });
                }
            },
        )
        .is_some()
    }

    /// Solves rows `start..start + W` once more, with one step of iterative refinement where it is due, and finds out
    /// which matrices are singular.
    ///
    /// A correction of more than half the solution is not taken (as in LAPACK's `xSYRFS`): the matrix is singular to
    /// working precision, and the remainder after the two cancel has a larger backward error than either.
    #[cold]
    #[inline(never)]
    fn refine<const W: usize>(
        &self,
        solutions: &mut [S],
        start: usize,
        second: &mut Retry<S>,
        failures: &mut Vec<(usize, Failure)>,
    ) {
        let &Self { n, m, matrices, right } = self;
        let mut doubtful = [false; W];
        let Retry { block, solution, dense } = second;
        let done = in_lanes::<W, _>(
            #[inline(always)]
            || {
                let (system, x) = (block.lanes::<W>(n * (n + m)), solution.lanes::<W>(n * m));
                let largest = elimination::load((n, m), matrices, right, start, system);
                let pivots = elimination::solve((n, m), system);
                for (e, x) in x.iter_mut().enumerate() {
                    *x = system[e / m * (n + m) + n + e % m];
                }
                elimination::load((n, m), matrices, right, start, system);
                elimination::residual((n, m), system, x);
                elimination::solve((n, m), system);
                let due = refinement_due(&pivots, &largest);
                let floor = suspicious::<S>(n);
                for c in 0..m {
                    let (mut size, mut step) = ([<S as Real>::zero(); W], [<S as Real>::zero(); W]);
                    for i in 0..n {
                        elimination::larger(&mut size, &x[i * m + c]);
                        elimination::larger(&mut step, &system[i * (n + m) + n + c]);
                    }
                    for i in 0..n {
                        let (x, out) = (x[i * m + c], &mut system[i * (n + m) + n + c]);
                        for l in 0..W {
                            let refined: S = x[l] + out[l];
                            let shrinks = step[l] <= S::half() * size[l];
                            out[l] = if due[l] & shrinks { refined } else { x[l] };
                        }
                    }
                }
                let probe = finish((n, m), system, right.is_none(), solutions, start);
                for l in 0..W {
                    let regular = pivots.smallest[l] > floor * largest[l];
                    doubtful[l] = !(regular && probe[l] == <S as Real>::zero());
                }
            },
        );
        debug_assert!(done.is_some(), "a first solution by as many lanes was possible");
        for row in (start..matrices.len() / (n * n)).take(W).filter(|row| doubtful[row - start]) {
            let x = &mut solutions[row * n * m..(row + 1) * n * m];
            if let Some(failure) = examine(n, &matrices[row * n * n..(row + 1) * n * n], x, dense) {
                x.fill(S::nan());
                failures.push((row, failure));
            }
        }
    }
}

/// Which lanes have pivots or a growth of elements that cost digits, or no solution.
#[inline(always)]
fn refinement_due<S: Scalar, const W: usize>(pivots: &elimination::Pivots<S, W>, largest: &Lane<S, W>) -> [bool; W] {
    let mut due = [false; W];
    for l in 0..W {
        due[l] = !is_harmless(pivots.smallest[l], pivots.growth[l], largest[l]);
    }
    due
}

/// `true` if a solution needs no correction, judged by the smallest pivot and the largest elements of the triangular factor and the matrix.
#[inline(always)]
pub(super) fn is_harmless<S: Scalar>(smallest: S, growth: S, largest: S) -> bool {
    (smallest > S::of_f64(SMALL_PIVOT) * largest) & (growth <= S::of_f64(LARGE_GROWTH) * largest)
}

/// Writes the solutions out; whether a row needs a second look.
#[inline(always)]
fn store<S: Scalar, const W: usize>(
    shape: (usize, usize),
    system: &mut [Lane<S, W>],
    pivots: &elimination::Pivots<S, W>,
    largest: &Lane<S, W>,
    symmetric: bool,
    solutions: &mut [S],
    start: usize,
) -> bool {
    let probe = finish(shape, system, symmetric, solutions, start);
    let due = refinement_due(pivots, largest);
    let mut again = false;
    for l in 0..W {
        again |= due[l] | (probe[l] != <S as Real>::zero());
    }
    again
}

/// Writes the solutions of a block out; returns zero where all of a solution is finite, `NaN` otherwise.
#[inline(always)]
pub(super) fn finish<S: Scalar, const W: usize>(
    (n, m): (usize, usize),
    system: &mut [Lane<S, W>],
    symmetric: bool,
    solutions: &mut [S],
    start: usize,
) -> Lane<S, W> {
    let width = n + m;
    let system = &mut system[..n * width];
    let zero = <S as Real>::zero();
    let mut probe = [zero; W];
    if symmetric {
        for i in 0..n {
            for j in 0..i {
                let (x, mut mean) = (system[i * width + n + j], system[j * width + n + i]);
                for l in 0..W {
                    mean[l] = (mean[l] + x[l]) * S::half();
                }
                system[i * width + n + j] = mean;
                system[j * width + n + i] = mean;
            }
        }
    }
    for i in 0..n {
        for c in 0..m {
            let x = system[i * width + n + c];
            for l in 0..W {
                probe[l] += x[l] * zero;
            }
        }
    }
    let rows = &mut solutions[start * n * m..];
    if rows.len() >= W * n * m {
        write_rows(W, (n, m), system, rows);
    } else {
        write_last_rows((n, m), system, rows);
    }
    probe
}

/// Writes the solutions of the first `count` systems out as rows.
#[inline(always)]
fn write_rows<S: Scalar, const W: usize>(count: usize, (n, m): (usize, usize), system: &[Lane<S, W>], rows: &mut [S]) {
    for l in 0..count {
        let row = &mut rows[l * n * m..][..n * m];
        for i in 0..n {
            for c in 0..m {
                row[i * m + c] = system[i * (n + m) + n + c][l];
            }
        }
    }
}

/// Writes the last block of a batch, which need not be full.
#[cold]
#[inline(never)]
fn write_last_rows<S: Scalar, const W: usize>((n, m): (usize, usize), system: &[Lane<S, W>], rows: &mut [S]) {
    write_rows(rows.len() / (n * m), (n, m), system, rows);
}

/// The verdict on a matrix with a small pivot or a solution that is not finite.
pub(super) fn examine<S: Scalar>(
    n: usize,
    matrix: &[S],
    x: &[S],
    scratch: &mut super::batch::Dense<S>,
) -> Option<Failure> {
    if matrix.iter().any(|m| !m.is_finite()) {
        return Some(Failure::NotFinite);
    }
    if condition::is_singular(n, matrix, scratch) {
        return Some(Failure::Singular { condition: condition::condition_2(n, matrix, scratch) });
    }
    x.iter().any(|x| !x.is_finite()).then_some(Failure::NotFinite)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Systems of one right-hand side and inverses, regular and singular, by lanes and by the choice between lanes and faer.
    fn lanes_find_what_faer_finds<S: Scalar>() {
        for n in [3, 40, 70] {
            let batch = 2 * LANES + 1;
            let singular = 5;
            let mut m = vec![<S as Real>::zero(); batch * n * n];
            for (b, m) in m.chunks_exact_mut(n * n).enumerate() {
                for i in 0..n {
                    for j in 0..n {
                        let x = ((i * j * 7 + (i + j) * 13 + b * 5) % 101) as f64 / 101.0 - 0.5;
                        m[i * n + j] = S::of_f64(if i == j { x + n as f64 / 4.0 } else { x });
                    }
                }
                if b == singular {
                    (0..n).for_each(|k| (m[k], m[k * n]) = (<S as Real>::zero(), <S as Real>::zero()));
                }
            }
            let right: Vec<S> = (0..batch * n).map(|k| S::of_f64((k % 17) as f64 - 8.0)).collect();
            for (columns, right) in [(1, Some(&right[..])), (n, None)] {
                let systems = Systems { n, m: columns, matrices: &m, right };
                let (mut x, mut workspace) = (vec![<S as Real>::zero(); batch * n * columns], Workspace::new());
                let (mut chosen, mut its) = (x.clone(), Workspace::new());
                systems.split::<LANES>(batch, &mut x, &mut workspace);
                systems.solve(&mut chosen, &mut its);
                assert_eq!(workspace.failures(), its.failures());
                assert_eq!(workspace.failures().iter().map(|f| f.0).collect::<Vec<_>>(), [singular]);
                let size = |x: &[S]| x.iter().fold(0.0, |m: f64, x| m.max(Real::abs(*x).to_f64()));
                for (b, (x, chosen)) in x.chunks_exact(n * columns).zip(chosen.chunks_exact(n * columns)).enumerate() {
                    let difference: Vec<S> = x.iter().zip(chosen).map(|(&x, &y)| x - y).collect();
                    let bound = 64.0 * n as f64 * S::epsilon().to_f64() * size(x);
                    assert!(b == singular || size(&difference) <= bound, "{} {n} {columns}, row {b}", S::NAME);
                    assert!(b != singular || x.iter().all(|x| x.is_nan()));
                }
            }
        }
    }

    #[test]
    fn solutions_without_faer_are_those_with_it() {
        lanes_find_what_faer_finds::<f32>();
        lanes_find_what_faer_finds::<f64>();
    }
}
