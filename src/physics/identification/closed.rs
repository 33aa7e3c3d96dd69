//! Systems under constraints, such as closed chains: their accelerations, their consistent initial states, and the part of forces that constraint
//! forces cannot balance.
//!
//! With multipliers `lambda` the equations are `M a - h - A^T lambda = Q`, `A a = -gamma`. Derivatives of the accelerations are solutions with the
//! same matrix `[M A^T; A 0]`. Initial states move within the constraints: along their tangent directions, by the smallest possible change if a
//! constant changes the constraints, and back onto the constraints by projection.

use super::IdentifyError;
use super::driven::{DrivenEquations, Segment};
use super::solve::Problem;
use super::thresholds::{FORCE_ROUNDING, LANES};
use crate::constraints::OBEDIENCE;
use crate::lagrangian::{
    Bordered, Manifold, ManifoldRows, RowEquations, Tangent, dot, independent_rows, project, take_out,
};
use crate::linalg::{self, Workspace};
use crate::names::rounded;
use crate::tape::Replay;
use std::sync::Arc;

/// Evaluates the constraints of many states side by side, with reused buffers.
pub(super) struct Closed {
    size: (usize, usize),
    rows: Replay<f64>,
    slopes: Replay<f64>,
    /// The rows `A`, `(lanes, m, n)`, and `-gamma`, `(lanes, m)`.
    matrix: Vec<f64>,
    drift: Vec<f64>,
    bordered: Bordered<f64>,
    /// The multipliers with the opposite sign, `(lanes, m)`.
    load: Vec<f64>,
    /// Derivatives of the equations, `(lanes, n + m, columns)`.
    by_state: Vec<f64>,
}

impl Closed {
    pub fn new(n: usize, rows: &RowEquations) -> Self {
        let (drift, load, by_state) = (Vec::new(), Vec::new(), Vec::new());
        Self {
            size: (n, rows.names.len()),
            rows: Replay::new(Arc::clone(&rows.rows)),
            slopes: Replay::new(Arc::clone(&rows.slopes)),
            matrix: Vec::new(),
            drift,
            bordered: Bordered::default(),
            load,
            by_state,
        }
    }

    /// The rows of the states evaluated last, `(lanes, m, n)`.
    pub fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    /// Accelerations of states `(q, v)` with the given mass matrices and forces; `NaN` if the equations have no solution.
    pub fn accelerate(
        &mut self,
        values: &[f64],
        (q, v): (&[f64], &[f64]),
        (mass, forces): (&[f64], &[f64]),
        (a, workspace): (&mut [f64], &mut Workspace<f64>),
    ) {
        let (n, m) = self.size;
        let lanes = q.len() / n;
        self.matrix.resize(lanes * m * n, 0.0);
        self.drift.resize(lanes * m, 0.0);
        self.load.resize(lanes * m, 0.0);
        // This cannot fail, because the shapes are those of the recorded program.
        let _ = self.rows.evaluate(lanes, &[q, v], values, &mut [&mut self.matrix, &mut self.drift]);
        self.drift.iter_mut().for_each(|drift| *drift = -*drift);
        self.bordered.set((n, m), mass, &self.matrix);
        self.bordered.solve(forces, &self.drift, a, &mut self.load, workspace);
    }

    /// Derivatives of the equations, `(lanes, n + m, columns)`, and the matrices `[M A^T; A 0]`, at the states whose accelerations were found last.
    /// `unconstrained`, `(lanes, n, columns)`, are the derivatives without constraint forces.
    pub fn slopes(&mut self, values: &[f64], [q, v, a]: [&[f64]; 3], unconstrained: &[f64]) -> (&[f64], &[f64]) {
        let (n, m) = self.size;
        let lanes = q.len() / n;
        let columns = unconstrained.len() / q.len().max(1);
        self.by_state.resize(lanes * (n + m) * columns, 0.0);
        let lambda: Vec<f64> = self.load.iter().map(|load| -load).collect();
        let _ = self.slopes.evaluate(lanes, &[q, v, a, &lambda], values, &mut [&mut self.by_state]);
        let blocks = self.by_state.chunks_exact_mut((n + m) * columns).zip(unconstrained.chunks_exact(n * columns));
        blocks.for_each(|(whole, own)| whole.iter_mut().zip(own).for_each(|(x, own)| *x += own));
        (&self.by_state, self.bordered.matrices())
    }

