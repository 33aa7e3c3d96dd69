//! Gauss collocation for Hamilton's equations: implicit midpoint (order 2), two stages (order 4), three stages (order 6).
//!
//! In `(q, p)` these methods are symplectic for every regular Lagrangian, separable or not, and their energy does not drift in theory. On
//! `(q, v)` they are only symmetric. Measured over T = 10,000 with order 4, h = 0.1 and 0.05, the energy error is bounded in both cases:
//! 2.8e-4 and 1.4e-5 for the double pendulum in either; for a Lagrangian with magnetic terms 3.7e-6 and 2.4e-7 on `(q, v)`, 2.4e-6 and
//! 1.5e-7 on `(q, p)`. The second form is used because its behaviour is proven, and because a stage then only needs `p` and `dL/dq`, not
//! the acceleration. It needs no Hamiltonian either: with stage velocities `V_i` as the unknowns, `Q_i = q + h sum_j a_ij V_j`, and
//!
//! ```text
//! dL/dv(Q_i, V_i) = p + h sum_j a_ij dL/dq(Q_j, V_j).
//! ```
//!
//! Source: Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), II.1.3 and VI.4. The coefficients are stored as `a_ij = m_ij
//! b_j` with `m_ij + m_ji = 1` exactly in floating point, so that rounding them preserves symplecticity (Antonana, Makazaga and Murua
//! 2017). Friction and external forces, `Q`, add to `dL/dq`: the order is kept, but there is no symplectic form to preserve.

use super::StepFailure;
use super::phase::{Defect, Derivatives, PhasePoint, PhaseSpace};
use super::simplified_newton::{Equations, SimplifiedNewton, rounding};
use crate::scalar::{Real, Scalar};

/// Nodes `c`, weights `b`, and `m_ij = a_ij / b_j`, row-major.
#[derive(Clone, Debug)]
pub(super) struct Tableau<S> {
    pub(super) nodes: Vec<S>,
    pub(super) weights: Vec<S>,
    pub(super) ratios: Vec<S>,
}

impl<S: Scalar> Tableau<S> {
    pub(super) fn new(stages: usize) -> Self {
        let number = S::of_f64;
        let (half, one) = (<S as Real>::half(), <S as Real>::one());
        // Below the diagonal m = 1/2 + x, and above it the exact complement.
        let (nodes, weights, below): (Vec<S>, Vec<S>, Vec<S>) = match stages {
            1 => (vec![half], vec![one], vec![]),
            2 => {
                let x = number(3.0).sqrt() / number(6.0);
                (vec![half - x, half + x], vec![half; 2], vec![half + x + x])
            }
            _ => {
                let root = number(15.0).sqrt();
                let x = root / number(10.0);
                let outer = number(5.0) / number(18.0);
                let near = half + number(3.0) * root / number(20.0);
                let far = half + number(3.0) * root / number(25.0);
                (vec![half - x, half, half + x], vec![outer, one - outer - outer, outer], vec![near, far, near])
            }
        };
        let s = nodes.len();
        let mut ratios = vec![half; s * s];
        let mut next = below.into_iter();
        for i in 0..s {
            for j in 0..i {
                let m = next.next().unwrap_or(half);
                ratios[i * s + j] = m;
                ratios[j * s + i] = one - m;
            }
        }
        Self { nodes, weights, ratios }
    }

    fn stages(&self) -> usize {
        self.nodes.len()
    }
}

/// Evaluates at `at` the Lagrange polynomials, which are 1 at one node and 0 at the others; returns `(at, nodes)`.
pub(super) fn lagrange<S: Scalar>(nodes: &[S], at: &[S]) -> Vec<S> {
    let one = <S as Real>::one();
    let mut weights = Vec::with_capacity(nodes.len() * at.len());
    for &t in at {
        for (j, &own) in nodes.iter().enumerate() {
            let others = nodes.iter().enumerate().filter(|&(k, _)| k != j);
            weights.push(others.fold(one, |w, (_, &node)| w * (t - node) / (own - node)));
        }
    }
    weights
}

/// The equations of one step, and the results of the last evaluation.
struct Stages<'a, S> {
    tableau: &'a Tableau<S>,
    state: &'a PhasePoint<S>,
    h: S,
    /// `h b_j`; their sum is `h`.
    steps: &'a [S],
    /// `h c_j`.
    after: &'a [S],
    /// Stage coordinates, momenta and forces, `(stages, n)`.
    q: &'a mut [S],
    p: &'a mut [S],
    g: &'a mut [S],
    derivatives: &'a mut Derivatives<S>,
}

