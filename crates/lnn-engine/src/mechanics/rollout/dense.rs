//! Interpolation within an accepted step.
//!
//! Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), section
//! II.6, and their codes DOPRI5 and DOP853. The interpolant is
//! `y0 + s (r1 + (1-s) (r2 + s (r3 + (1-s) (r4 + ...))))`, `s` in `[0, 1]` along the step; it meets `y` and `dy/dt` at
//! both ends.

use crate::scalar::{Real, Scalar};

/// A right-hand side `dy = f(t, y)`, where `t` is the elapsed time.
pub(super) type Rhs<'a, S, E> = dyn FnMut(S, &[S], &mut [S]) -> Result<(), E> + 'a;

/// Weights of the stages for the fifth coefficient of DOPRI5 (Shampine's, order 4).
const DOPRI5: Weights = &[
    (1, -12715105075.0 / 11282082432.0),
    (3, 87487479700.0 / 32700410799.0),
    (4, -10690763975.0 / 1880347072.0),
    (5, 701980252875.0 / 199316789632.0),
    (6, -1453857185.0 / 822651844.0),
    (7, 69997945.0 / 29380423.0),
];

/// `(index of the stage, weight)`, stages counted from 1.
type Weights = &'static [(usize, f64)];

/// Nodes of stages 14 to 16.
const EXTRA_NODES: [f64; 3] = [0.1, 0.2, 7.0 / 9.0];

/// Stages 14 to 16: `(index of k, weight)`; the row sums are the nodes.
const EXTRA: [Weights; 3] = [
    &[
        (1, 0.056167502283047954),
        (7, 0.25350021021662483),
        (8, -0.2462390374708025),
        (9, -0.12419142326381637),
        (10, 0.15329179827876568),
        (11, 0.00820105229563469),
        (12, 0.007567897660545699),
        (13, -0.008298),
    ],
    &[
        (1, 0.03183464816350214),
        (6, 0.028300909672366776),
        (7, 0.053541988307438566),
        (8, -0.05492374857139099),
        (11, -0.00010834732869724932),
        (12, 0.0003825710908356584),
        (13, -0.00034046500868740456),
        (14, 0.1413124436746325),
    ],
    &[
        (1, -0.42889630158379194),
        (6, -4.697621415361164),
        (7, 7.683421196062599),
        (8, 4.06898981839711),
        (9, 0.3567271874552811),
        (13, -0.0013990241651590145),
        (14, 2.9475147891527724),
        (15, -9.15095847217987),
    ],
];

/// Weights of the stages for the four highest coefficients.
const DENSE: [Weights; 4] = [
    &[
        (1, -8.428938276109013),
        (6, 0.5667149535193777),
        (7, -3.0689499459498917),
        (8, 2.38466765651207),
        (9, 2.117034582445028),
        (10, -0.871391583777973),
        (11, 2.2404374302607883),
        (12, 0.6315787787694688),
        (13, -0.08899033645133331),
        (14, 18.148505520854727),
        (15, -9.194632392478356),
        (16, -4.436036387594894),
    ],
    &[
        (1, 10.427508642579134),
        (6, 242.28349177525817),
        (7, 165.20045171727028),
        (8, -374.5467547226902),
        (9, -22.113666853125306),
        (10, 7.733432668472264),
        (11, -30.674084731089398),
        (12, -9.332130526430229),
        (13, 15.697238121770845),
        (14, -31.139403219565178),
        (15, -9.35292435884448),
        (16, 35.81684148639408),
    ],
    &[
        (1, 19.985053242002433),
        (6, -387.0373087493518),
        (7, -189.17813819516758),
        (8, 527.8081592054236),
        (9, -11.57390253995963),
        (10, 6.8812326946963),
        (11, -1.0006050966910838),
        (12, 0.7777137798053443),
        (13, -2.778205752353508),
        (14, -60.19669523126412),
        (15, 84.32040550667716),
        (16, 11.99229113618279),
    ],
    &[
        (1, -25.69393346270375),
        (6, -154.18974869023643),
        (7, -231.5293791760455),
        (8, 357.6391179106141),
        (9, 93.40532418362432),
        (10, -37.45832313645163),
        (11, 104.0996495089623),
        (12, 29.8402934266605),
        (13, -43.53345659001114),
        (14, 96.32455395918828),
        (15, -39.17726167561544),
        (16, -149.72683625798564),
    ],
];

/// One accepted step of size `h` from `y0` to `y1`; `slopes` contains the stages `k1`, `k2`, ... in order.
pub(super) struct Step<'a, S> {
    /// Elapsed time at its start.
    pub t0: S,
    /// Size.
    pub h: S,
    /// State at its start.
    pub y0: &'a [S],
    /// State at its end.
    pub y1: &'a [S],
    /// Stages: seven for DOPRI5, thirteen for DOP853; the last is the derivative at `y1`.
    pub slopes: &'a [S],
}

/// Interpolant of the latest step; buffers are reused.
#[derive(Debug, Default)]
pub(super) struct Interpolant<S> {
    dim: usize,
    coefficients: Vec<S>,
    slopes: Vec<S>,
    state: Vec<S>,
}

