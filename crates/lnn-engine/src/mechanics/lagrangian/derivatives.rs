//! Computes `L`, `p`, `g`, `M`, `c` at one state with forward-mode numbers over any base type, floats or tracers; also the mass matrix with
//! its first and second derivatives by the coordinates, from which curvature is computed.

use super::error::MechanicsError;
use super::taylor::{Space, Taylor};
use super::{Lagrangian, Request};
use crate::forward::{Dual, HyperDual, Jet, array};
use crate::lagrangian::thresholds::BLOCK_VELOCITIES;
use crate::scalar::{Real, Scalar};
use crate::tape::Depth;
use alloc::vec::Vec;

/// Outputs for one state; slices that are not needed may be empty.
pub(super) struct StateTerms<'a, R> {
    pub lagrangian: &'a mut [R],
    pub momentum: &'a mut [R],
    pub dl_dq: &'a mut [R],
    pub mass_matrix: &'a mut [R],
    pub coriolis: &'a mut [R],
}

/// Computes the requested terms.
#[inline]
pub(super) fn evaluate<L: Lagrangian, R: Real>(
    system: &L,
    parameters: &[R],
    q: &[R],
    v: &[R],
    need: Request,
    out: &mut StateTerms<'_, R>,
) {
    if need.depth() <= Depth::Gradient {
        return first_order(system, parameters, q, v, need, out);
    }
    // The compiler evaluates these conditions, so that it generates no code for other numbers of coordinates.
    match q.len() {
        1 if const { may_be::<L>(1) } => jets::<L, R, 1, 2>(system, parameters, q, v, need, out),
        2 if const { may_be::<L>(2) } => jets::<L, R, 2, 3>(system, parameters, q, v, need, out),
        3 if const { may_be::<L>(3) } => jets::<L, R, 3, 4>(system, parameters, q, v, need, out),
        4 if const { may_be::<L>(4) } => jets::<L, R, 4, 5>(system, parameters, q, v, need, out),
        _ => {
            if const { may_be_large::<L>() } {
                directions(system, parameters, q, v, need, out);
            }
        }
    }
}

/// Returns `true` if a Lagrangian can have `n` coordinates.
const fn may_be<L: Lagrangian>(n: usize) -> bool {
    match L::COORDINATES {
        Some(declared) => declared == n,
        None => true,
    }
}

/// Returns `true` if a Lagrangian can have too many coordinates for jets.
const fn may_be_large<L: Lagrangian>() -> bool {
    match L::COORDINATES {
        Some(declared) => declared > 4,
        None => true,
    }
}

/// A vector stored in an array if it fits, so that a single state needs no allocation.
struct SmallVector<T> {
    array: [T; 8],
    vector: Vec<T>,
    length: usize,
}

impl<T: Real> SmallVector<T> {
    fn new<R: Copy>(numbers: &[R], lift: impl Fn(R) -> T) -> Self {
        let length = numbers.len();
        if length <= 8 {
            let array = array(|i| numbers.get(i).map_or_else(T::zero, |&x| lift(x)));
            Self { array, vector: Vec::new(), length }
        } else {
            Self { array: [T::zero(); 8], vector: numbers.iter().map(|&x| lift(x)).collect(), length }
        }
    }
    fn get(&mut self) -> &mut [T] {
        if self.length <= 8 { &mut self.array[..self.length] } else { &mut self.vector }
    }
}

/// Computes the value and the first derivatives, one direction at a time.
fn first_order<L: Lagrangian, R: Real>(
    system: &L,
    parameters: &[R],
    q: &[R],
    v: &[R],
    need: Request,
    out: &mut StateTerms<'_, R>,
) {
    if need.includes(Request::LAGRANGIAN) {
        out.lagrangian[0] = system.lagrangian(parameters, q, v);
    }
    let mut lifted = SmallVector::new(parameters, Dual::lift);
    let (mut dq, mut dv) = (SmallVector::new(q, Dual::lift), SmallVector::new(v, Dual::lift));
    let (parameters, dq, dv) = (lifted.get(), dq.get(), dv.get());
    for i in 0..q.len() {
        if need.includes(Request::DL_DQ) {
            dq[i].tangent = R::one();
            out.dl_dq[i] = system.lagrangian(parameters, dq, dv).tangent;
            dq[i].tangent = R::zero();
        }
        if need.includes(Request::MOMENTUM) {
            dv[i].tangent = R::one();
            out.momentum[i] = system.lagrangian(parameters, dq, dv).tangent;
            dv[i].tangent = R::zero();
        }
    }
}