    /// Accelerations by a unit force on each coordinate at the states whose accelerations were found last, `(lanes, n, n)`.
    pub fn mobility(&self) -> Vec<f64> {
        let (n, m) = self.size;
        let k = n + m;
        let mut inverse = vec![0.0; self.bordered.matrices().len()];
        // Lanes that fail are NaN.
        let _ = linalg::inverse(k, self.bordered.matrices(), &mut inverse, &mut Workspace::new());
        inverse
            .chunks_exact(k * k)
            .flat_map(|inverse| inverse.chunks_exact(k).take(n).flat_map(|row| &row[..n]))
            .copied()
            .collect()
    }
}

/// Projects forces to the part that constraint forces cannot balance, at states with rows `A`, `(states, m, n)`. Forces on the coordinates are
/// compared in the given units, `(n)`.
#[derive(Clone, Copy)]
pub(super) struct FreePart<'a> {
    pub rows: &'a [f64],
    pub constraints: usize,
    pub units: &'a [f64],
}

impl FreePart<'_> {
    /// An orthonormal basis of the constraint forces at a state, in the units.
    fn carried(&self, state: usize) -> Vec<f64> {
        let n = self.units.len();
        let size = self.constraints * n;
        let rows = self.rows[state * size..(state + 1) * size].iter().zip(self.units.iter().cycle());
        independent_rows(n, &rows.map(|(a, unit)| a / unit).collect::<Vec<_>>()).1
    }

    /// Removes the part of the forces on one state that its constraints balance.
    fn project(&self, carried: &[f64], force: &mut [f64]) {
        force.iter_mut().zip(self.units).for_each(|(force, unit)| *force /= unit);
        let size = dot(force, force).sqrt();
        take_out(force, carried);
        let rounded = |x: f64| if x.abs() <= FORCE_ROUNDING * size { 0.0 } else { x };
        force.iter_mut().zip(self.units).for_each(|(force, unit)| *force = rounded(*force) * unit);
    }

    /// Projects the forces of all states, with several numbers for every coordinate, `(states, n, numbers)`.
    pub fn project_all(&self, forces: &mut [f64], numbers: usize) {
        let n = self.units.len();
        let mut column = vec![0.0; n];
        for (state, block) in forces.chunks_exact_mut(n * numbers).enumerate() {
            let carried = self.carried(state);
            for k in 0..numbers {
                (0..n).for_each(|i| column[i] = block[i * numbers + k]);
                self.project(&carried, &mut column);
                (0..n).for_each(|i| block[i * numbers + k] = column[i]);
            }
        }
    }

    /// Standard deviations of the projected forces at one state, `(n)`, for independent errors of accelerations and of forces.
    pub fn errors(&self, state: usize, mass: &[f64], (of_acceleration, of_force): (&[f64], &[f64])) -> Vec<f64> {
        let (n, carried) = (self.units.len(), self.carried(state));
        let mut squares = vec![0.0; n];
        let mut add = |mut effect: Vec<f64>| {
            self.project(&carried, &mut effect);
            squares.iter_mut().zip(&effect).for_each(|(square, x)| *square += x * x);
        };
        for k in 0..n {
            add((0..n).map(|i| mass[i * n + k] * of_acceleration[k]).collect());
            add((0..n).map(|i| if i == k { of_force[k] } else { 0.0 }).collect());
        }
        squares.into_iter().map(f64::sqrt).collect()
    }
}

/// Moves initial states within the constraints while the constants change.
pub(super) struct Mover<'a> {
    rows: &'a RowEquations,
    values: Vec<f64>,
    /// Changes of the constants.
    change: Vec<f64>,
    before: Box<dyn Manifold<f64>>,
    after: Box<dyn Manifold<f64>>,
}

