//! Accelerations of a chunk of states and their vector-Jacobian product: the equation of motion of shooting.
//!
//! `M a = g - c - dD/dv + Q` in scaled coordinates, `D` the dissipation and `Q` known external forces. They enter in two
//! places of this file and nowhere else: [`Motion::accelerate`] adds them, [`Motion::pull_back`] takes `lam = M^-1 u`
//! through what `D` depends on.

use crate::linalg::{Workspace, solve};
use crate::network::{Adjoint, Architecture, Chunk, Depth, Dissipation, Jets};
use crate::scalar::{Real, Scalar};
use crate::training::penalty::Penalty;
use crate::training::signature::{
    Buffers, Violation, characteristic_scales, eigenvalue_violation, sylvester_violation,
};

/// The equation of motion on a chunk of states; buffers are reused from call to call.
pub(super) struct Motion<S> {
    architecture: Architecture,
    chunk: Chunk<S>,
    adjoint: Adjoint<S>,
    dissipation: Option<Dissipation<S>>,
    jets: Jets<S>,
    scale: Vec<S>,
    /// Physical states.
    q: Vec<S>,
    v: Vec<S>,
    right: Vec<S>,
    solution: Vec<S>,
    workspace: Workspace<S>,
    signature: Buffers<S>,
    violation: Violation<S>,
}

impl<S: Scalar> Motion<S> {
    pub fn new(architecture: &Architecture) -> Self {
        let chunk = Chunk::new(architecture);
        Self {
            architecture: architecture.clone(),
            adjoint: Adjoint::new(&chunk),
            dissipation: Dissipation::new(&chunk),
            chunk,
            jets: Jets::default(),
            scale: architecture.scale.iter().map(|&s| S::of_f64(s)).collect(),
            q: Vec::new(),
            v: Vec::new(),
            right: Vec::new(),
            solution: Vec::new(),
            workspace: Workspace::new(),
            signature: Buffers::default(),
            violation: Violation::default(),
        }
    }

    /// Evaluates the network at scaled states, `(states, n)`; angles are reduced to one turn first.
    pub fn evaluate(&mut self, weights: &[S], q: &[S], v: &[S], depth: Depth) {
        let n = self.scale.len();
        self.q.clear();
        self.v.clear();
        for (k, (&q, &v)) in q.iter().zip(v).enumerate() {
            let scale = self.scale[k % n];
            let q = q * scale;
            self.q.push(if self.architecture.periodic[k % n] { q.wrap_angle() } else { q });
            self.v.push(v * scale);
        }
        self.chunk.evaluate(weights, &self.q, &self.v, depth);
        if let Some(dissipation) = &mut self.dissipation {
            dissipation.evaluate(&self.chunk, weights);
        }
    }

    /// Accelerations `M^-1 (g - c - dD/dv + Q)` of the states evaluated last under scaled external forces, `(states, n)` or empty.
    ///
    /// A state without one is no longer alive; the acceleration of those that are not is 0.
    pub fn accelerate(&mut self, external: &[S], alive: &mut [bool], acceleration: &mut [S]) {
        let n = self.scale.len();
        self.right.clear();
        self.right.extend(self.chunk.dl_dq.iter().zip(&self.chunk.coriolis).map(|(&g, &c)| g - c));
        for (right, &force) in self.right.iter_mut().zip(external) {
            *right += force;
        }
        if let Some(dissipation) = &self.dissipation {
            self.right.iter_mut().zip(&dissipation.gradient).for_each(|(right, &force)| *right -= force);
        }
        // Failed rows are `NaN` and looked for below.
        let _ = solve(n, &self.chunk.mass_matrix, &self.right, acceleration, &mut self.workspace);
        for (alive, a) in alive.iter_mut().zip(acceleration.chunks_exact_mut(n)) {
            *alive &= a.iter().all(|a| a.is_finite());
            if !*alive {
                a.fill(<S as Real>::zero());
            }
        }
    }

    /// Adds `u da/dtheta` to `gradient` and the derivatives of `u a` by the scaled state to `dq`, `dv`, over the states that
    /// are alive; evaluated to [`Depth::Training`] before. `a` are their accelerations.
    pub fn pull_back(
        &mut self,
        weights: &[S],
        (a, u): (&[S], &[S]),
        alive: &[bool],
        gradient: &mut [S],
        (dq, dv): (&mut [S], &mut [S]),
    ) {
        let n = self.scale.len();
        self.solution.resize(u.len(), <S as Real>::zero());
        // Matrices that failed belong to states that are not alive.
        let _ = solve(n, &self.chunk.mass_matrix, u, &mut self.solution, &mut self.workspace);
        self.jets.clear(true);
        for (state, _) in alive.iter().enumerate().filter(|(_, alive)| **alive) {
            let range = state * n..(state + 1) * n;
            self.jets.state.push(state);
            self.jets.s.extend(self.solution[range.clone()].iter().map(|&lambda| -lambda));
            self.jets.t.extend_from_slice(&a[range]);
        }
        self.adjoint.add_gradient_and_inputs(&self.chunk, weights, &self.jets, gradient, (&mut *dq, &mut *dv));
        if let Some(dissipation) = &mut self.dissipation {
            let Jets { state, s, .. } = &self.jets;
            dissipation.add_gradient(&self.chunk, weights, state, s, gradient);
            dissipation.add_input_gradient(&self.chunk, weights, state, s, (dq, dv));
        }
    }

    /// Value of `lambda` times the sum of the states' violations and how many violate; adds its gradient by the weights.
    ///
    /// The states are taken as given: the data decide them, not the penalty. Sylvester's scales are those of this chunk.
    pub fn add_penalty(
        &mut self,
        weights: &[S],
        (penalty, lambda): (Penalty, S),
        alive: &[bool],
        gradient: &mut [S],
    ) -> (S, usize) {
        let n = self.scale.len();
        let matrices = &self.chunk.mass_matrix;
        let scales = match penalty {
            Penalty::None => return (<S as Real>::zero(), 0),
            Penalty::Eigenvalue { .. } => Vec::new(),
            Penalty::Sylvester { .. } => {
                let chosen = matrices.chunks_exact(n * n).zip(alive).filter(|(_, alive)| **alive);
                let diagonals: Vec<S> = chosen.flat_map(|(m, _)| m.iter().step_by(n + 1).copied()).collect();
                characteristic_scales(n, &diagonals)
            }
        };
        let (mut total, mut count) = (<S as Real>::zero(), 0);
        self.jets.clear(false);
        for (state, matrix) in matrices.chunks_exact(n * n).enumerate().filter(|(state, _)| alive[*state]) {
            let (signature, found) = (&mut self.signature, &mut self.violation);
            let outcome = match penalty {
                Penalty::Sylvester { time, .. } => sylvester_violation(n, matrix, &scales, time, signature, found),
                _ => eigenvalue_violation(n, matrix, signature, found),
            };
            if outcome.is_err() || found.gamma.is_empty() {
                continue;
            }
            total += lambda * found.value;
            count += 1;
            for (&gamma, u) in found.gamma.iter().zip(found.vectors.chunks_exact(n)) {
                self.jets.state.push(state);
                self.jets.s.extend(u.iter().map(|&u| lambda * gamma * u));
                self.jets.t.extend_from_slice(u);
            }
        }
        self.adjoint.add_gradient(&self.chunk, weights, &self.jets, gradient);
        (total, count)
    }
}
