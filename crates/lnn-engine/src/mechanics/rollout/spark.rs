//! Gauss collocation with constraints: multipliers at the Lobatto nodes enforce `phi(q) = 0`.
//!
//! With stage velocities `V_i`, `Q_i = q + h sum_j a_ij V_j` at the nodes of Gauss and `R_k = q + h sum_j c_kj V_j` at those of Lobatto, `k
//! = 0..s`, where the first is the start of the step and the last its end,
//!
//! ```text
//! dL/dv(Q_i, V_i) = p + h sum_j a_ij dL/dq(Q_j, V_j) + sum_k d_ik A(R_k)^T lambda_k,    phi(R_k) = 0 for k >= 1,
//! ```
//!
//! `d_ik = w_k (1 - c_ki / b_i)` with Lobatto's weights `w`, and the last impulse brings the new momentum to `A v = 0`. The methods are
//! symplectic on the manifold and of order `2 s`; one stage is RATTLE for the midpoint discrete Lagrangian: Newton's equations with the
//! impulses of the constraints at the ends of the step. Rows that are linear in the velocities, `A(q) v = b(q)`, which have no symplectic
//! form, hold at the Gauss nodes with multipliers there, and at the end of the step.
//!
//! Source: Jay, Specialized partitioned additive Runge-Kutta methods for systems of overdetermined DAEs with holonomic constraints (2007),
//! the (s, s)-Gauss-Lobatto SPARK methods; Andersen, Rattle (1983).

use super::StepFailure;
use super::gauss::{Tableau, lagrange};
use super::phase::{Defect, PhasePoint, PhaseSpace};
use super::simplified_newton::{Equations, SimplifiedNewton, rounding};
use crate::lagrangian::{Manifold, ManifoldRows};
use crate::scalar::{Real, Scalar};

/// The Lobatto nodes that belong to a Gauss tableau.
#[derive(Clone, Debug)]
struct Lobatto<S> {
    /// `w`, `(s + 1)`.
    weights: Vec<S>,
    /// `c`, `(s + 1, s)`.
    positions: Vec<S>,
    /// `d`, `(s, s + 1)`.
    momenta: Vec<S>,
}

impl<S: Scalar> Lobatto<S> {
    fn new(gauss: &Tableau<S>) -> Self {
        let (zero, half, one) = (<S as Real>::zero(), <S as Real>::half(), <S as Real>::one());
        let s = gauss.nodes.len();
        let (nodes, weights) = match s {
            1 => (vec![zero, one], vec![half; 2]),
            2 => (vec![zero, half, one], [1, 4, 1].map(|w| Real::ratio(w, 6)).to_vec()),
            _ => {
                let x = Real::sqrt(S::of_f64(5.0)) / S::of_f64(10.0);
                (vec![zero, half - x, half + x, one], [1, 5, 5, 1].map(|w| Real::ratio(w, 12)).to_vec())
            }
        };
        // Integrals of the Lagrange polynomials from 0 to each node, computed with the quadrature.
        let mut positions = Vec::with_capacity((s + 1) * s);
        for &end in &nodes {
            let at: Vec<S> = gauss.nodes.iter().map(|&c| c * end).collect();
            let values = lagrange(&gauss.nodes, &at);
            positions
                .extend((0..s).map(|j| (0..s).fold(zero, |sum, k| sum + gauss.weights[k] * values[k * s + j]) * end));
        }
        let momenta = (0..s * (s + 1)).map(|at| {
            let (i, k) = (at / (s + 1), at % (s + 1));
            weights[k] * (one - positions[k * s + i] / gauss.weights[i])
        });
        let momenta = momenta.collect();
        Self { weights, positions, momenta }
    }
}

/// The equations of one step, and the results of the last evaluation.
struct Stages<'a, S: Scalar> {
    tableau: &'a Tableau<S>,
    lobatto: &'a Lobatto<S>,
    manifold: &'a dyn Manifold<S>,
    kinds: &'a Kinds,
    state: &'a PhasePoint<S>,
    h: S,
    buffers: &'a mut Buffers<S>,
}

/// The indices of holonomic rows, and of rows that are linear in the velocities.
#[derive(Clone, Debug)]
struct Kinds {
    holonomic: Vec<usize>,
    linear: Vec<usize>,
}

