//! Accelerations of a chunk of states and their vector-Jacobian product: the equation of motion of shooting.
//!
//! `M a = g - c - dD/dv + Q` in scaled coordinates, `D` the dissipation and `Q` known external forces. They enter in two
//! places of this file and nowhere else: [`Motion::accelerate`] adds them, [`Motion::pull_back`] takes `lam = M^-1 u`
//! through what `D` depends on.
//!
//! Under constraints `A a = -gamma` the motion has multipliers, `M a = g - c - dD/dv + Q + A^T lambda`; with `[lam; nu]` of the same matrix
//! a function `u.a` changes with the rows by `lambda.(dA lam) - nu.(dA a + dgamma)`.

use crate::configuration::Penalty;
use crate::lagrangian::{Manifold, ManifoldRows, RowAdjoint};
use crate::linalg::{SignatureBuffers as Buffers, Violation, characteristic_scales};
use crate::linalg::{Workspace, solve};
use crate::network::{Dynamics, Model};
use crate::scalar::{Real, Scalar};
use crate::tape::{Depth, MixedDirections};
use crate::training::constrained_motion::ConstrainedMotion;
use crate::training::violations::Violations;
use std::sync::Arc;

/// The equation of motion on a chunk of states; buffers are reused from call to call.
pub(super) struct Motion<S> {
    model: Model<S>,
    dynamics: Dynamics<S>,
    directions: MixedDirections<S>,
    violations: Violations<S>,
    scale: Vec<S>,
    /// Physical states.
    q: Vec<S>,
    v: Vec<S>,
    right: Vec<S>,
    solution: Vec<S>,
    workspace: Workspace<S>,
    signature: Buffers<S>,
    violation: Violation<S>,
    /// Constraints, if there are any, and their rows at the last evaluated states.
    manifold: Option<Arc<dyn Manifold<S>>>,
    held: ConstrainedMotion<S>,
    rows: ManifoldRows<S>,
    pull: Vec<S>,
}

impl<S: Scalar> Motion<S> {
    pub fn new(model: &Model<S>, manifold: Option<Arc<dyn Manifold<S>>>) -> Self {
        Self {
            model: model.clone(),
            dynamics: Dynamics::new(model),
            directions: MixedDirections::default(),
            violations: Violations::new(model),
            scale: model.scale().to_vec(),
            q: Vec::new(),
            v: Vec::new(),
            right: Vec::new(),
            solution: Vec::new(),
            workspace: Workspace::new(),
            signature: Buffers::default(),
            violation: Violation::default(),
            manifold,
            held: ConstrainedMotion::default(),
            rows: ManifoldRows::default(),
            pull: Vec::new(),
        }
    }

    /// Number of constraints.
    pub fn constraints(&self) -> usize {
        self.manifold.as_ref().map_or(0, |manifold| manifold.names().len())
    }

    /// Evaluates the model at scaled states, `(states, n)`; angles are reduced to one turn first.
    pub fn evaluate(&mut self, weights: &[S], q: &[S], v: &[S], depth: Depth) {
        let n = self.scale.len();
        self.q.clear();
        self.v.clear();
        self.q.extend(q.iter().enumerate().map(|(k, &q)| q * self.scale[k % n]));
        self.v.extend(v.iter().enumerate().map(|(k, &v)| v * self.scale[k % n]));
        self.model.wrap(&mut self.q);
        self.dynamics.evaluate(weights, &self.q, &self.v, depth, true);
        let Some(manifold) = &self.manifold else { return };
        self.held.clear((n, manifold.names().len()));
        for (q, v) in self.q.chunks_exact(n).zip(self.v.chunks_exact(n)) {
            manifold.rows(q, v, &mut self.rows);
            self.held.push(&self.scale, (&self.rows.matrix, &self.rows.drift));
        }
        self.held.border(&self.dynamics.lagrangian().mass_matrix);
    }

    /// Accelerations `M^-1 (g - c - dD/dv + Q)` of the states evaluated last under scaled external forces, `(states, n)` or empty, or
    /// those under the constraints; their multipliers `-lambda`, `(states, m)`, are appended to `loads`.
    ///
    /// A state without an acceleration is no longer alive; states that are not alive have the acceleration 0.
    pub fn accelerate(&mut self, external: &[S], alive: &mut [bool], acceleration: &mut [S], loads: &mut Vec<S>) {
        let n = self.scale.len();
        self.dynamics.right_hand_sides(&mut self.right);
        for (right, &force) in self.right.iter_mut().zip(external) {
            *right += force;
        }
        // Rows that fail are `NaN` and are handled below.
        if self.manifold.is_some() {
            self.held.motion(&self.right, acceleration, &mut self.workspace);
            self.held.loads(loads);
        } else {
            let _ = solve(n, &self.dynamics.lagrangian().mass_matrix, &self.right, acceleration, &mut self.workspace);
        }
        for (alive, a) in alive.iter_mut().zip(acceleration.chunks_exact_mut(n)) {
            *alive &= a.iter().all(|a| a.is_finite());
            if !*alive {
                a.fill(<S as Real>::zero());
            }
        }
    }