impl<S: Scalar> Stages<'_, S> {
    /// Computes `h sum_j a_ij y_j` for component `k` of `y`, `(stages, n)`.
    #[inline]
    fn increment(&self, n: usize, i: usize, k: usize, y: &[S]) -> S {
        let s = self.tableau.stages();
        let row = &self.tableau.ratios[i * s..(i + 1) * s];
        let terms = row.iter().zip(self.steps).zip(y.iter().skip(k).step_by(n));
        terms.fold(<S as Real>::zero(), |sum, ((&m, &step), &y)| sum + m * (step * y))
    }
}

impl<S: Scalar> Equations<S> for Stages<'_, S> {
    fn residual(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        x: &[S],
        residual: &mut [S],
    ) -> Result<Defect<S>, StepFailure> {
        let (n, s) = (phase.n, self.tableau.stages());
        let (q, p) = (&self.state.q, &self.state.p);
        for i in 0..s {
            for k in 0..n {
                self.q[i * n + k] = q.high[k] + (q.low[k] + self.increment(n, i, k, x));
            }
        }
        phase.momenta_and_forces(self.q, x, self.after, (self.p, self.g))?;
        for i in 0..s {
            for k in 0..n {
                let wanted = p.low[k] + self.increment(n, i, k, self.g);
                residual[i * n + k] = (self.p[i * n + k] - p.high[k]) - wanted;
            }
        }
        let most =
            |y: &[S], k: usize| y.iter().skip(k).step_by(n).fold(<S as Real>::zero(), |most, y| S::max(most, y.abs()));
        Ok(Defect::of(n, residual, |k| p.high[k].abs() + most(self.p, k) + self.h.abs() * most(self.g, k)))
    }

    /// Block `(i, j)` is `delta_ij M + h a_ij (B - B^T - C) - h^2 (a^2)_ij K`, with `B = dp/dq`, `K = dg/dq`, `C = dQ/dv` at the middle
    /// stage.
    fn jacobian(&mut self, phase: &mut PhaseSpace<'_, S>, x: &[S], matrix: &mut [S]) -> Result<(), StepFailure> {
        let (n, s) = (phase.n, self.tableau.stages());
        let middle = s / 2 * n;
        for k in 0..n {
            self.q[k] = self.state.q.high[k] + self.increment(n, s / 2, k, x);
        }
        phase.derivatives(&self.q[..n], &x[middle..middle + n], self.after[s / 2], self.derivatives)?;
        let Derivatives { mass, mixed, stiffness, damping } = &*self.derivatives;
        let a = |i: usize, j: usize| self.tableau.ratios[i * s + j] * self.steps[j];
        for i in 0..s {
            for j in 0..s {
                let linear = a(i, j);
                let square = (0..s).fold(<S as Real>::zero(), |sum, k| sum + a(i, k) * a(k, j));
                for r in 0..n {
                    for c in 0..n {
                        let antisymmetric = mixed[r * n + c] - mixed[c * n + r];
                        let along_v = antisymmetric - damping[r * n + c];
                        let mut element = linear * along_v - square * stiffness[r * n + c];
                        if i == j {
                            element += mass[r * n + c];
                        }
                        matrix[(i * n + r) * s * n + j * n + c] = element;
                    }
                }
            }
        }
        Ok(())
    }

    fn rounding(&self, _: usize, x: &[S], i: usize) -> S {
        rounding(&self.state.q.high, self.h, x, i)
    }
}

/// Gauss collocation with the data stored from step to step.
#[derive(Clone, Debug)]
pub(super) struct Gauss<S> {
    tableau: Tableau<S>,
    chord: SimplifiedNewton<S>,
    h: S,
    steps: Vec<S>,
    after: Vec<S>,
    /// Stage velocities of the last steps of this size, oldest first, `(steps * stages, n)`.
    history: Vec<S>,
    /// Weights that extrapolate one, two, or more steps of history to the stages of the next step.
    extrapolation: Vec<Vec<S>>,
    v: Vec<S>,
    q: Vec<S>,
    p: Vec<S>,
    g: Vec<S>,
    derivatives: Derivatives<S>,
}

