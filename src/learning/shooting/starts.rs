//! Gauss-Newton corrections of the segments' starts.
//!
//! A start has `2n` unknowns and many observations, so that its curvature `H = sum of rho'(r)/r J^T J` over residuals and gaps is small and
//! well conditioned. `J` is a difference of two integrations and may be some epochs old. Before a segment changes the weights, its start is
//! corrected by a step `-H^-1 J^T rho'(r)`, which costs no more than a forward integration. At the best start the gradient by the weights
//! is that of the loss with starts eliminated, without the steep directions that starts can compensate (Golub and Pereyra 1973, variable
//! projection). After that the exact gradient `g`, which is available anyway, corrects the remainder by `-H^-1 g`.

use super::thresholds::{LONGEST_CORRECTION, START_DAMPING, START_DIFFERENCE};
use crate::linalg::{Workspace, solve};
use crate::scalar::{Real, Scalar};
use crate::shooting::loss::Huber;
use crate::shooting::segments::Segments;

/// Residuals of a chunk at its starts, and at starts displaced along each component.
#[derive(Clone, Debug)]
pub(super) struct Linearisation<S> {
    pub base: Vec<S>,
    /// `(2n, residuals)`.
    pub moved: Vec<S>,
    pub alive: Vec<bool>,
}

impl<S> Default for Linearisation<S> {
    fn default() -> Self {
        Self { base: Vec::new(), moved: Vec::new(), alive: Vec::new() }
    }
}

impl<S: Scalar> Linearisation<S> {
    /// Finite-difference step of component `k`.
    pub fn difference(&self, segments: &Segments<S>, k: usize) -> S {
        S::epsilon().sqrt() * S::of_f64(START_DIFFERENCE) * segments.range[k]
    }

    /// Appends curvature, `(rows, 2n, 2n)`, and gradient, `(rows, 2n)`, of the rows. Rows that are left out have the gradient 0, so that their
    /// starts do not move.
    pub fn add(
        &self,
        segments: &Segments<S>,
        rows: &[u32],
        huber: Huber<S>,
        continuity: S,
        (curvature, jacobian, gradient): (&mut Vec<S>, &mut Vec<S>, &mut Vec<S>),
    ) {
        let width = 2 * segments.n;
        let (zero, two) = (<S as Real>::zero(), <S as Real>::two());
        let total = self.base.len();
        let mut at = 0;
        for (row, &segment) in rows.iter().enumerate() {
            let residuals = segments.residuals(segment as usize);
            let segment = &segments.list[segment as usize];
            let count = residuals + if segment.has_next { width } else { 0 };
            let (h, g) = (curvature.len(), gradient.len());
            curvature.resize(h + width * width, zero);
            gradient.resize(g + width, zero);
            let (h, g) = (&mut curvature[h..], &mut gradient[g..]);
            for k in 0..width {
                let square = (segments.tau[k] * segments.tau[k]).recip();
                // The gap before this start also depends on it.
                let before = if segment.has_previous { two * continuity } else { zero };
                h[k * width + k] = square * (S::of_f64(START_DAMPING) + before);
            }
            let j = jacobian.len();
            jacobian.resize(j + count * width, zero);
            for e in (at..at + count).filter(|_| self.alive[row]) {
                let weight = if e < at + residuals { <S as Real>::one() } else { continuity };
                let r = self.base[e];
                let (slope, bend) = (weight * huber.of(r).1, weight * huber.curvature(r));
                let derivative = &mut jacobian[j + (e - at) * width..][..width];
                for (k, d) in derivative.iter_mut().enumerate() {
                    *d = (self.moved[k * total + e] - r) / self.difference(segments, k);
                }
                for i in 0..width {
                    g[i] += slope * derivative[i];
                    for j in 0..=i {
                        h[i * width + j] += bend * derivative[i] * derivative[j];
                    }
                }
            }
            for i in 0..width {
                for j in 0..i {
                    h[j * width + i] = h[i * width + j];
                }
            }
            at += count;
        }
    }
}

/// Derivatives of all residuals and gaps with respect to the starts, and the resulting curvature of the loss.
#[derive(Debug)]
pub struct Curvature<S> {
    /// `(segments, 2n, 2n)`.
    matrices: Vec<S>,
    /// Derivatives `(residuals and gap of each segment, 2n)`, and the index at which each segment begins.
    jacobian: Vec<S>,
    offsets: Vec<usize>,
    correction: Vec<S>,
    workspace: Workspace<S>,
}

