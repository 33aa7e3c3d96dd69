//! Residuals of the samples of a chunk of segments, and of the joints at their ends.

use crate::scalar::{Real, Scalar, Sum};
use crate::shooting::integrator::SegmentIntegrator;
use crate::shooting::segments::Segments;

/// `r^2` up to `|r| = bound`, linear beyond with the same slope (Huber 1964, twice his function).
#[derive(Clone, Copy, Debug)]
pub(super) struct Huber<S> {
    bound: S,
    is_finite: bool,
}

impl<S: Scalar> Huber<S> {
    pub fn new(bound: f64) -> Self {
        Self { bound: S::of_f64(bound), is_finite: bound.is_finite() }
    }

    /// Value and derivative.
    #[inline]
    pub fn of(&self, r: S) -> (S, S) {
        let two = <S as Real>::two();
        if !self.is_finite || r.abs() <= self.bound {
            return (r * r, two * r);
        }
        let signed = if r > <S as Real>::zero() { self.bound } else { -self.bound };
        (self.bound * (two * r.abs() - self.bound), two * signed)
    }

    /// The curvature in iteratively reweighted least squares, `rho'(r) / r`.
    #[inline]
    pub fn curvature(&self, r: S) -> S {
        let two = <S as Real>::two();
        if !self.is_finite || r.abs() <= self.bound { two } else { two * self.bound / r.abs() }
    }
}

/// One residual: prediction minus observation in units of noise, with the coefficients of the prediction.
pub(super) struct Residual<S> {
    /// Index of the coordinate.
    pub i: usize,
    /// Step whose two ends determine the prediction, and their coefficients.
    pub step: usize,
    pub factors: [S; 4],
    /// Standard deviation.
    pub tau: S,
    pub value: S,
}

/// Calls `with` for every residual of segment `segment`, which is row `row` of the integrated chunk.
pub(super) fn each_residual<S: Scalar>(
    integrator: &SegmentIntegrator<S>,
    segments: &Segments<S>,
    (row, segment): (usize, usize),
    mut with: impl FnMut(Residual<S>),
) {
    let n = segments.n;
    let size = integrator.alive.len() * n;
    let segment = &segments.list[segment];
    for sample in segment.samples.clone() {
        let place = &segments.places[sample];
        let at = place.step * size + row * n;
        for i in 0..n {
            let (q, v) = (&integrator.q, &integrator.v);
            let ends = [q[at + i], v[at + i], q[at + size + i], v[at + size + i]];
            let mut call = |factors: [S; 4], observed: S, tau: S| {
                let predicted =
                    (factors[0] * ends[0] + factors[1] * ends[1]) + (factors[2] * ends[2] + factors[3] * ends[3]);
                with(Residual { i, step: place.step, factors, tau, value: (predicted - observed) / tau });
            };
            call(place.position, segments.q[sample * n + i], segments.tau[i]);
            if segment.has_velocity {
                call(place.velocity, segments.v[sample * n + i], segments.tau[n + i]);
            }
        }
    }
}

/// Gap at the end of a segment in units of `tau`: its end minus the start of the next segment, `next` of shape `(2, n)`.
pub(super) fn gap<S: Scalar>(
    integrator: &SegmentIntegrator<S>,
    segments: &Segments<S>,
    (row, segment): (usize, usize),
    next: &[S],
    k: usize,
) -> S {
    let n = segments.n;
    let at = (segments.steps * integrator.alive.len() + row) * n;
    let end = if k < n { integrator.q[at + k] - segments.list[segment].jump[k] } else { integrator.v[at + k - n] };
    (end - next[k]) / segments.tau[k]
}

/// Loss of one row of a chunk; its derivatives are added to the adjoints of the steps' states, and those by the start of the next segment
/// are written to `next_gradient`.
///
/// `weight` multiplies every residual, `continuity` every gap; the reported sums contain neither weight, and gaps are summed separately.
pub(super) fn add_loss<S: Scalar>(
    integrator: &mut SegmentIntegrator<S>,
    segments: &Segments<S>,
    (row, segment): (usize, usize),
    starts: &[S],
    huber: Huber<S>,
    (weight, continuity): (S, S),
    (next_gradient, sums): (&mut [S], &mut [Sum<S>; 2]),
) {
    let n = segments.n;
    let size = integrator.alive.len() * n;
    let (mut q_adjoint, mut v_adjoint) =
        (std::mem::take(&mut integrator.q_adjoint), std::mem::take(&mut integrator.v_adjoint));
    each_residual(integrator, segments, (row, segment), |residual| {
        let (value, slope) = huber.of(residual.value);
        sums[0].add(value);
        let seed = weight * slope / residual.tau;
        let at = residual.step * size + row * n + residual.i;
        q_adjoint[at] += seed * residual.factors[0];
        v_adjoint[at] += seed * residual.factors[1];
        q_adjoint[at + size] += seed * residual.factors[2];
        v_adjoint[at + size] += seed * residual.factors[3];
    });
    if segments.list[segment].has_next {
        let next = &starts[(segment + 1) * 2 * n..][..2 * n];
        let at = (segments.steps * integrator.alive.len() + row) * n;
        for k in 0..2 * n {
            let (value, slope) = huber.of(gap(integrator, segments, (row, segment), next, k));
            sums[1].add(value);
            let seed = continuity * slope / segments.tau[k];
            if k < n {
                q_adjoint[at + k] += seed
            } else {
                v_adjoint[at + k - n] += seed
            }
            next_gradient[k] = -seed;
        }
    }
    (integrator.q_adjoint, integrator.v_adjoint) = (q_adjoint, v_adjoint);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn huber_is_smooth_at_its_bound() {
        let huber = Huber::<f64>::new(3.0);
        assert_eq!((huber.of(2.0), huber.of(-2.0)), ((4.0, 4.0), (4.0, -4.0)));
        assert_eq!((huber.of(5.0), huber.of(-5.0)), ((21.0, 6.0), (21.0, -6.0)));
        assert_eq!(huber.of(3.0), (9.0, 6.0));
        assert_eq!((huber.curvature(1.0), huber.curvature(6.0)), (2.0, 1.0));
        assert_eq!(Huber::<f64>::new(f64::INFINITY).of(1e9), (1e18, 2e9));
    }
}