/// Computes all terms in one evaluation, with second derivatives by the velocities and along `(v, 0)`; `N = H + 1`.
#[inline]
fn jets<L: Lagrangian, R: Real, const H: usize, const N: usize>(
    system: &L,
    parameters: &[R],
    q: &[R],
    v: &[R],
    need: Request,
    out: &mut StateTerms<'_, R>,
) {
    let mut lifted = SmallVector::new(parameters, Jet::<R, N, H>::lift);
    let mut jet_q = [Jet::lift(R::zero()); H];
    let mut jet_v = jet_q;
    for i in 0..H {
        jet_v[i] = Jet::variable(v[i], i);
        // The last second-order direction moves the coordinates along `v`; `dL/dq` only needs first-order directions.
        jet_q[i] = Jet::variable(q[i], N + i);
        jet_q[i].gradient[H] = v[i];
    }
    let found = system.lagrangian(lifted.get(), &jet_q, &jet_v);
    if need.includes(Request::LAGRANGIAN) {
        out.lagrangian[0] = found.value;
    }
    for i in 0..H {
        if need.includes(Request::DL_DQ) {
            out.dl_dq[i] = found.linear[i];
        }
        if need.includes(Request::MOMENTUM) {
            out.momentum[i] = found.gradient[i];
        }
        if need.includes(Request::MASS_MATRIX) {
            for j in 0..H {
                out.mass_matrix[i * H + j] = found.second(i, j);
            }
        }
        if need.includes(Request::CORIOLIS) {
            out.coriolis[i] = found.second(H, i);
        }
    }
}

/// Evaluates once per pair of directions: `(0, e_i) x (0, e_j)` for `M`, `(0, e_i) x (v, 0)` for `c`.
fn directions<L: Lagrangian, R: Real>(
    system: &L,
    parameters: &[R],
    q: &[R],
    v: &[R],
    need: Request,
    out: &mut StateTerms<'_, R>,
) {
    first_order(system, parameters, q, v, need, out);
    let n = q.len();
    let mut lifted = SmallVector::new(parameters, HyperDual::lift);
    let (mut hq, mut hv) = (SmallVector::new(q, HyperDual::lift), SmallVector::new(v, HyperDual::lift));
    let (parameters, hq, hv) = (lifted.get(), hq.get(), hv.get());
    for i in 0..n {
        hv[i].s = R::one();
        if need.includes(Request::MASS_MATRIX) {
            for j in 0..=i {
                hv[j].t = R::one();
                let mixed = system.lagrangian(parameters, hq, hv).st;
                hv[j].t = R::zero();
                out.mass_matrix[i * n + j] = mixed;
                out.mass_matrix[j * n + i] = mixed;
            }
        }
        if need.includes(Request::CORIOLIS) {
            for (number, &speed) in hq.iter_mut().zip(v) {
                number.t = speed;
            }
            out.coriolis[i] = system.lagrangian(parameters, hq, hv).st;
            for number in hq.iter_mut() {
                number.t = R::zero();
            }
        }
        hv[i].s = R::zero();
    }
}

/// Metric `g_ij = d2L/dv_i dv_j` at a point and its partial derivatives by the coordinates, exact to rounding.
///
/// The metric is the mass matrix: for `L = m g_ij v_i v_j / 2` it is `m g_ij`. If a Lagrangian is not quadratic in the velocities, the
/// metric is evaluated at the given velocity, which is held fixed in the derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricJet<S> {
    /// `g_ij`, `(n, n)`, symmetric.
    pub metric: Vec<S>,
    /// `d g_ij / dq_k` at `[k][i][j]`, `(n, n, n)`.
    pub first: Vec<S>,
    /// `d2 g_ij / dq_k dq_l` at `[k][l][i][j]`, `(n, n, n, n)`.
    pub second: Vec<S>,
}

