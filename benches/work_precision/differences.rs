//! Central differences of order 2 and 4: derivatives of a Lagrangian from its values alone.

use lnn::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use lnn::linalg::Workspace;

/// Order of the formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    Second,
    Fourth,
}

impl Order {
    pub const ALL: [Self; 2] = [Self::Second, Self::Fourth];

    pub fn name(self) -> &'static str {
        match self {
            Self::Second => "differences, h^2",
            Self::Fourth => "differences, h^4",
        }
    }

    /// Multiples of the step and their weights: order 4 is one Richardson extrapolation.
    fn steps(self) -> &'static [(f64, f64)] {
        match self {
            Self::Second => &[(1.0, 1.0)],
            Self::Fourth => &[(1.0, 4.0 / 3.0), (2.0, -1.0 / 3.0)],
        }
    }

    /// `df/dx` at step `h` from values of `f(x + displacement)`.
    pub fn first(self, h: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
        let slope = |&(multiple, weight): &(f64, f64)| {
            let h = multiple * h;
            weight * (f(h) - f(-h)) / (2.0 * h)
        };
        self.steps().iter().map(slope).sum()
    }

    /// `d2f/dx dy` at step `h` from values of `f(x + first, y + second)`.
    fn mixed(self, h: f64, mut f: impl FnMut(f64, f64) -> f64) -> f64 {
        let curvature = |&(multiple, weight): &(f64, f64)| {
            let h = multiple * h;
            weight * ((f(h, h) - f(h, -h)) - (f(-h, h) - f(-h, -h))) / (4.0 * h * h)
        };
        self.steps().iter().map(curvature).sum()
    }
}

/// A model whose derivatives are asked for, with the lengths `s_i` its steps are taken in.
pub struct Differences<'a> {
    pub model: &'a dyn EulerLagrange<f64>,
    pub scale: &'a [f64],
    pub order: Order,
}

/// Buffers of displaced states and their values.
#[derive(Default)]
pub struct Displaced {
    q: Vec<f64>,
    v: Vec<f64>,
    values: Terms<f64>,
    workspace: Workspace<f64>,
}

impl Differences<'_> {
    /// `g`, `M`, `c` and `a` of a batch at the relative step `h`; all values come from one batched call.
    ///
    /// # Errors
    /// Those of the model and of the solve.
    pub fn terms(
        &self,
        (q, v): (&[f64], &[f64]),
        h: f64,
        buffers: &mut Displaced,
        terms: &mut Terms<f64>,
    ) -> Result<(), MechanicsError> {
        let n = self.scale.len();
        terms.clear();
        buffers.q.clear();
        buffers.v.clear();
        // The same walk twice: first it gathers displaced states, then it consumes their values.
        for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
            let gather = |dq: &dyn Fn(usize) -> f64, dv: &dyn Fn(usize) -> f64| {
                buffers.q.extend(q.iter().enumerate().map(|(i, q)| q + dq(i)));
                buffers.v.extend(v.iter().enumerate().map(|(i, v)| v + dv(i)));
                0.0
            };
            self.walk(v, h, gather, &mut Terms::default());
        }
        self.model.terms(&buffers.q, &buffers.v, Request::LAGRANGIAN, &mut buffers.values)?;
        let mut values = buffers.values.lagrangian.iter().copied();
        for v in v.chunks_exact(n) {
            self.walk(v, h, |_, _| values.next().unwrap_or(f64::NAN), terms);
        }
        terms.complete(n, v, Request::ACCELERATION, &mut buffers.workspace)
    }

    /// Appends the terms of one state, whose displaced Lagrangian is `value(dq, dv)`.
    fn walk(
        &self,
        v: &[f64],
        h: f64,
        mut value: impl FnMut(&dyn Fn(usize) -> f64, &dyn Fn(usize) -> f64) -> f64,
        terms: &mut Terms<f64>,
    ) {
        let (n, scale) = (v.len(), self.scale);
        let unit = move |at: usize, step: f64| move |i: usize| if i == at { step * scale[i] } else { 0.0 };
        let still = |_: usize| 0.0;
        // Displacements along the velocity have the length of the others.
        let speed = (0..n).map(|i| (v[i] / scale[i]).abs()).fold(f64::MIN_POSITIVE, f64::max);
        let start = terms.mass_matrix.len();
        terms.mass_matrix.resize(start + n * n, f64::NAN);
        for i in 0..n {
            terms.dl_dq.push(self.order.first(h, |d| value(&unit(i, d), &still)) / scale[i]);
            let along = move |d: f64| move |k: usize| d * v[k] / speed;
            let mixed = self.order.mixed(h, |d, e| value(&along(e), &unit(i, d)));
            terms.coriolis.push(mixed * speed / scale[i]);
            for j in 0..=i {
                let both = move |d: f64, e: f64| move |k: usize| unit(i, d)(k) + unit(j, e)(k);
                let mixed = self.order.mixed(h, |d, e| value(&still, &both(d, e))) / (scale[i] * scale[j]);
                terms.mass_matrix[start + i * n + j] = mixed;
                terms.mass_matrix[start + j * n + i] = mixed;
            }
        }
    }
}