/// Results of the last evaluation.
#[derive(Clone, Debug)]
struct Buffers<S> {
    /// `h c_j`.
    after: Vec<S>,
    /// Stage coordinates, momenta and forces, `(stages, n)`.
    q: Vec<S>,
    p: Vec<S>,
    g: Vec<S>,
    /// Change of the momentum by forces and constraints over the step, except for the last impulse, `(n)`.
    push: Vec<S>,
    /// Sizes of the terms in the constraint equations.
    sizes: Vec<S>,
}

/// Returns row `row` of an `(m, n)` matrix.
fn row_of<S>(matrix: &[S], n: usize, row: usize) -> &[S] {
    &matrix[row * n..(row + 1) * n]
}

impl<S: Scalar> Stages<'_, S> {
    /// Computes `q + h sum_j weights_j V_j`.
    fn place(&self, n: usize, weights: &[S], v: &[S]) -> Vec<S> {
        let q = &self.state.q;
        (0..n)
            .map(|k| {
                let terms = weights.iter().zip(v.iter().skip(k).step_by(n));
                q.high[k] + (q.low[k] + self.h * terms.fold(<S as Real>::zero(), |sum, (&w, &v)| sum + w * v))
            })
            .collect()
    }

    /// Returns `a_ij`, without the factor `h`.
    fn ratio(&self, i: usize, j: usize) -> S {
        self.tableau.ratios[i * self.tableau.nodes.len() + j] * self.tableau.weights[j]
    }

    /// Adds the equations `phi(R_k) = 0`, and their impulses at all Lobatto nodes except the last one.
    fn add_holonomic(&self, n: usize, v: &[S], impulses: &[S], sums: &mut Sums<S>) {
        let (s, held, zero, h) = (self.tableau.nodes.len(), self.kinds.holonomic.len(), <S as Real>::zero(), self.h);
        for k in (0..=s).filter(|_| held > 0) {
            let at = self.place(n, row_of(&self.lobatto.positions, s, k), v);
            self.manifold.rows(&at, &v[..n], &mut sums.rows);
            if k > 0 {
                for &row in &self.kinds.holonomic {
                    let terms = row_of(&sums.rows.matrix, n, row).iter().zip(&at);
                    let size = terms.fold(zero, |sum, (&a, &q)| sum + (a * q).abs());
                    sums.defects.push(sums.rows.values[row] / h);
                    sums.sizes.push(size / h.abs());
                }
            }
            if k < s {
                sums.node.fill(zero);
                for (&row, &impulse) in self.kinds.holonomic.iter().zip(row_of(impulses, held, k)) {
                    let gradient = row_of(&sums.rows.matrix, n, row);
                    sums.node.iter_mut().zip(gradient).for_each(|(sum, &a)| *sum += impulse * a);
                }
                sums.spread(n, |i| self.lobatto.momenta[i * (s + 1) + k], self.lobatto.weights[k]);
            }
        }
    }

    /// Adds the forces at the Gauss nodes, and the rows that are linear in the velocities with their multipliers.
    fn add_forces(&self, n: usize, v: &[S], multipliers: &[S], sums: &mut Sums<S>) {
        let (zero, h, linear) = (<S as Real>::zero(), self.h, &self.kinds.linear);
        for j in 0..self.tableau.nodes.len() {
            sums.node.iter_mut().zip(row_of(&self.buffers.g, n, j)).for_each(|(sum, &g)| *sum = h * g);
            if !linear.is_empty() {
                self.manifold.rows(row_of(&self.buffers.q, n, j), row_of(v, n, j), &mut sums.rows);
                for (&row, &multiplier) in linear.iter().zip(row_of(multipliers, linear.len(), j)) {
                    let gradient = row_of(&sums.rows.matrix, n, row);
                    let size = gradient.iter().zip(row_of(v, n, j)).fold(zero, |sum, (&a, &v)| sum + (a * v).abs());
                    sums.defects.push(sums.rows.rates[row]);
                    sums.sizes.push(size);
                    sums.node.iter_mut().zip(gradient).for_each(|(sum, &a)| *sum += multiplier * a);
                }
            }
            sums.spread(n, |i| self.ratio(i, j), self.tableau.weights[j]);
        }
    }
}

