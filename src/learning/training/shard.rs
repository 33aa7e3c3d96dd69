//! Residuals and gradients of a part of a batch.
//!
//! Accelerations solve `M a = g - c - dD/dv + Q` with the network's dissipation `D` and the data's known forces `Q`, if there are any. A
//! loss `l(a)` depends on the parameters of `D` by `dl = -lam.d(dD/dv)`, `lam = M^-1 dl/da`; for those of `L`, the formula without friction
//! applies, with the `a` that includes friction.
//!
//! States may instead have [residuals of force](Dataset::with_force_residuals) `r = M a + c - g + dD/dv - Q` at the accelerations of the
//! data: a loss `l(r)` has the gradient of one on accelerations with `lam = -dl/dr` and this `a`, and no linear system is solved. Under
//! constraints, only the part of `r` counts that no force `A^T lambda` explains.
//!
//! Under constraints, rows `A` of the data, they solve `[M A^T; A 0] [a; -lambda] = [g - c + Q; -gamma]`. With the same matrix and `[lam;
//! nu]` for `[dl/da; 0]` the gradient is that without constraints, at this `lam` and this `a`: `A lam = 0`. Every penalty acts on the
//! eigenvalues of `Z^T M Z`, where `Z` is a basis of the null space of `A`: motion does not determine the mass matrix across it.

use crate::configuration::Penalty;
use crate::data::Dataset;
use crate::lagrangian::{MechanicsError, take_out};
use crate::linalg::{SignatureBuffers as Buffers, Violation, Workspace, solve};
use crate::network::{Dynamics, Model};
use crate::scalar::{Real, Scalar, Sum};
use crate::tape::{Depth, MixedDirections};
use crate::training::constrained_motion::ConstrainedMotion;
use crate::training::violations::Violations;

/// A contiguous part of a batch with its own buffers.
pub(super) struct Shard<S> {
    dynamics: Dynamics<S>,
    directions: MixedDirections<S>,
    pub(super) violations: Violations<S>,
    pub(super) gradient: Vec<S>,
    q: Vec<S>,
    v: Vec<S>,
    acceleration: Vec<S>,
    right: Vec<S>,
    multiplier: Vec<S>,
    workspace: Workspace<S>,
    signature: Buffers<S>,
    violation: Violation<S>,
    held: ConstrainedMotion<S>,
    /// `|M_ii|` of every state, `(states, n)`, and the states whose signature may be wrong, with their matrices.
    pub(super) diagonal: Vec<S>,
    pub(super) suspects: Vec<usize>,
    suspect_matrices: Vec<S>,
    scale: Vec<S>,
    pub(super) residual: Sum<S>,
    pub(super) left_out: usize,
    pub(super) failure: Option<MechanicsError>,
}

impl<S: Scalar> Shard<S> {
    pub(super) fn new(model: &Model<S>) -> Self {
        Self {
            dynamics: Dynamics::new(model),
            directions: MixedDirections::default(),
            violations: Violations::new(model),
            gradient: Vec::new(),
            q: Vec::new(),
            v: Vec::new(),
            acceleration: Vec::new(),
            right: Vec::new(),
            multiplier: Vec::new(),
            workspace: Workspace::new(),
            signature: Buffers::default(),
            violation: Violation::default(),
            held: ConstrainedMotion::default(),
            diagonal: Vec::new(),
            suspects: Vec::new(),
            suspect_matrices: Vec::new(),
            scale: model.scale().to_vec(),
            residual: Sum::default(),
            left_out: 0,
            failure: None,
        }
    }

    pub(super) fn reset(&mut self, parameters: usize) {
        self.gradient.clear();
        self.gradient.resize(parameters, <S as Real>::zero());
        self.residual = Sum::default();
        (self.left_out, self.failure) = (0, None);
        self.violations.reset();
        self.diagonal.clear();
        self.suspects.clear();
        self.suspect_matrices.clear();
    }

