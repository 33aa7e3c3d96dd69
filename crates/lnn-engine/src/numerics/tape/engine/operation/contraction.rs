//! The second-order contraction of a block: `M_ij += sum over units of k x_i x_j`, `c_i += sum of k x_i x_drift`, state by state.

use super::SecondOrder;
use crate::scalar::{Scalar, Simd, WithSimd};

/// Tangents that are weighted together.
pub const ROWS: usize = 4;

/// Tangents of a value of several units, and the sums they are added to.
pub(super) struct Contraction<'a, S> {
    /// Directions of the tangents, counted from 1, in rising order.
    pub velocities: &'a [usize],
    /// 1 if the tangent along the motion comes before them.
    pub drifts: usize,
    pub n: usize,
    pub lanes: usize,
    /// Tangents, `(channels, lanes, units)`.
    pub x: &'a [S],
    /// Adjoints and second slopes, `(lanes, units)`; `k` is their product.
    pub adjoint: &'a [S],
    pub d2: &'a [S],
    /// Room for `k`, `(units)`, and for `k x_i`, `(ROWS, units)`.
    pub curvature: &'a mut [S],
    pub along: &'a mut [S],
    pub mass: &'a mut [S],
    pub drift: &'a mut [S],
}

impl<S: Scalar> Contraction<'_, S> {
    #[inline(always)]
    fn tangent(&self, channel: usize, lane: usize) -> usize {
        (channel * self.lanes + lane) * self.curvature.len()
    }

    /// The sums of `R` tangents from `first` on with all from there on, and with the one along the motion.
    #[inline(always)]
    fn rows<V: Simd, const R: usize>(&mut self, simd: V, lane: usize, first: usize) -> usize {
        let units = self.curvature.len();
        for r in 0..R {
            let at = self.tangent(self.drifts + first + r, lane);
            let (along, x) = (&mut self.along[r * units..][..units], &self.x[at..][..units]);
            let k = &self.curvature[..units];
            for u in 0..units {
                along[u] = k[u] * x[u];
            }
        }
        let mut column = first;
        while column + 2 <= self.velocities.len() {
            self.block::<V, R, 2>(simd, lane, (first, column));
            column += 2;
        }
        if column < self.velocities.len() {
            self.block::<V, R, 1>(simd, lane, (first, column));
        }
        if self.drifts == 1 {
            let sums = self.dots::<V, R, 1>(simd, [self.tangent(0, lane)]);
            for r in 0..R {
                self.drift[(self.velocities[first + r] - 1) * self.lanes + lane] += sums[0][r];
            }
        }
        R
    }

    #[inline(always)]
    fn dots<V: Simd, const R: usize, const O: usize>(&self, simd: V, at: [usize; O]) -> [[S; R]; O] {
        let units = self.curvature.len();
        let (mut a, mut b): ([&[S]; R], [&[S]; O]) = ([&[]; R], [&[]; O]);
        for r in 0..R {
            a[r] = &self.along[r * units..][..units];
        }
        for o in 0..O {
            b[o] = &self.x[at[o]..][..units];
        }
        S::dots(simd, a, b)
    }

    /// Adds the part of the upper triangle that lies in a block.
    #[inline(always)]
    fn block<V: Simd, const R: usize, const O: usize>(&mut self, simd: V, lane: usize, (row, column): (usize, usize)) {
        let mut at = [0; O];
        for o in 0..O {
            at[o] = self.tangent(self.drifts + column + o, lane);
        }
        let sums = self.dots::<V, R, O>(simd, at);
        for o in 0..O {
            for r in 0..R {
                if row + r <= column + o {
                    let (i, j) = (self.velocities[row + r] - 1, self.velocities[column + o] - 1);
                    self.mass[SecondOrder::<S>::pair(self.n, i, j) * self.lanes + lane] += sums[o][r];
                }
            }
        }
    }
}

impl<S: Scalar> WithSimd for Contraction<'_, S> {
    type Output = ();

    // Loops over indices, not closures, which would not inherit the instruction set.
    #[inline(always)]
    fn with_simd<V: Simd>(mut self, simd: V) {
        let (units, count) = (self.curvature.len(), self.velocities.len());
        for lane in 0..self.lanes {
            let (adjoint, d2) = (&self.adjoint[lane * units..][..units], &self.d2[lane * units..][..units]);
            let k = &mut self.curvature[..units];
            for u in 0..units {
                k[u] = adjoint[u] * d2[u];
            }
            let mut first = 0;
            while first < count {
                first += match count - first {
                    1 => self.rows::<V, 1>(simd, lane, first),
                    2 => self.rows::<V, 2>(simd, lane, first),
                    3 => self.rows::<V, 3>(simd, lane, first),
                    _ => self.rows::<V, ROWS>(simd, lane, first),
                };
            }
        }
    }
}
