//! States of many segments side by side, with their derivatives. Each segment is a lane of a batch.

use crate::lagrangian::Tangent;
use crate::scalar::update2;

/// States of all lanes, `(lanes, n)`, with derivatives, `(lanes, n, columns)`.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub q_slopes: Vec<f64>,
    pub v_slopes: Vec<f64>,
}

impl State {
    /// Zeros, `columns` derivatives of each number.
    pub fn sized(lanes: usize, n: usize, columns: usize) -> Self {
        let [state, slopes] = [lanes * n, lanes * n * columns].map(|size| vec![0.0; size]);
        Self { q: state.clone(), v: state, q_slopes: slopes.clone(), v_slopes: slopes }
    }

    /// Derivatives of positions and velocities by the initial states, `(lanes, 2n, starts)`: the first of `columns` derivatives.
    pub fn by_starts(&self, n: usize, (starts, columns): (usize, usize)) -> Vec<f64> {
        let lane = |(q, v): (&[f64], &[f64])| {
            let rows = q.chunks_exact(columns).chain(v.chunks_exact(columns));
            rows.flat_map(|row| &row[..starts]).copied().collect::<Vec<f64>>()
        };
        let lanes = self.q_slopes.chunks_exact(n * columns).zip(self.v_slopes.chunks_exact(n * columns));
        lanes.flat_map(lane).collect()
    }

    /// Sets the derivatives at the beginning of segments under constraints: the tangents of the constraints.
    pub fn begin_within(&mut self, n: usize, columns: usize, tangents: &[Tangent]) {
        for (lane, Tangent { free, following }) in tangents.iter().enumerate() {
            let directions = free.chunks_exact(2 * n).chain(following.chunks_exact(2 * n));
            for (column, direction) in directions.enumerate() {
                for i in 0..n {
                    let at = (lane * n + i) * columns + column;
                    (self.q_slopes[at], self.v_slopes[at]) = (direction[i], direction[n + i]);
                }
            }
        }
    }

    /// Sets the state to `from + h along`, with `h` of each lane; `widths` are the numbers of a lane in states and derivatives.
    pub fn set_step(&mut self, from: &Self, (h, widths): (&[f64], [usize; 2]), along: &Self) {
        let [n, columns] = widths;
        add(&mut self.q, &from.q, (h, n), &along.q);
        add(&mut self.v, &from.v, (h, n), &along.v);
        add(&mut self.q_slopes, &from.q_slopes, (h, columns), &along.q_slopes);
        add(&mut self.v_slopes, &from.v_slopes, (h, columns), &along.v_slopes);
    }
}

fn add(to: &mut [f64], from: &[f64], (h, width): (&[f64], usize), slope: &[f64]) {
    if width == 0 {
        return;
    }
    for (lane, h) in h.iter().enumerate().take(to.len() / width) {
        let at = lane * width..(lane + 1) * width;
        update2(&mut to[at.clone()], &from[at.clone()], &slope[at], |to, from, slope| *to = from + h * slope);
    }
}
