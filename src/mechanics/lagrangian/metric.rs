//! The mass matrix with its first and second derivatives by the coordinates: the metric of `L` and what curvature is made of.

use super::error::MechanicsError;
use super::taylor::{Space, Taylor};
use crate::scalar::{Real, Scalar};

/// Metric `g_ij = d2L/dv_i dv_j` at a point, with its partial derivatives by the coordinates, exact to rounding.
///
/// The metric is the mass matrix as it is: of `L = m g_ij v_i v_j / 2` it is `m g_ij`. Of a Lagrangian that is not quadratic in
/// the velocities it is the one at the velocity given, which the derivatives keep.
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
    pub(crate) fn coordinates(&self) -> usize {
        self.metric.len().isqrt()
    }
}

/// Velocities that vary together at most: beyond, they are taken in blocks of half as many, two at a time.
const VELOCITIES: usize = 8;

/// The metric jets of states `(batch, n)` of a Lagrangian that is written over any number.
pub(crate) fn metric_jets<S: Scalar>(
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
    let mut space = Space::new(n, n.min(VELOCITIES));
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

/// Groups of velocities in which every pair stands together.
fn groups(n: usize) -> Vec<Vec<usize>> {
    if n <= VELOCITIES {
        return vec![(0..n).collect()];
    }
    let blocks: Vec<Vec<usize>> =
        (0..n).step_by(VELOCITIES / 2).map(|i| (i..n.min(i + VELOCITIES / 2)).collect()).collect();
    let pairs = (0..blocks.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    pairs.map(|(a, b)| [blocks[b].as_slice(), &blocks[a]].concat()).collect()
}

impl<S: Scalar> MetricJet<S> {
    /// Takes over `g_ij` and its derivatives from a Lagrangian whose velocities `a`, `b` are those of `i`, `j`.
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
