//! Projection of states onto constraints.

use super::rows::{dot, largest, length};
use super::{Manifold, ManifoldRows};
use crate::lagrangian::accelerations::are_safe;
use crate::lagrangian::thresholds::{MOST_PROJECTION_STEPS, PROJECTION_ROUNDINGS};
use crate::linalg::{Workspace, minimum_norm};
use crate::scalar::{Real, Scalar, are_finite};
use crate::tape::Replay;
use alloc::vec::Vec;

/// The error for a state that could not be projected onto the constraints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffManifold {
    /// The most violated row.
    pub row: usize,
    /// Its violation divided by the length of its gradient: a distance in units of the coordinates, or of the velocities.
    pub defect: f64,
}

/// Projects a state onto the constraints with the smallest changes along the rows: `q` to `phi(q) = 0` by Newton's method, then `v` to `A v
/// = b`. Returns how far coordinates and velocities moved.
///
/// # Errors
/// [`OffManifold`] if the iteration does not converge; `q` and `v` then are its best state.
pub fn project<S: Scalar>(manifold: &dyn Manifold<S>, q: &mut [S], v: &mut [S]) -> Result<[f64; 2], OffManifold> {
    let mut values = Defects::new(manifold, false);
    let before = [q.to_vec(), v.to_vec()];
    let mut last = S::infinity();
    for step in 0..MOST_PROJECTION_STEPS {
        if values.of.is_empty() {
            break;
        }
        let change = values.least_change(q, v);
        let size = largest(change);
        q.iter_mut().zip(change).for_each(|(q, &change)| *q -= change);
        let rounding = S::epsilon() * largest(q);
        // The step is at the level of rounding, or no longer decreases.
        if size <= rounding || (step > 3 && size > last * S::half() && size < rounding.ldexp(10)) {
            break;
        }
        last = size;
    }
    values.check(q, v, largest(q))?;
    let mut rates = Defects::new(manifold, true);
    for _ in 0..2 {
        let change = rates.least_change(q, v);
        v.iter_mut().zip(change).for_each(|(v, &change)| *v -= change);
    }
    rates.check(q, v, Real::max(largest(&before[1]), largest(v)))?;
    let moved = |from: &[S], to: &[S]| {
        let change: Vec<S> = from.iter().zip(to).map(|(&a, &b)| a - b).collect();
        length(&change).to_f64()
    };
    Ok([moved(&before[0], q), moved(&before[1], v)])
}

/// Defects of a state in some rows: the values of holonomic constraints, or the rates of all rows.
struct Defects<'a, S: Scalar> {
    manifold: &'a dyn Manifold<S>,
    of_rates: bool,
    /// Indices of the rows.
    of: Vec<usize>,
    /// The program of the correction, if there is one. Its results are the change, pairs of a diagonal element of `A A^T` and its pivot,
    /// the defects, and this diagonal.
    program: Option<Replay<S>>,
    change: Vec<S>,
    guards: Vec<S>,
    defects: Vec<S>,
    squares: Vec<S>,
    rows: ManifoldRows<S>,
}

impl<'a, S: Scalar> Defects<'a, S> {
    fn new(manifold: &'a dyn Manifold<S>, of_rates: bool) -> Self {
        let of: Vec<usize> =
            (0..manifold.names().len()).filter(|&row| of_rates || manifold.is_holonomic(row)).collect();
        let (n, m) = (manifold.coordinates(), of.len());
        let program = manifold.programs().filter(|_| m > 0).and_then(|programs| programs.correction(of_rates));
        let field = |size: usize| vec![<S as Real>::zero(); size];
        let (change, guards, defects, squares) = (field(n), field(2 * m), field(m), field(m));
        Self { manifold, of_rates, of, program, change, guards, defects, squares, rows: ManifoldRows::default() }
    }

    /// Runs the program; returns `false` if there is none.
    fn replay(&mut self, q: &[S], v: &[S]) -> bool {
        let outputs = &mut [&mut self.change[..], &mut self.guards, &mut self.defects, &mut self.squares];
        self.program.as_mut().is_some_and(|program| program.evaluate(1, &[q, v], &[], outputs).is_ok())
    }

    /// Evaluates the rows one by one.
    fn evaluate(&mut self, q: &[S], v: &[S]) {
        self.manifold.rows(q, v, &mut self.rows);
        let all = if self.of_rates { &self.rows.rates } else { &self.rows.values };
        self.defects.clear();
        self.defects.extend(self.of.iter().map(|&row| all[row]));
    }