    /// Adds `u da/dtheta` to `gradient` and the derivatives of `u a` by the scaled state to `dq`, `dv`, over the states that are alive,
    /// after an evaluation to [`Depth::Training`]. `a` are their accelerations, `loads` their multipliers.
    pub fn pull_back(
        &mut self,
        weights: &[S],
        (a, u, loads): (&[S], &[S], &[S]),
        alive: &[bool],
        gradient: &mut [S],
        (dq, dv): (&mut [S], &mut [S]),
    ) {
        let n = self.scale.len();
        let Some(good) = alive.iter().position(|alive| *alive) else { return };
        self.solution.resize(u.len(), <S as Real>::zero());
        // Only states that are not alive have matrices that failed.
        if self.manifold.is_some() {
            self.held.adjoint(u, &mut self.solution, &mut self.workspace);
            self.pull.clear();
            self.held.loads(&mut self.pull);
            self.pull_back_rows((a, loads), alive, (dq, dv));
        } else {
            let _ = solve(n, &self.dynamics.lagrangian().mass_matrix, u, &mut self.solution, &mut self.workspace);
        }
        self.directions.clear(true);
        self.directions.s.extend(self.solution.iter().map(|&lambda| -lambda));
        self.directions.t.extend_from_slice(a);
        let mut replaced = false;
        for (state, _) in alive.iter().enumerate().filter(|(_, alive)| !**alive) {
            let range = state * n..(state + 1) * n;
            self.directions.s[range.clone()].fill(<S as Real>::zero());
            self.directions.t[range].fill(<S as Real>::zero());
            self.q.copy_within(good * n..(good + 1) * n, state * n);
            self.v.copy_within(good * n..(good + 1) * n, state * n);
            replaced = true;
        }
        if replaced {
            // Zero directions exclude the states that are not alive.
            self.dynamics.evaluate(weights, &self.q, &self.v, Depth::Training, true);
        }
        self.dynamics.add_gradient(weights, &self.directions, gradient, Some((dq, dv)));
    }

    /// Adds the changes of `u a` with the scaled state through the rows of the constraints, from the solution of
    /// [`pull_back`](Self::pull_back).
    fn pull_back_rows(&self, (a, loads): (&[S], &[S]), alive: &[bool], (dq, dv): (&mut [S], &mut [S])) {
        let Some(manifold) = &self.manifold else { return };
        let (n, m, zero) = (self.scale.len(), manifold.names().len(), <S as Real>::zero());
        for state in (0..alive.len()).filter(|&state| alive[state]) {
            let (at, of) = (state * n..(state + 1) * n, state * m..(state + 1) * m);
            let physical = |x: &[S]| -> Vec<S> { x.iter().zip(&self.scale).map(|(&x, &s)| x * s).collect() };
            let (x, a) = (physical(&self.solution[at.clone()]), physical(&a[at.clone()]));
            let load: Vec<S> = loads[of.clone()].iter().map(|&load| -load).collect();
            let adjoint = RowAdjoint { x: &x, a: &a, load: &load, pull: &self.pull[of] };
            let (mut by_q, mut by_v) = (vec![zero; n], vec![zero; n]);
            manifold.pull_back((&self.q[at.clone()], &self.v[at.clone()]), adjoint, (&mut by_q, &mut by_v));
            for (sum, by) in [(&mut *dq, by_q), (&mut *dv, by_v)] {
                sum[at.clone()].iter_mut().zip(physical(&by)).for_each(|(sum, by)| *sum += by);
            }
        }
    }

    /// Value of `lambda` times the sum of the states' violations and how many violate; adds its gradient by the weights.
    ///
    /// The states count as given: they depend on the data, not on the penalty. Characteristic scales are those of this chunk.
    pub fn add_penalty(
        &mut self,
        weights: &[S],
        (penalty, lambda): (Penalty, S),
        alive: &[bool],
        gradient: &mut [S],
    ) -> (S, usize) {
        let n = self.scale.len();
        let matrices = &self.dynamics.lagrangian().mass_matrix;
        if penalty == Penalty::None {
            return (<S as Real>::zero(), 0);
        }
        let scales = if penalty.needs_scales() && self.manifold.is_none() {
            let chosen = matrices.chunks_exact(n * n).zip(alive).filter(|(_, alive)| **alive);
            let diagonals: Vec<S> = chosen.flat_map(|(m, _)| m.iter().step_by(n + 1).copied()).collect();
            characteristic_scales(n, &diagonals)
        } else {
            Vec::new()
        };
        self.violations.reset();
        for (state, matrix) in matrices.chunks_exact(n * n).enumerate().filter(|(state, _)| alive[*state]) {
            let known = if self.manifold.is_some() {
                self.held.violation(state, matrix, &mut self.violation);
                true
            } else {
                penalty.violation(n, matrix, &scales, &mut self.signature, &mut self.violation).is_ok()
            };
            if known {
                let range = state * n..(state + 1) * n;
                self.violations.push((&self.q[range.clone()], &self.v[range]), &self.violation, lambda);
            }
        }
        self.violations.add_gradient(weights, true, gradient);
        (self.violations.penalty.value(), self.violations.count)
    }
}