    /// Gathers the states of these rows.
    fn gather(&mut self, data: &Dataset<S>, rows: &[u32]) {
        let n = data.coordinates();
        self.q.clear();
        self.v.clear();
        for &row in rows {
            let range = row as usize * n..(row as usize + 1) * n;
            self.q.extend_from_slice(&data.q()[range.clone()]);
            self.v.extend_from_slice(&data.v()[range]);
        }
    }

    /// Loss and gradient of one chunk, with its penalty; if the penalty needs scales, stores its inputs for all states instead.
    ///
    /// `weight` is `1/(2 n counted)`, where `counted` is the number of states of the batch that count; the penalty has its weight over the
    /// batch.
    pub(super) fn add_chunk(
        &mut self,
        weights: &[S],
        data: &Dataset<S>,
        rows: &[u32],
        weight: S,
        penalty: (Penalty, S),
    ) {
        self.gather(data, rows);
        self.dynamics.evaluate(weights, &self.q, &self.v, Depth::Training, true);
        self.add_residuals(data, rows, weight);
        let (penalty, lambda) = penalty;
        match penalty {
            Penalty::None => {}
            _ if data.constraints() > 0 => self.add_reduced_eigenvalue(lambda),
            _ if penalty.needs_scales() => self.note_suspects(penalty),
            _ => self.add_violations(penalty, lambda),
        }
        // Zero directions exclude the failed states.
        if self.add_directions(data) || self.replace_failed(weights) {
            self.dynamics.add_gradient(weights, &self.directions, &mut self.gradient, None);
        }
        self.violations.add_gradient(weights, false, &mut self.gradient);
    }

    /// Evaluates the chunk again after replacing states without an acceleration by valid ones; `true` if there is a valid state.
    fn replace_failed(&mut self, weights: &[S]) -> bool {
        let n = self.scale.len();
        let failed = |row: &[S]| row[0].is_nan();
        let Some(good) = self.acceleration.chunks_exact(n).position(|row| !failed(row)) else { return false };
        for (state, row) in self.acceleration.chunks_exact(n).enumerate() {
            if failed(row) {
                self.q.copy_within(good * n..(good + 1) * n, state * n);
                self.v.copy_within(good * n..(good + 1) * n, state * n);
            }
        }
        self.dynamics.evaluate(weights, &self.q, &self.v, Depth::Training, true);
        true
    }

    /// Stores the diagonals of the chunk's mass matrices, and the states whose signature may be wrong.
    fn note_suspects(&mut self, penalty: Penalty) {
        let n = self.scale.len();
        for matrix in self.dynamics.lagrangian().mass_matrix.chunks_exact(n * n) {
            if !penalty.allows(n, matrix, &mut self.signature) {
                self.suspects.push(self.diagonal.len() / n);
                self.suspect_matrices.extend_from_slice(matrix);
            }
            self.diagonal.extend(matrix.iter().step_by(n + 1).map(|&m| Real::abs(m)));
        }
    }

    /// Adds the penalty of these states and its gradient, using the scales of the whole batch.
    pub(super) fn add_suspects(
        &mut self,
        weights: &[S],
        data: &Dataset<S>,
        rows: &[u32],
        scales: &[S],
        (penalty, lambda): (Penalty, S),
    ) {
        let n = self.scale.len();
        for (&state, matrix) in self.suspects.iter().zip(self.suspect_matrices.chunks_exact(n * n)) {
            let outcome = penalty.violation(n, matrix, scales, &mut self.signature, &mut self.violation);
            if outcome.is_ok() {
                let range = rows[state] as usize * n..(rows[state] as usize + 1) * n;
                self.violations.push((&data.q()[range.clone()], &data.v()[range]), &self.violation, lambda);
            }
        }
        self.violations.add_gradient(weights, true, &mut self.gradient);
    }

    /// Adds the losses of one chunk without gradient.
    pub(super) fn add_losses(&mut self, weights: &[S], data: &Dataset<S>, rows: &[u32]) {
        self.gather(data, rows);
        self.dynamics.evaluate(weights, &self.q, &self.v, Depth::Motion, true);
        self.add_residuals(data, rows, <S as Real>::one());
    }

