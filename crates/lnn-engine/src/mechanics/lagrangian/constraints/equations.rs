//! Constraints of a system as recorded programs, with derivatives by state and parameters, for fitting its constants.

use super::formulas::Free;
use super::rows::{complement, independent_rows};
use super::{Constrained, ConstraintError, Constraints, ExpressionConstraints, Manifold, ManifoldRows, along_rows};
use crate::forward::{Dual, HyperDual};
use crate::lagrangian::Mechanics;
use crate::lagrangian::linearization::Rate;
use crate::scalar::Real;
use crate::tape::{Program, ROWS, TapeError, Tracer};
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// The active constraints of a system, `m` rows of `n` coordinates.
#[derive(Clone, Debug)]
pub struct RowEquations {
    constraints: ExpressionConstraints,
    kept: Vec<usize>,
    chosen: Vec<usize>,
    /// Names of the rows.
    pub names: Vec<String>,
    /// Program of `(q, v)`: the rows `A`, `(m, n)`, and their drift `gamma`, `(m)`.
    pub rows: Arc<Program<f64>>,
    /// Program of `(q, v, a, lambda)`: the derivatives of `-A^T lambda` and of `A a + gamma` by `q`, `v` and the chosen parameters, row by
    /// row, `(n + m, 2n + chosen)`.
    pub slopes: Arc<Program<f64>>,
}

/// First-order changes of a state that satisfies the constraints, in rows of `2n` numbers.
#[derive(Clone, Debug)]
pub struct Tangent {
    /// The independent changes that keep the constraints satisfied: changes of positions with the velocity changes that they require, then
    /// changes of velocities alone.
    pub free: Vec<f64>,
    /// The smallest change of the state that follows a change of each chosen parameter, positions first.
    pub following: Vec<f64>,
}

impl RowEquations {
    /// Records the rows `kept` of the constraints, which take all `count` parameters.
    ///
    /// # Errors
    /// [`TapeError`] for formulas that branch on their data.
    pub fn record(
        constraints: &ExpressionConstraints,
        kept: &[usize],
        (count, chosen): (usize, &[usize]),
    ) -> Result<Self, TapeError> {
        let (n, all, m) = (constraints.coordinates(), constraints.names(), kept.len());
        let rows = Program::record_within(ROWS, (2 * n, count), |x, p| {
            let [values, matrix, rates, drift] = [(); 4].map(|()| Vec::new());
            let mut rows = ManifoldRows { values, matrix, rates, drift };
            evaluate(constraints, (all.len(), kept), p, (&x[..n], &x[n..]), &mut rows);
            Some([rows.matrix, rows.drift].concat())
        })?;
        let rate = Rate::of_constraints(constraints, (all.len(), kept), &vec![0.0; count], true)?;
        let slopes = Program::record_within(ROWS, (3 * n + m, count), |x, p| {
            // Derivatives of `A^T lambda` and of `-(A a + gamma)`.
            let found = rate.slopes(x, p, chosen)?;
            let columns = 2 * n + chosen.len();
            let element = |at: usize| found[at / columns].get(&(at % columns)).map_or_else(Tracer::zero, |x| -*x);
            Some((0..(n + m) * columns).map(element).collect())
        })?;
        Ok(Self {
            constraints: constraints.clone(),
            kept: kept.to_vec(),
            chosen: chosen.to_vec(),
            names: kept.iter().map(|&row| all[row].clone()).collect(),
            rows: Arc::new(rows),
            slopes: Arc::new(slopes),
        })
    }

    /// Returns the number of holonomic rows.
    pub fn holonomic(&self) -> usize {
        self.kept.iter().filter(|&&row| self.constraints.is_holonomic(row)).count()
    }

    /// Returns the number of independent changes of a state that keep the constraints satisfied.
    pub fn freedom(&self) -> usize {
        2 * self.constraints.coordinates() - self.holonomic() - self.kept.len()
    }

    /// Returns the manifold of allowed states for these values of the parameters.
    ///
    /// # Errors
    /// [`ConstraintError::Shape`] for another number of parameters.
    pub fn manifold(&self, values: &[f64]) -> Result<impl Manifold<f64> + use<>, ConstraintError> {
        let free = Mechanics::new(Free(self.constraints.coordinates()), []);
        let all = Constrained::new(free, self.constraints.clone(), values.iter().copied())?;
        Ok(all.only(self.kept.clone()))
    }

    /// Returns the derivatives of the constraint functions and of the rates of all rows by each chosen parameter: two numbers for each row,
    /// `(m, 2)` for each parameter.
    pub fn by_parameters(&self, values: &[f64], (q, v): (&[f64], &[f64])) -> Vec<f64> {
        let lift = |x: &f64| HyperDual::lift(*x);
        let moving: Vec<_> = q.iter().zip(v).map(|(&q, &v)| HyperDual::new(q, v, 0.0, 0.0)).collect();
        let (v, mut p): (Vec<_>, Vec<_>) = (v.iter().map(lift).collect(), values.iter().map(lift).collect());
        let mut found = vec![lift(&0.0); self.constraints.names().len()];
        let mut by = Vec::with_capacity(2 * self.kept.len() * self.chosen.len());
        for &k in &self.chosen {
            p[k].t = 1.0;
            self.constraints.values(&p, &moving, &v, &mut found);
            p[k].t = 0.0;
            for &row in &self.kept {
                let holonomic = self.constraints.is_holonomic(row);
                by.extend(if holonomic { [found[row].t, found[row].st] } else { [0.0, found[row].t] });
            }
        }
        by
    }