impl DrivenEquations<'_> {
    /// Number of independent changes of an initial state.
    pub fn starts(&self) -> usize {
        self.equations.rows.as_ref().map_or(2 * self.equations.n, RowEquations::freedom)
    }

    /// Directions in which initial states can change within the constraints; empty for a system without constraints.
    pub(super) fn tangents(&self, values: &[f64], segments: &[&Segment]) -> Vec<Tangent> {
        let Some((rows, manifold)) = self.manifold(values) else { return Vec::new() };
        segments.iter().map(|segment| rows.tangent(&*manifold, values, &segment.start)).collect()
    }

    fn manifold(&self, values: &[f64]) -> Option<(&RowEquations, Box<dyn Manifold<f64>>)> {
        let rows = self.equations.rows.as_ref()?;
        // The number of values is that of the recorded constraints.
        Some((rows, Box::new(rows.manifold(values).ok()?)))
    }
}

impl Mover<'_> {
    /// Moves an initial state by a step along its free directions and with the changing constants, and projects it onto the constraints.
    fn advance(&self, start: &mut [f64], step: &[f64]) {
        let Tangent { free, following } = self.rows.tangent(&*self.before, &self.values, start);
        let directions =
            free.chunks_exact(start.len()).zip(step).chain(following.chunks_exact(start.len()).zip(&self.change));
        directions.for_each(|(direction, size)| start.iter_mut().zip(direction).for_each(|(x, d)| *x += size * d));
        project_start(&*self.after, start);
    }
}

/// Projects an initial state onto the constraints; if that fails, the state is unchanged.
fn project_start(manifold: &dyn Manifold<f64>, start: &mut [f64]) {
    let mut state = start.to_vec();
    let (q, v) = state.split_at_mut(start.len() / 2);
    if project(manifold, q, v).is_ok() {
        start.copy_from_slice(&state);
    }
}

/// Distance of smoothed positions from a constraint.
struct Distance {
    name: String,
    /// Root mean squares across the constraint: the distance, the noise of the positions, their spread.
    distance: f64,
    noise: f64,
    size: f64,
    /// `true` if the constraint depends on an unknown constant.
    open: bool,
}

