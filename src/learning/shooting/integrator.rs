//! The Runge-Kutta method on a chunk of segments, and its discrete adjoint.
//!
//! For `q' = v`, `v' = a(q, v, t)` the four stages of a step of length `h` are
//!
//! ```text
//! (q1, v1) = (q, v)                          (q2, v2) = (q + h/2 v, v + h/2 a1)
//! (q3, v3) = (q + h/2 v + h^2/4 a1, v + h/2 a2)    (q4, v4) = (q + h v + h^2/2 a2, v + h a3)
//! q' = q + h v + h^2/6 (a1 + a2 + a3)        v' = v + h/6 (a1 + 2 a2 + 2 a3 + a4)
//! ```
//!
//! The forward pass keeps states and accelerations of all stages; the reverse pass evaluates the network there again, with the quantities
//! of the adjoint identity. Every gradient is the exact gradient of this map.

use crate::configuration::Penalty;
use crate::lagrangian::Manifold;
use crate::network::Model;
use crate::scalar::{Real, Scalar};
use crate::shooting::motion::Motion;
use crate::shooting::segments::Segments;
use crate::tape::Depth;
use std::sync::Arc;

/// Integrates chunks of segments; buffers are reused from chunk to chunk.
pub(super) struct SegmentIntegrator<S> {
    motion: Motion<S>,
    n: usize,
    rows: usize,
    steps: usize,
    /// Step length of each segment.
    h: Vec<S>,
    /// Stage states and accelerations, `(steps, 4, rows, n)`; the first stage of a step is the state at its start.
    stage_q: Vec<S>,
    stage_v: Vec<S>,
    stage_a: Vec<S>,
    /// Multipliers of the constraints of all stages, `(steps, 4, rows, m)`.
    stage_load: Vec<S>,
    /// States at the starts of steps and at the end, `(steps + 1, rows, n)`.
    pub q: Vec<S>,
    pub v: Vec<S>,
    /// Adjoints of those states; after the reverse pass, the first rows contain the adjoints of the starts.
    pub q_adjoint: Vec<S>,
    pub v_adjoint: Vec<S>,
    /// Segments whose motion is finite and in range so far.
    pub alive: Vec<bool>,
    external: Vec<S>,
    /// Adjoints of the four accelerations of a step, and the contributions to the states of a stage.
    a_adjoint: [Vec<S>; 4],
    dq: Vec<S>,
    dv: Vec<S>,
}

impl<S: Scalar> SegmentIntegrator<S> {
    pub fn new(model: &Model<S>, manifold: Option<Arc<dyn Manifold<S>>>) -> Self {
        Self {
            motion: Motion::new(model, manifold),
            n: model.coordinates(),
            rows: 0,
            steps: 0,
            h: Vec::new(),
            stage_q: Vec::new(),
            stage_v: Vec::new(),
            stage_a: Vec::new(),
            stage_load: Vec::new(),
            q: Vec::new(),
            v: Vec::new(),
            q_adjoint: Vec::new(),
            v_adjoint: Vec::new(),
            alive: Vec::new(),
            external: Vec::new(),
            a_adjoint: Default::default(),
            dq: Vec::new(),
            dv: Vec::new(),
        }
    }

    /// Initialises a chunk of segments at their starts, `(rows, 2, n)`.
    pub fn place(&mut self, segments: &Segments<S>, rows: &[u32], starts: impl Iterator<Item = S>) {
        let n = self.n;
        (self.rows, self.steps) = (rows.len(), segments.steps);
        let (size, zero) = (rows.len() * n, <S as Real>::zero());
        self.h.clear();
        self.h.extend(rows.iter().map(|&row| segments.list[row as usize].step));
        for list in [&mut self.stage_q, &mut self.stage_v, &mut self.stage_a] {
            list.resize(4 * self.steps * size, zero);
        }
        for list in [&mut self.q, &mut self.v] {
            list.resize((self.steps + 1) * size, zero);
        }
        for list in [&mut self.q_adjoint, &mut self.v_adjoint] {
            list.clear();
            list.resize((self.steps + 1) * size, zero);
        }
        self.alive.clear();
        self.alive.resize(rows.len(), true);
        for (k, x) in starts.enumerate() {
            let (row, part) = (k / (2 * n), k % (2 * n));
            if part < n { self.q[row * n + part] = x } else { self.v[row * n + part - n] = x }
        }
    }

    /// Integrates from the starts to the ends.
    pub fn forward(&mut self, weights: &[S], segments: &Segments<S>, rows: &[u32]) {
        let (n, size) = (self.n, self.rows * self.n);
        let (half, sixth, third) = (<S as Real>::half(), S::ratio(1, 6), S::ratio(1, 3));
        self.stage_load.clear();
        for j in 0..self.steps {
            for k in 0..4 {
                let slot = (4 * j + k) * size;
                let (q, v) = (&self.q[j * size..][..size], &self.v[j * size..][..size]);
                let (before, now) = self.stage_a.split_at_mut(slot);
                let a = |of: usize| &before[(4 * j + of) * size..][..size];
                let (stage_q, stage_v) = (&mut self.stage_q[slot..][..size], &mut self.stage_v[slot..][..size]);
                for e in 0..size {
                    let h = self.h[e / n];
                    (stage_q[e], stage_v[e]) = match k {
                        0 => (q[e], v[e]),
                        1 => (q[e] + half * h * v[e], v[e] + half * h * a(0)[e]),
                        2 => (q[e] + half * h * (v[e] + half * h * a(0)[e]), v[e] + half * h * a(1)[e]),
                        _ => (q[e] + h * (v[e] + half * h * a(1)[e]), v[e] + h * a(2)[e]),
                    };
                }
                external(segments, rows, n, 2 * j + [0, 1, 1, 2][k], &mut self.external);
                self.motion.evaluate(weights, stage_q, stage_v, Depth::Motion);
                self.motion.accelerate(&self.external, &mut self.alive, &mut now[..size], &mut self.stage_load);
            }
            let a = &self.stage_a[4 * j * size..][..4 * size];
            let (q, q_next) = self.q[j * size..].split_at_mut(size);
            let (v, v_next) = self.v[j * size..].split_at_mut(size);
            for e in 0..size {
                let (h, [a1, a2, a3, a4]) = (self.h[e / n], [0, 1, 2, 3].map(|k| a[k * size + e]));
                q_next[e] = q[e] + h * (v[e] + sixth * h * (a1 + a2 + a3));
                v_next[e] = v[e] + h * (sixth * (a1 + a4) + third * (a2 + a3));
            }
            self.give_up(segments, j + 1);
        }
    }

