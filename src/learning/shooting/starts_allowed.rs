//! Starts under constraints: projection onto the constraints, and steps along them.

use crate::lagrangian::{Bordered, Manifold, ManifoldRows, project};
use crate::linalg::Workspace;
use crate::network::Architecture;
use crate::scalar::{Real, Scalar};
use std::fmt;
use std::sync::Arc;

/// The states that satisfy the constraints, `phi(q) = 0` and `A v = b`, in scaled coordinates.
#[derive(Clone)]
pub(super) struct StartsAllowed<S> {
    manifold: Arc<dyn Manifold<S>>,
    scale: Vec<S>,
}

impl<S> fmt::Debug for StartsAllowed<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StartsAllowed").finish_non_exhaustive()
    }
}

impl<S: Scalar> StartsAllowed<S> {
    pub fn new(architecture: &Architecture, manifold: Arc<dyn Manifold<S>>) -> Self {
        Self { manifold, scale: architecture.scale.iter().map(|&s| S::of_f64(s)).collect() }
    }

    fn physical(&self, start: &[S]) -> Vec<S> {
        start.iter().zip(self.scale.iter().cycle()).map(|(&x, &s)| x * s).collect()
    }

    /// Projects a start, `(2, n)`, onto the constraints; if that fails, the start is unchanged.
    pub fn bring(&self, start: &mut [S]) {
        let n = self.scale.len();
        let mut state = self.physical(start);
        let (q, v) = state.split_at_mut(n);
        if project(&*self.manifold, q, v).is_ok() {
            let scaled = state.iter().zip(self.scale.iter().cycle()).map(|(&x, &s)| x / s);
            start.iter_mut().zip(scaled).for_each(|(to, x)| *to = x);
        }
    }

    /// The step `d` that solves `H d = g` along the constraints at a start: `C d = 0` with the derivatives `C` of `phi` and `A v - b` by
    /// the start. `None` if there is no such step.
    pub fn step(&self, start: &[S], curvature: &[S], gradient: &[S], workspace: &mut Workspace<S>) -> Option<Vec<S>> {
        let (n, width, zero) = (self.scale.len(), gradient.len(), <S as Real>::zero());
        let state = self.physical(start);
        let (q, v) = state.split_at(n);
        let (mut rows, mut rates) = (ManifoldRows::default(), Vec::new());
        self.manifold.rows(q, v, &mut rows);
        self.manifold.rate_gradients(q, v, &mut rates);
        let mut normals = Vec::new();
        for (c, (gradient, rate)) in rows.matrix.chunks_exact(n).zip(rates.chunks_exact(n)).enumerate() {
            if self.manifold.is_holonomic(c) {
                normals.extend_from_slice(gradient);
                normals.resize(normals.len() + n, zero);
            }
            normals.extend_from_slice(rate);
            normals.extend_from_slice(gradient);
        }
        for row in normals.chunks_exact_mut(width) {
            row.iter_mut().zip(self.scale.iter().cycle()).for_each(|(x, &s)| *x *= s);
            let length = Real::sqrt(row.iter().fold(zero, |sum, &x| sum + x * x));
            row.iter_mut().for_each(|x| *x /= length);
        }
        let mut bordered = Bordered::default();
        let m = normals.len() / width;
        bordered.set((width, m), curvature, &normals);
        let (mut step, mut loads) = (vec![zero; width], vec![zero; m]);
        bordered.solve(gradient, &[], &mut step, &mut loads, workspace).then_some(step)
    }
}