    /// Solves for the scaled accelerations of the chunk; `NaN` for a state that fails, whose row is recorded.
    fn solve(&mut self, data: &Dataset<S>, rows: &[u32]) {
        let n = self.scale.len();
        self.dynamics.right_hand_sides(&mut self.right);
        if !data.force().is_empty() {
            self.add_forces(data, rows);
        }
        self.acceleration.resize(self.right.len(), <S as Real>::zero());
        if data.constraints() > 0 {
            self.hold(data, rows);
        }
        if self.solve_motion(n, data.constraints(), true) {
            return;
        }
        for &(state, failure) in self.workspace.failures() {
            let row = rows[state] as usize;
            self.left_out += 1;
            self.failure.get_or_insert(MechanicsError::unsolved(row, failure));
        }
    }

    /// Loads the constraints of the chunk.
    fn hold(&mut self, data: &Dataset<S>, rows: &[u32]) {
        self.held.clear((data.coordinates(), data.constraints()));
        for &row in rows {
            self.held.push(&self.scale, data.constraint(row as usize));
        }
    }

    /// Solves the linear systems with right-hand side `right`: for the accelerations if `motion`, otherwise for the multipliers of the
    /// loss, with `A x = 0`; `true` if no state failed.
    fn solve_motion(&mut self, n: usize, m: usize, motion: bool) -> bool {
        let Self { held, right, workspace, .. } = self;
        let solution = if motion { &mut self.acceleration } else { &mut self.multiplier };
        let masses = &self.dynamics.lagrangian().mass_matrix;
        match (m, motion) {
            (0, _) => solve(n, masses, right, solution, workspace).is_ok(),
            (_, true) => {
                held.border(masses);
                held.motion(right, solution, workspace)
            }
            (_, false) => held.adjoint(right, solution, workspace),
        }
    }

    /// Adds the known forces, in scaled coordinates `s_i Q_i`, to the right-hand sides.
    fn add_forces(&mut self, data: &Dataset<S>, rows: &[u32]) {
        let n = data.coordinates();
        for (right, &row) in self.right.chunks_exact_mut(n).zip(rows) {
            let force = &data.force()[row as usize * n..][..n];
            for ((right, &force), &scale) in right.iter_mut().zip(force).zip(&self.scale) {
                *right += force * scale;
            }
        }
    }

    /// Computes absolute residuals of the states, and the input of [`add_directions`](Self::add_directions).
    fn add_residuals(&mut self, data: &Dataset<S>, rows: &[u32], weight: S) {
        if data.force_scale().is_empty() {
            self.solve(data, rows);
            self.add_acceleration_residuals(data, rows, weight);
        } else {
            self.add_force_residuals(data, rows, weight);
        }
    }

    /// Computes absolute residuals of the forces, each divided by its scale. Stores `dl/dr`, with `l` weighted by `weight`, in `right`, and
    /// the scaled accelerations of the data, which are `NaN` where a residual is not finite.
    fn add_force_residuals(&mut self, data: &Dataset<S>, rows: &[u32], weight: S) {
        let (n, zero) = (data.coordinates(), <S as Real>::zero());
        self.dynamics.right_hand_sides(&mut self.right);
        self.add_forces(data, rows);
        self.acceleration.clear();
        for &row in rows {
            let a = &data.a()[row as usize * n..][..n];
            self.acceleration.extend(a.iter().zip(&self.scale).map(|(&a, &s)| a / s));
        }
        let held = data.constraints() > 0;
        if held {
            self.hold(data, rows);
        }
        let units: Vec<S> = data.force_scale().iter().zip(&self.scale).map(|(&size, &s)| (size * s).recip()).collect();
        let masses = self.dynamics.lagrangian().mass_matrix.chunks_exact(n * n);
        let states = self.acceleration.chunks_exact_mut(n).zip(self.right.chunks_exact_mut(n));
        for (state, ((&row, mass), (a, right))) in rows.iter().zip(masses).zip(states).enumerate() {
            for (right, mass) in right.iter_mut().zip(mass.chunks_exact(n)) {
                *right = mass.iter().zip(&*a).fold(-*right, |sum, (&m, &a)| sum + m * a);
            }
            if right.iter().any(|r| !r.is_finite()) {
                self.left_out += 1;
                self.failure.get_or_insert(MechanicsError::NotFinite { row: row as usize, what: "force" });
                a.fill(S::nan());
                right.fill(zero);
                continue;
            }
            // A force that the constraints can carry is removed from the residual, because motion does not determine it.
            let carried = if held { self.held.carried(state, &units) } else { Vec::new() };
            right.iter_mut().zip(&units).for_each(|(r, &unit)| *r *= unit);
            take_out(right, &carried);
            let own = data.weight(row as usize);
            for r in right.iter_mut() {
                self.residual.add(own * r.abs());
                *r = sign(*r) * own * weight;
            }
            take_out(right, &carried);
            right.iter_mut().zip(&units).for_each(|(r, &unit)| *r *= unit);
        }
    }