    /// Returns the smallest change of the coordinates or velocities, to be subtracted, that removes the defects to first order. Rows that
    /// may be dependent are passed to a solver that can handle them.
    fn least_change(&mut self, q: &[S], v: &[S]) -> &[S] {
        if !(self.replay(q, v) && are_safe(&self.guards) && are_finite(&self.change)) {
            self.evaluate(q, v);
            self.change = least_change(q.len(), &self.rows, &self.of, &self.defects);
        }
        &self.change
    }

    /// Rejects defects that exceed the rounding error at a state of this size.
    fn check(&mut self, q: &[S], v: &[S], size: S) -> Result<(), OffManifold> {
        if self.of.is_empty() {
            return Ok(());
        }
        let zero = <S as Real>::zero();
        let of_program = self.replay(q, v)
            && are_finite(&self.defects)
            && are_finite(&self.squares)
            && self.squares.iter().all(|&square| square > zero);
        if !of_program {
            self.evaluate(q, v);
        }
        let n = q.len();
        let mut worst: Option<(usize, S)> = None;
        for (k, (&row, &missed)) in self.of.iter().zip(&self.defects).enumerate() {
            let gradient = match of_program {
                true => Real::sqrt(self.squares[k]),
                false => length(&self.rows.matrix[row * n..(row + 1) * n]),
            };
            let defect = if gradient > zero { missed.abs() / gradient } else { missed.abs() };
            if worst.is_none_or(|(_, most)| defect.is_nan() || defect > most) {
                worst = Some((row, defect));
            }
        }
        let allowed = S::of_f64(PROJECTION_ROUNDINGS) * S::epsilon() * Real::max(size, S::min_positive());
        match worst {
            Some((row, defect)) if defect.is_nan() || defect > allowed => {
                Err(OffManifold { row, defect: defect.to_f64() })
            }
            _ => Ok(()),
        }
    }
}

/// Projects an acceleration onto `A a = -gamma` at a state that satisfies the constraints.
pub fn project_acceleration<S: Scalar>(manifold: &dyn Manifold<S>, q: &[S], v: &[S], a: &mut [S]) {
    let mut rows = ManifoldRows::default();
    manifold.rows(q, v, &mut rows);
    let along = rows.matrix.chunks_exact(q.len()).map(|row| dot(row, a));
    let defects: Vec<S> = along.zip(&rows.drift).map(|(along, &drift)| along + drift).collect();
    let all: Vec<usize> = (0..defects.len()).collect();
    let change = least_change(q.len(), &rows, &all, &defects);
    a.iter_mut().zip(&change).for_each(|(a, &change)| *a -= change);
}

/// Computes the smallest `x` with `A x = defects` for some of the rows; a least-squares solution if they are dependent.
fn least_change<S: Scalar>(n: usize, rows: &ManifoldRows<S>, of: &[usize], defects: &[S]) -> Vec<S> {
    let picked: Vec<S> = of.iter().flat_map(|&row| rows.matrix[row * n..(row + 1) * n].iter().copied()).collect();
    along_rows(n, &picked, defects).0
}

/// Computes the smallest `x = A^T w` with `A x = right`, and the smallest `w`, for rows `A`, `(m, n)`; a least-squares solution if the rows
/// are dependent. Zero rows have no effect.
pub fn along_rows<S: Scalar>(n: usize, rows: &[S], right: &[S]) -> (Vec<S>, Vec<S>) {
    let (m, zero) = (right.len(), <S as Real>::zero());
    let sizes: Vec<S> = rows.chunks_exact(n).map(length).collect();
    let over = |x: S, size: S| if size == zero { zero } else { x / size };
    let unit: Vec<S> = rows.iter().enumerate().map(|(at, &x)| over(x, sizes[at / n])).collect();
    let gram: Vec<S> = (0..m * m).map(|at| dot(&unit[at / m * n..][..n], &unit[at % m * n..][..n])).collect();
    let right: Vec<S> = right.iter().zip(&sizes).map(|(&x, &size)| over(x, size)).collect();
    let Ok(found) = minimum_norm(m, &gram, &right, &mut Workspace::new()) else {
        return (vec![S::nan(); n], vec![S::nan(); m]);
    };
    let mut x = vec![zero; n];
    for (row, &weight) in unit.chunks_exact(n).zip(&found.solution) {
        x.iter_mut().zip(row).for_each(|(x, &a)| *x += weight * a);
    }
    (x, found.solution.iter().zip(&sizes).map(|(&weight, &size)| over(weight, size)).collect())
}