impl<S: Scalar> Gauss<S> {
    /// Creates the method with `stages` 1, 2 or 3 for `n` coordinates.
    pub(super) fn new(stages: usize, n: usize) -> Self {
        let tableau = Tableau::new(stages);
        let s = tableau.stages();
        let zero = <S as Real>::zero();
        let memory = if s == 1 { 3 } else { 2 };
        let extrapolation = (1..=memory)
            .map(|steps| {
                let offset = |step: usize| S::of_f64(step as f64 - steps as f64);
                let nodes: Vec<S> =
                    (0..steps).flat_map(|k| tableau.nodes.iter().map(move |&c| c + offset(k))).collect();
                lagrange(&nodes, &tableau.nodes)
            })
            .collect();
        let vector = vec![zero; s * n];
        Self {
            chord: SimplifiedNewton::new(s * n),
            h: zero,
            steps: vec![zero; s],
            after: vec![zero; s],
            history: Vec::new(),
            extrapolation,
            v: vector.clone(),
            q: vector.clone(),
            p: vector.clone(),
            g: vector,
            derivatives: Derivatives::default(),
            tableau,
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
        let (n, s) = (phase.n, self.tableau.stages());
        if h != self.h {
            self.h = h;
            for (step, &b) in self.steps.iter_mut().zip(&self.tableau.weights) {
                *step = h * b;
            }
            for (after, &node) in self.after.iter_mut().zip(&self.tableau.nodes) {
                *after = h * node;
            }
            if s == 3 {
                // The rounded weights must add up to h.
                self.steps[1] = h - (self.steps[0] + self.steps[2]);
            }
            self.history.clear();
            self.chord.forget();
        }
        if self.history.is_empty() {
            self.solve_from(phase, state, velocity)?;
        } else {
            let depth = self.history.len() / (s * n);
            let weights = &self.extrapolation[depth - 1];
            for i in 0..s {
                let row = &weights[i * depth * s..(i + 1) * depth * s];
                for k in 0..n {
                    let past = self.history.iter().skip(k).step_by(n);
                    self.v[i * n + k] = row.iter().zip(past).fold(<S as Real>::zero(), |sum, (&w, &v)| sum + w * v);
                }
            }
            if self.solve(phase, state).is_err() {
                // The motion is not smooth here: start without the history.
                self.history.clear();
                self.chord.forget();
                self.solve_from(phase, state, velocity)?;
            }
        }
        for k in 0..n {
            let sum = |y: &[S]| {
                let terms = self.steps.iter().zip(y.iter().skip(k).step_by(n));
                terms.fold(<S as Real>::zero(), |sum, (&step, &y)| sum + step * y)
            };
            state.q.add(k, sum(&self.v));
            state.p.add(k, sum(&self.g));
        }
        velocity.copy_from_slice(&self.v[(s - 1) * n..]);
        if self.history.len() == self.extrapolation.len() * s * n {
            self.history.copy_within(s * n.., 0);
            self.history.truncate((self.extrapolation.len() - 1) * s * n);
        }
        self.history.extend_from_slice(&self.v);
        Ok(())
    }

    /// Returns coordinates and velocities of the stages of the last step.
    pub(super) fn stages(&self) -> (&[S], &[S]) {
        (&self.q, &self.v)
    }

    fn solve_from(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        state: &PhasePoint<S>,
        velocity: &[S],
    ) -> Result<(), StepFailure> {
        self.v.chunks_exact_mut(phase.n).for_each(|v| v.copy_from_slice(velocity));
        self.solve(phase, state)
    }

    fn solve(&mut self, phase: &mut PhaseSpace<'_, S>, state: &PhasePoint<S>) -> Result<(), StepFailure> {
        let Self { tableau, chord, h, steps, after, v, q, p, g, derivatives, .. } = self;
        chord.solve(phase, &mut Stages { tableau, state, h: *h, steps, after, q, p, g, derivatives }, v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

    /// Checks the order conditions `sum b c^k = 1/(k+1)` and `sum_j a_ij c_j^k = c_i^(k+1)/(k+1)`, and symplecticity, to the last digits.
    fn conditions<S: Scalar>() {
        for stages in 1..=3 {
            let Tableau { nodes, weights, ratios } = Tableau::<S>::new(stages);
            let sum = |terms: &mut dyn Iterator<Item = S>| terms.fold(<S as Real>::zero(), |a, b| a + b);
            let close = |a: S, b: S| assert!((a - b).abs() <= S::epsilon() * S::of_f64(4.0), "{a} {b} {stages}");
            for k in 0..2 * stages as i32 {
                close(sum(&mut weights.iter().zip(&nodes).map(|(&b, c)| b * c.powi(k))), Real::ratio(1, k + 1));
            }
            for i in 0..stages {
                for k in 0..stages as i32 {
                    let row = (0..stages).map(|j| ratios[i * stages + j] * weights[j] * nodes[j].powi(k));
                    close(sum(&mut row.into_iter()), nodes[i].powi(k + 1) * Real::ratio(1, k + 1));
                }
                for j in 0..stages {
                    assert_eq!(ratios[i * stages + j] + ratios[j * stages + i], <S as Real>::one());
                }
            }
        }
    }

    #[test]
    fn coefficients_are_those_of_gauss() {
        conditions::<f32>();
        conditions::<f64>();
        conditions::<Dd>();
    }

    #[test]
    fn extrapolation_is_exact_for_polynomials() {
        let nodes = [-1.5, -0.5, 0.25];
        let weights = lagrange(&nodes, &[1.0]);
        let at: f64 = weights.iter().zip(nodes).map(|(w, t)| w * (t * t - 3.0 * t + 0.5)).sum();
        assert!((at + 1.5).abs() < 1e-13);
    }
}