impl Problem<'_> {
    /// Moves initial states while the unknowns change from `x` to `moved`; `None` without constraints.
    pub(super) fn mover(&self, x: &[f64], moved: &[f64]) -> Option<Mover<'_>> {
        let values = self.parameters(x);
        let (rows, before) = self.driven.manifold(&values)?;
        let (_, after) = self.driven.manifold(&self.parameters(moved))?;
        let change = x.iter().zip(moved).take(self.chosen.len()).map(|(x, moved)| moved - x).collect();
        Some(Mover { rows, values, change, before, after })
    }

    /// Projects the initial states of segments onto the constraints.
    pub(super) fn project_starts(&self, x: &[f64], segments: &mut [Segment]) {
        if let Some((_, manifold)) = self.driven.manifold(&self.parameters(x)) {
            segments.iter_mut().for_each(|segment| project_start(&*manifold, &mut segment.start));
        }
    }

    /// Projects states `(q, v)` onto the constraints; those that cannot be projected become `NaN`.
    pub(super) fn project_states(&self, x: &[f64], (q, v): (&mut [f64], &mut [f64])) {
        let (n, found) = (self.driven.equations.n, self.driven.manifold(&self.parameters(x)));
        let Some((_, manifold)) = found else { return };
        for (q, v) in q.chunks_exact_mut(n).zip(v.chunks_exact_mut(n)) {
            if project(&*manifold, q, v).is_err() {
                q.fill(f64::NAN);
            }
        }
    }

    /// The constraints from which smoothed states `(q, v)` are farther than their errors allow, with constants `x`.
    fn distances(&self, x: &[f64], (q, v): (&[f64], &[f64])) -> Vec<Distance> {
        let (n, values) = (self.driven.equations.n, self.parameters(x));
        let Some((rows, manifold)) = self.driven.manifold(&values) else { return Vec::new() };
        let m = rows.names.len();
        let (mut squares, mut open, mut count) = (vec![[0.0; 3]; m], vec![false; m], 0.0);
        let mut found = ManifoldRows::default();
        for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
            manifold.rows(q, v, &mut found);
            let gradients = found.matrix.chunks_exact(n);
            for ((sums, gradient), missed) in squares.iter_mut().zip(gradients).zip(&found.values) {
                let across =
                    |sizes: &[f64]| gradient.iter().zip(sizes).map(|(a, size)| (a * size).powi(2)).sum::<f64>();
                let length = dot(gradient, gradient);
                let all = [missed * missed, across(&self.sigma), across(&self.spread)];
                sums.iter_mut().zip(all).for_each(|(sum, x)| *sum += if length > 0.0 { x / length } else { 0.0 });
            }
            for (at, by) in rows.by_parameters(&values, (q, v)).chunks_exact(2).enumerate() {
                open[at % m] |= by != [0.0; 2];
            }
            count += 1.0;
        }
        let of = |(row, (sums, open)): (usize, ([f64; 3], bool))| {
            let [distance, noise, size] = sums.map(|sum| (sum / f64::max(count, 1.0)).sqrt());
            Distance { name: rows.names[row].clone(), distance, noise, size, open }
        };
        let all = squares.into_iter().zip(open).enumerate().map(of);
        all.filter(|of| of.distance > f64::max(OBEDIENCE.0 * of.noise, OBEDIENCE.1 * of.size)).collect()
    }

    /// Rejects smoothed positions that are off a constraint, unless the constraint depends on an unknown constant.
    ///
    /// # Errors
    /// [`IdentifyError::OffConstraint`].
    pub(super) fn require_constraints(&self, x: &[f64], states: (&[f64], &[f64])) -> Result<(), IdentifyError> {
        let off = self.distances(x, states).into_iter().find(|distance| !distance.open);
        off.map_or(Ok(()), |Distance { name: constraint, distance, noise, .. }| {
            Err(IdentifyError::OffConstraint { constraint, distance, noise })
        })
    }

    /// Creates messages about constraints that the smoothed positions do not satisfy with the identified constants.
    pub(super) fn off_constraints(&self, x: &[f64], states: (&[f64], &[f64])) -> Vec<String> {
        let message = |Distance { name, distance, noise, .. }: Distance| {
            let [distance, noise] = [distance, noise].map(|x| rounded(x, 3));
            format!(
                "the positions are {distance} (root mean square) off the constraint `{name}`; their noise is {noise}"
            )
        };
        self.distances(x, states).into_iter().map(message).collect()
    }

    /// The unknown constants on which constraints depend, tested at recorded states `(q, v)`.
    pub(super) fn moves_constraints(&self, x: &[f64], (q, v): (&[f64], &[f64])) -> Vec<usize> {
        let (n, values) = (self.driven.equations.n, self.parameters(x));
        let Some(rows) = &self.driven.equations.rows else { return Vec::new() };
        let mut moves = vec![false; self.chosen.len()];
        let states = q.chunks_exact(n).zip(v.chunks_exact(n));
        for state in states.step_by((q.len() / n).div_ceil(LANES).max(1)) {
            let by = rows.by_parameters(&values, state);
            let of = |by: &[f64]| by.iter().any(|by| *by != 0.0);
            moves.iter_mut().zip(by.chunks_exact(2 * rows.names.len())).for_each(|(moves, by)| *moves |= of(by));
        }
        (0..moves.len()).filter(|&k| moves[k]).collect()
    }
}

/// Moves an initial state by a step, within the constraints if there are any.
pub(super) fn advance(mover: Option<&Mover<'_>>, start: &mut [f64], step: &[f64]) {
    match mover {
        Some(mover) => mover.advance(start, step),
        None => start.iter_mut().zip(step).for_each(|(s, d)| *s += d),
    }
}