impl<S: Scalar> Default for Curvature<S> {
    fn default() -> Self {
        Self {
            matrices: Vec::new(),
            jacobian: Vec::new(),
            offsets: Vec::new(),
            correction: Vec::new(),
            workspace: Workspace::new(),
        }
    }
}

impl<S: Scalar> Curvature<S> {
    /// Collects the parts of all segments in order.
    pub(super) fn set<'a>(&mut self, segments: &Segments<S>, parts: impl Iterator<Item = (&'a [S], &'a [S])>) {
        self.matrices.clear();
        self.jacobian.clear();
        for (matrices, jacobian) in parts {
            self.matrices.extend_from_slice(matrices);
            self.jacobian.extend_from_slice(jacobian);
        }
        let width = 2 * segments.n;
        let mut at = 0;
        self.offsets.clear();
        for (k, segment) in segments.list.iter().enumerate() {
            self.offsets.push(at);
            at += width * (segments.residuals(k) + if segment.has_next { width } else { 0 });
        }
    }

    /// Returns the curvature, `(segments, 2n, 2n)`, and the derivatives, `(residuals and gap of each segment, 2n)`, as
    /// [`restore`](Self::restore) takes them.
    pub(super) fn stored(&self) -> (&[S], &[S]) {
        (&self.matrices, &self.jacobian)
    }

    /// Restores the output of [`stored`](Self::stored); `None` if it does not fit these segments.
    pub(super) fn restore(segments: &Segments<S>, matrices: &[S], jacobian: &[S]) -> Option<Self> {
        let width = 2 * segments.n;
        let rows = |k: usize| segments.residuals(k) + if segments.list[k].has_next { width } else { 0 };
        let derivatives: usize = (0..segments.len()).map(|k| width * rows(k)).sum();
        let mut curvature = Self::default();
        curvature.set(segments, std::iter::once((matrices, jacobian)));
        (matrices.len() == segments.len() * width * width && jacobian.len() == derivatives).then_some(curvature)
    }

    /// Adds `J^T rho'(r)` of one segment to `gradient`, `(2n)`; `values` are its residuals, then its gap.
    pub(super) fn add_gradient(
        &self,
        segments: &Segments<S>,
        segment: usize,
        values: &[S],
        huber: Huber<S>,
        continuity: S,
        gradient: &mut [S],
    ) {
        let residuals = segments.residuals(segment);
        let rows = self.jacobian[self.offsets[segment]..].chunks_exact(gradient.len());
        for (e, (&r, row)) in values.iter().zip(rows).enumerate() {
            let slope = if e < residuals { huber.of(r).1 } else { continuity * huber.of(r).1 };
            for (g, &d) in gradient.iter_mut().zip(row) {
                *g += slope * d;
            }
        }
    }

    /// Moves `starts` by `-share H^-1 gradient`, both `(segments, 2, n)`; the gradient is of sums, not of means.
    ///
    /// A correction is limited to a tenth of the largest displacement within a segment.
    pub fn correct(&mut self, segments: &Segments<S>, starts: &mut [S], gradient: &[S], share: f64) {
        let width = 2 * segments.n;
        let zero = <S as Real>::zero();
        let share = S::of_f64(share);
        self.correction.resize(width, zero);
        let rows = starts.chunks_exact_mut(width).zip(gradient.chunks_exact(width));
        for ((start, g), h) in rows.zip(self.matrices.chunks_exact(width * width)) {
            if g.iter().all(|g| *g == zero) {
                continue;
            }
            // A start is not moved if its curvature contains no information.
            let step = match &segments.allowed {
                Some(allowed) => allowed.step(start, h, g, &mut self.workspace),
                None => {
                    let solved = solve(width, h, g, &mut self.correction, &mut self.workspace);
                    solved.is_ok().then(|| self.correction.clone())
                }
            };
            let Some(step) = step else { continue };
            let limit = |k: usize| S::of_f64(LONGEST_CORRECTION) * segments.range[k];
            let excess = (0..width).map(|k| share * step[k].abs() / limit(k));
            let excess = excess.fold(<S as Real>::one(), |most, x| if x > most { x } else { most });
            for (x, &d) in start.iter_mut().zip(&step) {
                *x -= share / excess * d;
            }
            if let Some(allowed) = &segments.allowed {
                allowed.bring(start);
            }
        }
    }
}