/// Sums over the nodes in one evaluation.
struct Sums<S> {
    /// Contribution of the current node, `(n)`.
    node: Vec<S>,
    /// Change of the momenta of the stages, `(stages, n)`, and of the end without the last impulse, `(n)`.
    stages: Vec<S>,
    end: Vec<S>,
    /// Defects of the constraint equations, and the sizes of their terms.
    defects: Vec<S>,
    sizes: Vec<S>,
    rows: ManifoldRows<S>,
}

impl<S: Scalar> Sums<S> {
    fn new(n: usize, stages: usize, equations: usize) -> Self {
        let zero = <S as Real>::zero();
        Self {
            node: vec![zero; n],
            stages: vec![zero; stages * n],
            end: vec![zero; n],
            defects: Vec::with_capacity(equations),
            sizes: Vec::with_capacity(equations),
            rows: ManifoldRows::default(),
        }
    }

    /// Adds the contribution of the current node to every stage and to the end of the step, with the given weights.
    fn spread(&mut self, n: usize, of_stage: impl Fn(usize) -> S, of_end: S) {
        for (i, stage) in self.stages.chunks_exact_mut(n).enumerate() {
            let weight = of_stage(i);
            stage.iter_mut().zip(&self.node).for_each(|(to, &x)| *to += weight * x);
        }
        self.end.iter_mut().zip(&self.node).for_each(|(to, &x)| *to += of_end * x);
    }
}

impl<S: Scalar> Equations<S> for Stages<'_, S> {
    fn residual(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        x: &[S],
        residual: &mut [S],
    ) -> Result<Defect<S>, StepFailure> {
        let (n, s, zero) = (phase.n, self.tableau.nodes.len(), <S as Real>::zero());
        let (v, multipliers) = x.split_at(s * n);
        let (impulses, pulls) = multipliers.split_at(s * self.kinds.holonomic.len());
        for i in 0..s {
            let weights: Vec<S> = (0..s).map(|j| self.ratio(i, j)).collect();
            let at = self.place(n, &weights, v);
            self.buffers.q[i * n..(i + 1) * n].copy_from_slice(&at);
        }
        let Buffers { after, q, p, g, .. } = &mut *self.buffers;
        phase.momenta_and_forces(q, v, after, (p, g))?;
        let mut sums = Sums::new(n, s, multipliers.len());
        self.add_holonomic(n, v, impulses, &mut sums);
        self.add_forces(n, v, pulls, &mut sums);
        let Sums { stages: wanted, end, defects, sizes, .. } = sums;
        let p0 = &self.state.p;
        for (at, residual) in residual[..s * n].iter_mut().enumerate() {
            let k = at % n;
            *residual = (self.buffers.p[at] - p0.high[k]) - (p0.low[k] + wanted[at]);
        }
        let most = |y: &[S], k: usize| y.iter().skip(k).step_by(n).fold(zero, |most, y| S::max(most, y.abs()));
        let (found, forces) = (&self.buffers.p, &self.buffers.g);
        let size = |k: usize| p0.high[k].abs() + most(found, k) + self.h.abs() * most(forces, k) + most(&wanted, k);
        let of_momenta = Defect::of(n, &residual[..s * n], size);
        residual[s * n..].copy_from_slice(&defects);
        // The terms of the constraint equations are proportional to velocities.
        let speed = v.iter().fold(zero, |most, v| S::max(most, v.abs()));
        let of_rows = Defect::of(defects.len().max(1), &defects, |i| sizes.get(i).map_or(zero, |&size| size + speed));
        (self.buffers.push, self.buffers.sizes) = (end, sizes);
        Ok(of_momenta.worst(of_rows))
    }

    /// Uses forward differences, which are sufficient for an iteration matrix.
    fn jacobian(&mut self, phase: &mut PhaseSpace<'_, S>, x: &[S], matrix: &mut [S]) -> Result<(), StepFailure> {
        let (size, n, s) = (x.len(), phase.n, self.tableau.nodes.len());
        let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
        let mut middle = vec![zero; size];
        self.residual(phase, x, &mut middle)?;
        let (mut shifted, mut moved) = (x.to_vec(), vec![zero; size]);
        for c in 0..size {
            let block = if c < s * n { &x[..s * n] } else { &x[s * n..] };
            let largest = block.iter().fold(zero, |most, x| S::max(most, x.abs()));
            let width = Real::sqrt(S::epsilon()) * if largest > zero { largest } else { one };
            shifted[c] = x[c] + width;
            let width = shifted[c] - x[c];
            self.residual(phase, &shifted, &mut moved)?;
            shifted[c] = x[c];
            for r in 0..size {
                matrix[r * size + c] = (moved[r] - middle[r]) / width;
            }
        }
        Ok(())
    }

    /// The rounding of the impulses follows from that of the velocities.
    fn rounding(&self, n: usize, x: &[S], i: usize) -> S {
        let velocities = self.tableau.nodes.len() * n;
        if i < velocities { rounding(&self.state.q.high, self.h, x, i) } else { S::infinity() }
    }
}

