//! A function of one number on a jet: value channel by the function, tangent channels by the chain rule.

use crate::scalar::{Real, Scalar};
use crate::tape::program::{LANES, Row};
use std::fmt::Debug;
use std::sync::Arc;

/// A function with its first three derivatives, relatively accurate in its tails.
pub trait JetFunction<S: Scalar>: Debug + Send + Sync {
    /// `[f, f', f'', f''']` at `x`.
    fn derivatives(&self, x: S) -> [S; 4];

    /// The same for a slice of points; `out[k]` receives the `k`-th derivatives. Override it where vectors help.
    fn derivative_lanes(&self, x: &[S], out: [&mut [S]; 4]) {
        let [f, d, s, t] = out;
        for (l, &x) in x.iter().enumerate() {
            [f[l], d[l], s[l], t[l]] = self.derivatives(x);
        }
    }
}

/// What the channels of a block mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JetKind {
    /// `[value, t_1, ..., t_k]`: first-order tangents along `k` directions.
    Tangents(usize),
    /// `[value, s, t, st]`: one mixed second-order coefficient.
    Mixed,
}

impl JetKind {
    /// Number of channels.
    pub fn channels(self) -> usize {
        match self {
            Self::Tangents(k) => k + 1,
            Self::Mixed => 4,
        }
    }
}

/// The function on every row of a jet.
#[derive(Clone, Debug)]
pub(in crate::tape) struct Jet<S> {
    pub(super) function: Arc<dyn JetFunction<S>>,
    pub(super) kind: JetKind,
    pub(super) rows: usize,
    pub(super) input: u32,
}

impl<S: Scalar> Jet<S> {
    fn derivatives(&self, x: &Row<S>) -> [Row<S>; 4] {
        let mut out = [*x; 4];
        let [f, d, s, t] = &mut out;
        self.function.derivative_lanes(x, [f, d, s, t]);
        out
    }

    pub(super) fn forward(&self, x: &[Row<S>], y: &mut [Row<S>]) {
        let channels = self.kind.channels();
        for (x, y) in x.chunks_exact(channels).zip(y.chunks_exact_mut(channels)) {
            let [f, d, s, _] = self.derivatives(&x[0]);
            y[0] = f;
            for (x, y) in x[1..].iter().zip(&mut y[1..]) {
                for l in 0..LANES {
                    y[l] = d[l] * x[l];
                }
            }
            if self.kind == JetKind::Mixed {
                for l in 0..LANES {
                    y[3][l] += s[l] * (x[1][l] * x[2][l]);
                }
            }
        }
    }

    /// The chain rule once more: each channel of the adjoint goes back through `f'`, and what it was multiplied with
    /// goes to the value channel through `f''` and `f'''`.
    pub(super) fn reverse(&self, x: &[Row<S>], y_adjoint: &[Row<S>], x_adjoint: &mut [Row<S>]) {
        let channels = self.kind.channels();
        let blocks = x.chunks_exact(channels).zip(y_adjoint.chunks_exact(channels));
        for ((x, w), out) in blocks.zip(x_adjoint.chunks_exact_mut(channels)) {
            let [_, d, s, t] = self.derivatives(&x[0]);
            let mut bent = [<S as Real>::zero(); LANES];
            for c in 0..channels {
                for l in 0..LANES {
                    out[c][l] += d[l] * w[c][l];
                    if c > 0 {
                        bent[l] += x[c][l] * w[c][l];
                    }
                }
            }
            for l in 0..LANES {
                out[0][l] += s[l] * bent[l];
            }
            if self.kind == JetKind::Mixed {
                for l in 0..LANES {
                    let (u, v, w) = (x[1][l], x[2][l], w[3][l]);
                    out[0][l] += t[l] * (u * v * w);
                    out[1][l] += s[l] * (v * w);
                    out[2][l] += s[l] * (u * w);
                }
            }
        }
    }
}