impl<S: Scalar> MetricJet<S> {
    /// Zeros for `n` coordinates.
    fn zeros(n: usize) -> Self {
        let zeros = |rank: u32| vec![<S as Real>::zero(); n.pow(rank)];
        Self { metric: zeros(2), first: zeros(3), second: zeros(4) }
    }

    /// Number of coordinates `n`.
    pub fn coordinates(&self) -> usize {
        self.metric.len().isqrt()
    }
}

/// Computes the metric jets at states `(batch, n)` of a Lagrangian that is generic over numbers.
pub fn metric_jets<S: Scalar>(
    n: usize,
    (q, v): (&[S], &[S]),
    lagrangian: impl for<'a> Fn(&[Taylor<'a, S>], &[Taylor<'a, S>]) -> Taylor<'a, S>,
) -> Result<Vec<MetricJet<S>>, MechanicsError> {
    let shape = |what, expected, found| Err(MechanicsError::Shape { what, expected, found });
    if n == 0 || !q.len().is_multiple_of(n) {
        return shape("coordinates", q.len().next_multiple_of(n.max(1)), q.len());
    }
    if v.len() != q.len() {
        return shape("velocities", q.len(), v.len());
    }
    let groups = groups(n);
    let mut space = Space::new(n, n.min(BLOCK_VELOCITIES));
    let jet = |(q, v): (&[S], &[S])| {
        let mut jet = MetricJet::zeros(n);
        for group in &groups {
            space.clear();
            let positions: Vec<_> = q.iter().enumerate().map(|(i, &q)| space.position(i, q)).collect();
            let velocity = |(i, &v): (usize, &S)| match group.iter().position(|&of| of == i) {
                Some(place) => space.velocity(place, v),
                None => Taylor::constant(v),
            };
            let velocities: Vec<_> = v.iter().enumerate().map(velocity).collect();
            let value = lagrangian(&positions, &velocities);
            for (a, &i) in group.iter().enumerate() {
                for (b, &j) in group.iter().enumerate().take(a + 1) {
                    jet.take(&space, value, (a, b), (i, j));
                }
            }
        }
        jet
    };
    Ok(q.chunks_exact(n).zip(v.chunks_exact(n)).map(jet).collect())
}

/// Divides the velocities into groups such that every pair occurs in one of them.
fn groups(n: usize) -> Vec<Vec<usize>> {
    if n <= BLOCK_VELOCITIES {
        return vec![(0..n).collect()];
    }
    let blocks: Vec<Vec<usize>> =
        (0..n).step_by(BLOCK_VELOCITIES / 2).map(|i| (i..n.min(i + BLOCK_VELOCITIES / 2)).collect()).collect();
    let pairs = (0..blocks.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    pairs.map(|(a, b)| [blocks[b].as_slice(), &blocks[a]].concat()).collect()
}

impl<S: Scalar> MetricJet<S> {
    /// Copies `g_ij` and its derivatives from a Lagrangian whose velocities `a`, `b` belong to `i`, `j`.
    fn take(&mut self, space: &Space<S>, lagrangian: Taylor<'_, S>, (a, b): (usize, usize), (i, j): (usize, usize)) {
        let n = self.coordinates();
        let zero = <S as Real>::zero();
        let (mut value, mut first, mut second) = (zero, vec![zero; n], vec![zero; n * n]);
        space.velocity_hessian(lagrangian, (a, b), &mut value, &mut first, &mut second);
        for place in [i * n + j, j * n + i] {
            self.metric[place] = value;
            let derivatives = |to: &mut [S], from: &[S]| {
                to[place..].iter_mut().step_by(n * n).zip(from).for_each(|(to, &x)| *to = x);
            };
            derivatives(&mut self.first, &first);
            derivatives(&mut self.second, &second);
        }
    }
}