    /// Marks segments that have left the range as not alive and resets them to their starts.
    fn give_up(&mut self, segments: &Segments<S>, node: usize) {
        let (n, size) = (self.n, self.rows * self.n);
        let (reach, speed) = segments.range.split_at(n);
        let (q_start, q) = self.q.split_at_mut(node * size);
        let (v_start, v) = self.v.split_at_mut(node * size);
        for (row, alive) in self.alive.iter_mut().enumerate() {
            let range = row * n..(row + 1) * n;
            let (q, v) = (&mut q[range.clone()], &mut v[range.clone()]);
            let (q_start, v_start) = (&q_start[range.clone()], &v_start[range]);
            // A comparison with `NaN` is false.
            *alive &= (0..n).all(|i| (q[i] - q_start[i]).abs() <= reach[i] && v[i].abs() <= speed[i]);
            if !*alive {
                q.copy_from_slice(q_start);
                v.copy_from_slice(v_start);
            }
        }
    }

    /// Propagates the adjoints of the steps' states back to the starts and adds to the gradient by the weights; returns value and count of
    /// the penalty, which has the weight `lambda` at the start of every step.
    pub fn reverse(&mut self, weights: &[S], penalty: (Penalty, S), gradient: &mut [S]) -> (S, usize) {
        let (n, size) = (self.n, self.rows * self.n);
        let (half, sixth, third) = (<S as Real>::half(), S::ratio(1, 6), S::ratio(1, 3));
        let zero = <S as Real>::zero();
        let (mut total, mut count) = (zero, 0);
        let held = self.rows * self.motion.constraints();
        for list in self.a_adjoint.iter_mut().chain([&mut self.dq, &mut self.dv]) {
            list.resize(size, zero);
        }
        for j in (0..self.steps).rev() {
            let (q, q_end) = self.q_adjoint[j * size..].split_at_mut(size);
            let (v, v_end) = self.v_adjoint[j * size..].split_at_mut(size);
            for e in 0..size {
                let (h, qe, ve) = (self.h[e / n], q_end[e], v_end[e]);
                let position = sixth * h * h * qe;
                self.a_adjoint[0][e] = position + sixth * h * ve;
                self.a_adjoint[1][e] = position + third * h * ve;
                self.a_adjoint[2][e] = position + third * h * ve;
                self.a_adjoint[3][e] = sixth * h * ve;
                q[e] += qe;
                v[e] += ve + h * qe;
            }
            for k in (0..4).rev() {
                let slot = (4 * j + k) * size..(4 * j + k + 1) * size;
                let (stage_q, stage_v) = (&self.stage_q[slot.clone()], &self.stage_v[slot.clone()]);
                self.motion.evaluate(weights, stage_q, stage_v, Depth::Training);
                if k == 0 {
                    let (value, active) = self.motion.add_penalty(weights, penalty, &self.alive, gradient);
                    total += value;
                    count += active;
                }
                self.dq.fill(zero);
                self.dv.fill(zero);
                let a = &self.stage_a[slot];
                let loads = &self.stage_load[(4 * j + k) * held..(4 * j + k + 1) * held];
                let inputs = (self.dq.as_mut_slice(), self.dv.as_mut_slice());
                self.motion.pull_back(weights, (a, &self.a_adjoint[k], loads), &self.alive, gradient, inputs);
                let [a1, a2, a3, _] = &mut self.a_adjoint;
                for e in 0..size {
                    let (h, x, y) = (self.h[e / n], self.dq[e], self.dv[e]);
                    q[e] += x;
                    v[e] += y;
                    match k {
                        0 => {}
                        1 => {
                            v[e] += half * h * x;
                            a1[e] += half * h * y;
                        }
                        2 => {
                            v[e] += half * h * x;
                            a1[e] += half * half * h * h * x;
                            a2[e] += half * h * y;
                        }
                        _ => {
                            v[e] += h * x;
                            a2[e] += half * h * h * x;
                            a3[e] += h * y;
                        }
                    }
                }
            }
        }
        (total, count)
    }
}

/// External forces of the segments at a half step, `(rows, n)`; empty if there are none.
fn external<S: Scalar>(segments: &Segments<S>, rows: &[u32], n: usize, half_step: usize, out: &mut Vec<S>) {
    out.clear();
    if segments.force.is_empty() {
        return;
    }
    for &row in rows {
        let at = row as usize * (2 * segments.steps + 1) + half_step;
        out.extend_from_slice(&segments.force[at * n..(at + 1) * n]);
    }
}
