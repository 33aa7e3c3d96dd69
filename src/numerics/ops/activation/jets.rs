//! Activation jets over slices: the hot loops.

use super::{Activation, each_activation, formula};
use crate::scalar::{Scalar, vectorized};
use formula::Jet;

impl Activation {
    /// Value and four derivatives at `x`: `[f, f', f'', f''', f'''']`.
    ///
    /// Closed forms, each accurate to a few units of rounding times its own condition number `1 + |x f^(k+1) / f^(k)|`,
    /// into the tails until underflow; finite for every finite `x` but the value of the quadratic.
    pub fn derivatives<S: Scalar>(self, x: S) -> Jet<S> {
        each_activation!(self, jet => jet(x))
    }

    /// `f = act(z)` elementwise. All slices have the same length.
    pub fn value<S: Scalar>(self, z: &[S], f: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let f = &mut f[..n];
            for k in 0..n {
                f[k] = jet(z[k])[0];
            }
        });
    }

    /// Value and first derivative, elementwise. All slices have the same length.
    pub fn jet1<S: Scalar>(self, z: &[S], f: &mut [S], d1: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let (f, d1) = (&mut f[..n], &mut d1[..n]);
            for k in 0..n {
                [f[k], d1[k], ..] = jet(z[k]);
            }
        });
    }

    /// Value and two derivatives, elementwise. All slices have the same length.
    pub fn jet2<S: Scalar>(self, z: &[S], f: &mut [S], d1: &mut [S], d2: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let (f, d1, d2) = (&mut f[..n], &mut d1[..n], &mut d2[..n]);
            for k in 0..n {
                [f[k], d1[k], d2[k], ..] = jet(z[k]);
            }
        });
    }

    /// Value and three derivatives, elementwise. All slices have the same length.
    pub fn jet3<S: Scalar>(self, z: &[S], f: &mut [S], d1: &mut [S], d2: &mut [S], d3: &mut [S]) {
        each_activation!(self, jet => {
            let n = z.len();
            let (f, d1, d2, d3) = (&mut f[..n], &mut d1[..n], &mut d2[..n], &mut d3[..n]);
            for k in 0..n {
                [f[k], d1[k], d2[k], d3[k], _] = jet(z[k]);
            }
        });
    }
}