    /// Computes absolute residuals of the accelerations; stores `-dl/da`, with `l` weighted by `weight`, in `right`.
    fn add_acceleration_residuals(&mut self, data: &Dataset<S>, rows: &[u32], weight: S) {
        let n = data.coordinates();
        let zero = <S as Real>::zero();
        for (state, &row) in rows.iter().enumerate() {
            let range = state * n..(state + 1) * n;
            let a = &self.acceleration[range.clone()];
            let right = &mut self.right[range];
            if a[0].is_nan() {
                right.fill(zero);
                continue;
            }
            let target = &data.a()[row as usize * n..][..n];
            let own = data.weight(row as usize);
            let weight = own * weight;
            for i in 0..n {
                let residual = a[i] - target[i] / self.scale[i];
                self.residual.add(own * residual.abs());
                right[i] = sign(-residual) * weight;
            }
        }
    }

    /// Sets the directions of the loss: `s = -lam`, which is `-M^-1 dl/da` or `dl/dr`, and `t = a`; zeros for states without an
    /// acceleration. Returns whether all states have one.
    fn add_directions(&mut self, data: &Dataset<S>) -> bool {
        let n = self.scale.len();
        self.directions.clear(true);
        if data.force_scale().is_empty() {
            self.multiplier.resize(self.right.len(), <S as Real>::zero());
            // Rows whose matrices failed before are skipped.
            self.solve_motion(n, data.constraints(), false);
            self.directions.s.extend_from_slice(&self.multiplier);
        } else {
            self.directions.s.extend_from_slice(&self.right);
        }
        self.directions.t.extend_from_slice(&self.acceleration);
        let mut all = true;
        let MixedDirections { s, t, .. } = &mut self.directions;
        for (s, t) in s.chunks_exact_mut(n).zip(t.chunks_exact_mut(n)) {
            if t[0].is_nan() {
                all = false;
                s.fill(<S as Real>::zero());
                t.fill(<S as Real>::zero());
            }
        }
        all
    }

    /// Adds the eigenvalue penalties of the chunk within its constraints.
    fn add_reduced_eigenvalue(&mut self, lambda: S) {
        let n = self.scale.len();
        for (state, mass) in self.dynamics.lagrangian().mass_matrix.chunks_exact(n * n).enumerate() {
            self.held.violation(state, mass, &mut self.violation);
            let range = state * n..(state + 1) * n;
            self.violations.push((&self.q[range.clone()], &self.v[range]), &self.violation, lambda);
        }
    }

    /// Adds the violations of the chunk for a penalty without scales.
    fn add_violations(&mut self, penalty: Penalty, lambda: S) {
        let n = self.scale.len();
        for (state, matrix) in self.dynamics.lagrangian().mass_matrix.chunks_exact(n * n).enumerate() {
            if penalty.violation(n, matrix, &[], &mut self.signature, &mut self.violation).is_ok() {
                let range = state * n..(state + 1) * n;
                self.violations.push((&self.q[range.clone()], &self.v[range]), &self.violation, lambda);
            }
        }
    }
}

/// The sign of a number; 0 for zero.
fn sign<S: Scalar>(x: S) -> S {
    let zero = <S as Real>::zero();
    if x > zero {
        <S as Real>::one()
    } else if x < zero {
        -<S as Real>::one()
    } else {
        zero
    }
}