    /// Returns the tangent space of the constraints at the state `(q, v)`.
    pub fn tangent(&self, manifold: &dyn Manifold<f64>, values: &[f64], start: &[f64]) -> Tangent {
        let n = self.constraints.coordinates();
        let (q, v) = start.split_at(n);
        let (mut rows, mut rates) = (ManifoldRows::default(), Vec::new());
        manifold.rows(q, v, &mut rows);
        manifold.rate_gradients(q, v, &mut rates);
        let of_functions = |row: &usize| self.constraints.is_holonomic(self.kept[*row]);
        let functions: Vec<usize> = (0..self.kept.len()).filter(of_functions).collect();
        let gradients: Vec<f64> =
            functions.iter().flat_map(|row| &rows.matrix[row * n..(row + 1) * n]).copied().collect();
        // Returns the smallest change of velocities that a change of positions requires.
        let with_velocities = |dq: &[f64], own: &[f64]| -> Vec<f64> {
            let asked = rates.chunks_exact(n).zip(own).map(|(row, own)| own + super::dot(row, dq));
            let dv = along_rows(n, &rows.matrix, &asked.collect::<Vec<_>>()).0;
            dq.iter().copied().chain(dv.iter().map(|x| -x)).collect()
        };
        let perpendicular = |to: &[f64], count: usize| -> Vec<f64> {
            complement(n, &independent_rows(n, to).1).into_iter().take((n - count) * n).collect()
        };
        let still = vec![0.0; self.kept.len()];
        let mut free = Vec::new();
        perpendicular(&gradients, functions.len())
            .chunks_exact(n)
            .for_each(|dq| free.extend(with_velocities(dq, &still)));
        for dv in perpendicular(&rows.matrix, self.kept.len()).chunks_exact(n) {
            free.resize(free.len() + n, 0.0);
            free.extend(dv);
        }
        let mut following = Vec::new();
        for by in self.by_parameters(values, (q, v)).chunks_exact(2 * self.kept.len()) {
            let missed: Vec<f64> = functions.iter().map(|row| -by[2 * row]).collect();
            let dq = if missed.is_empty() { vec![0.0; n] } else { along_rows(n, &gradients, &missed).0 };
            let own: Vec<f64> = by.iter().skip(1).step_by(2).copied().collect();
            following.extend(with_velocities(&dq, &own));
        }
        Tangent { free, following }
    }
}

/// Evaluates the constraint rows in `kept` at one state.
pub(super) fn evaluate<R: Real>(
    constraints: &impl Constraints,
    (all, kept): (usize, &[usize]),
    parameters: &[R],
    (q, v): (&[R], &[R]),
    rows: &mut ManifoldRows<R>,
) {
    let (n, m, zero, one) = (q.len(), kept.len(), R::zero(), R::one());
    let holonomic: Vec<bool> = kept.iter().map(|&row| constraints.is_holonomic(row)).collect();
    rows.matrix.clear();
    rows.matrix.resize(m * n, zero);
    let lift = |x: &[R]| x.iter().map(|&x| Dual::lift(x)).collect::<Vec<_>>();
    let (of_rows, mut state) = (lift(parameters), [lift(q), lift(v)]);
    let mut values = vec![Dual::lift(zero); all];
    // The gradient of a function is taken by the coordinates, that of a row linear in the velocities by the velocities.
    for (by, kind) in [(0, true), (1, false)] {
        if !holonomic.contains(&kind) {
            continue;
        }
        for i in 0..n {
            state[by][i].tangent = one;
            constraints.values(&of_rows, &state[0], &state[1], &mut values);
            state[by][i].tangent = zero;
            for (k, &row) in kept.iter().enumerate().filter(|(k, _)| holonomic[*k] == kind) {
                rows.matrix[k * n + i] = values[row].tangent;
            }
        }
    }
    // Derivatives along the motion: value, rate and second derivative of a function; value and rate of a velocity row.
    let parameters: Vec<HyperDual<R>> = parameters.iter().map(|&x| HyperDual::lift(x)).collect();
    let q: Vec<HyperDual<R>> = q.iter().zip(v).map(|(&q, &v)| HyperDual::new(q, v, v, zero)).collect();
    let v: Vec<HyperDual<R>> = v.iter().map(|&v| HyperDual::lift(v)).collect();
    let mut values = vec![HyperDual::lift(zero); all];
    constraints.values(&parameters, &q, &v, &mut values);
    for field in [&mut rows.values, &mut rows.rates, &mut rows.drift] {
        field.clear();
    }
    for (&row, &holonomic) in kept.iter().zip(&holonomic) {
        let found = values[row];
        let (value, rate, drift) =
            if holonomic { (found.value, found.s, found.st) } else { (zero, found.value, found.s) };
        rows.values.push(value);
        rows.rates.push(rate);
        rows.drift.push(drift);
    }
}
