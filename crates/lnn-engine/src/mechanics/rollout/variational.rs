//! Variational integrator: discrete Euler-Lagrange equations of the midpoint discrete Lagrangian.
//!
//! `L_d(q0, q1) = h L((q0 + q1)/2, (q1 - q0)/h)` approximates the action of one step. The discrete Euler-Lagrange
//! equations `D2 L_d(q_{k-1}, q_k) + D1 L_d(q_k, q_{k+1}) = 0` are solved in position-momentum form,
//!
//! ```text
//! p0 = -D1 L_d(q0, q1) = dL/dv - h/2 dL/dq,    p1 = D2 L_d(q0, q1) = dL/dv + h/2 dL/dq.
//! ```
//!
//! The discrete action contains no friction, so models that lose energy are rejected. An external force acts at either end with half a step
//! times its value in the middle: `dL/dq + Q` replaces `dL/dq` (the discrete Lagrange-d'Alembert principle, 3.2.1 in the source). The
//! method has order 2 and is symplectic. In exact arithmetic the motion equals that of the implicit midpoint rule for Hamilton's equations,
//! but the derivation needs no Hamiltonian, and the two methods check each other.
//!
//! Source: Marsden and West, Discrete mechanics and variational integrators (2001), 1.3.1 and 2.3.1.

use super::StepFailure;
use super::phase::{Defect, Derivatives, PhasePoint, PhaseSpace};
use super::simplified_newton::{Equations, SimplifiedNewton, rounding};
use crate::scalar::{Real, Scalar};

/// The equations `p0 + D1 L_d(q0, q0 + h u) = 0` for the mean velocity `u`.
struct Discrete<'a, S> {
    state: &'a PhasePoint<S>,
    half_step: S,
    /// Midpoint, and `dL/dv` and `dL/dq` at the midpoint.
    q: &'a mut [S],
    p: &'a mut [S],
    g: &'a mut [S],
    derivatives: &'a mut Derivatives<S>,
}

impl<S: Scalar> Discrete<'_, S> {
    fn move_to(&mut self, u: &[S]) {
        let q = &self.state.q;
        for (k, (middle, &u)) in self.q.iter_mut().zip(u).enumerate() {
            *middle = q.high[k] + (q.low[k] + self.half_step * u);
        }
    }
}

impl<S: Scalar> Equations<S> for Discrete<'_, S> {
    fn residual(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        x: &[S],
        residual: &mut [S],
    ) -> Result<Defect<S>, StepFailure> {
        self.move_to(x);
        phase.momenta_and_forces(self.q, x, &[self.half_step], (self.p, self.g))?;
        let p0 = &self.state.p;
        for (k, r) in residual.iter_mut().enumerate() {
            *r = (self.p[k] - p0.high[k]) - (p0.low[k] + self.half_step * self.g[k]);
        }
        let size = |k: usize| p0.high[k].abs() + self.p[k].abs() + (self.half_step * self.g[k]).abs();
        Ok(Defect::of(phase.n, residual, size))
    }

    /// Computes `M + h/2 (B - B^T - C) - h^2/4 K`, with `B = dp/dq`, `K = dg/dq`, `C = dQ/dv`.
    fn jacobian(&mut self, phase: &mut PhaseSpace<'_, S>, x: &[S], matrix: &mut [S]) -> Result<(), StepFailure> {
        let n = phase.n;
        self.move_to(x);
        phase.derivatives(self.q, x, self.half_step, self.derivatives)?;
        let Derivatives { mass, mixed, stiffness, damping } = &*self.derivatives;
        let (linear, square) = (self.half_step, self.half_step * self.half_step);
        for r in 0..n {
            for c in 0..n {
                let at = r * n + c;
                let along_v = (mixed[at] - mixed[c * n + r]) - damping[at];
                matrix[at] = mass[at] + linear * along_v - square * stiffness[at];
            }
        }
        Ok(())
    }

    fn rounding(&self, _: usize, x: &[S], i: usize) -> S {
        rounding(&self.state.q.high, self.half_step.ldexp(1), x, i)
    }
}

/// The integrator with the data stored from step to step.
#[derive(Clone, Debug)]
pub(super) struct Variational<S> {
    chord: SimplifiedNewton<S>,
    h: S,
    /// Mean velocities of the last two steps of this size.
    past: [Vec<S>; 2],
    known: usize,
    u: Vec<S>,
    q: Vec<S>,
    p: Vec<S>,
    g: Vec<S>,
    derivatives: Derivatives<S>,
}

impl<S: Scalar> Variational<S> {
    /// Creates the integrator for `n` coordinates.
    pub(super) fn new(n: usize) -> Self {
        let zero = <S as Real>::zero();
        let vector = vec![zero; n];
        Self {
            chord: SimplifiedNewton::new(n),
            h: zero,
            past: [vector.clone(), vector.clone()],
            known: 0,
            u: vector.clone(),
            q: vector.clone(),
            p: vector.clone(),
            g: vector,
            derivatives: Derivatives::default(),
        }
    }

    /// Computes one step of size `h`; `velocity` must be close to the velocity at the start, and afterwards is close to that at the end.
    pub(super) fn step(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        state: &mut PhasePoint<S>,
        velocity: &mut [S],
        h: S,
    ) -> Result<(), StepFailure> {
        if h != self.h {
            (self.h, self.known) = (h, 0);
            self.chord.forget();
        }
        self.u.copy_from_slice(velocity);
        if self.known == 2 {
            for (u, (&last, &before)) in self.u.iter_mut().zip(self.past[1].iter().zip(&self.past[0])) {
                *u = last + (last - before);
            }
        }
        if let Err(failure) = self.solve(phase, state) {
            if self.known < 2 {
                return Err(failure);
            }
            self.known = 0;
            self.chord.forget();
            self.u.copy_from_slice(velocity);
            self.solve(phase, state)?;
        }
        for k in 0..phase.n {
            state.q.add(k, h * self.u[k]);
            // dL/dv = p0 + h/2 dL/dq at the solution; this increment avoids the rounding errors of dL/dv.
            state.p.add(k, h * self.g[k]);
        }
        velocity.copy_from_slice(&self.u);
        self.past.swap(0, 1);
        self.past[1].copy_from_slice(&self.u);
        self.known = (self.known + 1).min(2);
        Ok(())
    }

    /// Returns the midpoint and the mean velocity of the last step.
    pub(super) fn stages(&self) -> (&[S], &[S]) {
        (&self.q, &self.u)
    }

    fn solve(&mut self, phase: &mut PhaseSpace<'_, S>, state: &PhasePoint<S>) -> Result<(), StepFailure> {
        let Self { chord, h, u, q, p, g, derivatives, .. } = self;
        chord.solve(phase, &mut Discrete { state, half_step: *h * S::half(), q, p, g, derivatives }, u)
    }
}