impl<S: Scalar> Interpolant<S> {
    /// Computes the interpolant of order 4 of a DOPRI5 step.
    pub fn dopri5(&mut self, step: &Step<'_, S>) {
        self.hermite(step, 7, 5);
        self.weigh(step.h, 4, DOPRI5);
    }

    /// Computes the interpolant of order 7 of a DOP853 step, with three evaluations of `f(t, y, dy)`.
    ///
    /// # Errors
    /// The first error of `f`.
    pub fn dop853<E>(&mut self, step: &Step<'_, S>, f: &mut Rhs<'_, S, E>) -> Result<(), E> {
        self.hermite(step, 13, 8);
        let dim = self.dim;
        for (weights, node) in EXTRA.iter().zip(EXTRA_NODES) {
            self.state.clear();
            self.state.extend_from_slice(step.y0);
            for (i, y) in self.state.iter_mut().enumerate() {
                *y += step.h * combine(&self.slopes, dim, i, weights);
            }
            let start = self.slopes.len();
            self.slopes.resize(start + dim, <S as Real>::zero());
            f(step.t0 + S::of_f64(node) * step.h, &self.state, &mut self.slopes[start..])?;
        }
        for (row, weights) in DENSE.iter().enumerate() {
            self.weigh(step.h, 4 + row, weights);
        }
        Ok(())
    }

    /// Writes the state at the fraction `s` of the step.
    pub fn evaluate(&self, s: S, state: &mut [S]) {
        let rest = <S as Real>::one() - s;
        let rows = self.coefficients.len() / self.dim.max(1);
        for (i, y) in state.iter_mut().enumerate() {
            let mut sum = <S as Real>::zero();
            for row in (0..rows).rev() {
                sum = self.coefficients[row * self.dim + i] + sum * if row % 2 == 0 { s } else { rest };
            }
            *y = sum;
        }
    }

    /// Computes the four coefficients that both methods share, and allocates the others.
    fn hermite(&mut self, step: &Step<'_, S>, stages: usize, rows: usize) {
        let dim = step.y0.len();
        self.dim = dim;
        self.slopes.clear();
        self.slopes.extend_from_slice(&step.slopes[..stages * dim]);
        self.coefficients.clear();
        self.coefficients.resize(rows * dim, <S as Real>::zero());
        for i in 0..dim {
            let change = step.y1[i] - step.y0[i];
            let bend = step.h * self.slopes[i] - change;
            self.coefficients[i] = step.y0[i];
            self.coefficients[dim + i] = change;
            self.coefficients[2 * dim + i] = bend;
            self.coefficients[3 * dim + i] = change - step.h * self.slopes[(stages - 1) * dim + i] - bend;
        }
    }

    fn weigh(&mut self, h: S, row: usize, weights: &[(usize, f64)]) {
        for i in 0..self.dim {
            self.coefficients[row * self.dim + i] = h * combine(&self.slopes, self.dim, i, weights);
        }
    }
}

/// Returns the Hermite interpolation at the fraction `x` of a step of signed length `h`, given values and slopes `[q0, v0, q1, v1]` at both
/// ends.
pub(super) fn cubic<S: Scalar>(x: S, h: S, [q0, v0, q1, v1]: [S; 4]) -> S {
    let one = <S as Real>::one();
    let (y, all) = (one - x, x * x * (S::of_f64(3.0) - S::of_f64(2.0) * x));
    q0 * (one - all) + q1 * all + h * x * y * (v0 * y - v1 * x)
}

/// Returns the slope of the Hermite interpolation.
pub(super) fn cubic_slope<S: Scalar>(x: S, h: S, [q0, v0, q1, v1]: [S; 4]) -> S {
    let (one, three) = (<S as Real>::one(), S::of_f64(3.0));
    let y = one - x;
    S::of_f64(6.0) * x * y * ((q1 - q0) / h) + v0 * y * (one - three * x) + v1 * x * (one - three * y)
}

/// Computes `sum weight * k_stage` of component `i`; stages are counted from 1.
fn combine<S: Scalar>(slopes: &[S], dim: usize, i: usize, weights: &[(usize, f64)]) -> S {
    let mut sum = <S as Real>::zero();
    for &(stage, weight) in weights {
        sum += S::of_f64(weight) * slopes[(stage - 1) * dim + i];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_sum_to_their_nodes() {
        let sum = |weights: &[(usize, f64)]| weights.iter().map(|w| w.1).sum::<f64>();
        for (weights, node) in EXTRA.iter().zip(EXTRA_NODES) {
            assert!((sum(weights) - node).abs() < 1e-14, "{node}: {}", sum(weights));
        }
        // For a constant derivative only the first two coefficients are nonzero.
        assert!(sum(DOPRI5).abs() < 1e-14);
        for weights in DENSE {
            let scale: f64 = weights.iter().map(|w| w.1.abs()).sum();
            assert!(sum(weights).abs() < 1e-14 * scale, "{}", sum(weights));
        }
    }
}