/// The integrator with the data stored from step to step.
#[derive(Clone, Debug)]
pub(super) struct Spark<S> {
    tableau: Tableau<S>,
    lobatto: Lobatto<S>,
    kinds: Kinds,
    chord: SimplifiedNewton<S>,
    h: S,
    x: Vec<S>,
    buffers: Buffers<S>,
}

impl<S: Scalar> Spark<S> {
    /// Creates the method with `stages` 1, 2 or 3 on a manifold.
    pub(super) fn new(stages: usize, manifold: &dyn Manifold<S>) -> Self {
        let tableau = Tableau::new(stages);
        let (n, m, zero) = (manifold.coordinates(), manifold.names().len(), <S as Real>::zero());
        let (holonomic, linear) = (0..m).partition(|&row| manifold.is_holonomic(row));
        let vector = vec![zero; stages * n];
        Self {
            lobatto: Lobatto::new(&tableau),
            kinds: Kinds { holonomic, linear },
            chord: SimplifiedNewton::new(stages * (n + m)),
            h: zero,
            x: vec![zero; stages * (n + m)],
            buffers: Buffers {
                after: vec![zero; stages],
                q: vector.clone(),
                p: vector.clone(),
                g: vector,
                push: vec![zero; n],
                sizes: Vec::new(),
            },
            tableau,
        }
    }

    /// Computes one step of size `h`; `velocity` must be close to the velocity at the start, and afterwards equals that at the end.
    pub(super) fn step(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        manifold: &dyn Manifold<S>,
        state: &mut PhasePoint<S>,
        velocity: &mut [S],
        h: S,
    ) -> Result<(), StepFailure> {
        let (n, s) = (phase.n, self.tableau.nodes.len());
        if h != self.h {
            self.h = h;
            self.buffers.after = self.tableau.nodes.iter().map(|&c| h * c).collect();
            self.x[s * n..].fill(<S as Real>::zero());
            self.chord.forget();
        }
        self.x[..s * n].chunks_exact_mut(n).for_each(|v| v.copy_from_slice(velocity));
        let Self { tableau, lobatto, kinds, chord, x, buffers, .. } = self;
        chord.solve(phase, &mut Stages { tableau, lobatto, manifold, kinds, state, h, buffers }, x)?;
        for k in 0..n {
            let terms = tableau.weights.iter().zip(x.iter().skip(k).step_by(n).take(s));
            state.q.add(k, h * terms.fold(<S as Real>::zero(), |sum, (&w, &v)| sum + w * v));
            state.p.add(k, buffers.push[k]);
        }
        phase.move_on(h);
        let push = phase.land(manifold, &state.q.high, &state.p.high, velocity)?;
        push.into_iter().enumerate().for_each(|(k, push)| state.p.add(k, push));
        Ok(())
    }

    /// Returns coordinates and velocities of the stages of the last step.
    pub(super) fn stages(&self) -> (&[S], &[S]) {
        (&self.buffers.q, &self.x[..self.buffers.q.len()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For one stage the coefficients are those of RATTLE; all satisfy the symplecticity condition and the order conditions of the end.
    #[test]
    fn coefficients_are_those_of_jay() {
        for s in 1..=3 {
            let gauss = Tableau::<f64>::new(s);
            let Lobatto { weights, positions, momenta } = Lobatto::new(&gauss);
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
            for k in 0..=s {
                for i in 0..s {
                    let mixed = gauss.weights[i] * momenta[i * (s + 1) + k] + weights[k] * positions[k * s + i];
                    close(mixed, gauss.weights[i] * weights[k]);
                    close(positions[s * s + i], gauss.weights[i]);
                }
            }
            for i in 0..s {
                close(momenta[i * (s + 1) + s], 0.0);
                close((0..s).map(|k| momenta[i * (s + 1) + k]).sum(), gauss.nodes[i]);
            }
        }
    }
}
