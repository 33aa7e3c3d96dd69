//! Where the energy of a motion went, and where it came from.

use super::force::pieces;
use super::gauss::{Tableau, lagrange};
use super::trajectory::CHUNK;
use super::{Force, RolloutError, Trajectory};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::scalar::{Real, Scalar};

/// Samples whose interpolating polynomial is integrated.
const SAMPLES: usize = 6;

/// Energy gained, energy lost to friction and work of a force from outside between the first and the last sample, in the
/// unit of `L`.
///
/// `dE/dt = v.Q - v.dD/dv` makes the change the work less the friction, up to the errors of the integration and of the
/// quadrature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyBalance<S> {
    /// `E` at the end less `E` at the start.
    pub change: S,
    /// Integral of the dissipated power `v.dD/dv` over time; 0 for a model that conserves its energy.
    pub dissipated: S,
    /// Integral of the power `v.Q` of the force from outside over time; 0 without one.
    pub work: S,
    /// Largest `|E|` of a sample: rounding errors are in its units.
    pub size: S,
}

impl<S: Scalar> EnergyBalance<S> {
    /// Energy that came from nowhere, `change + dissipated - work`.
    pub fn defect(&self) -> S {
        self.change + self.dissipated - self.work
    }

    /// The balance of a motion by `model`, perhaps under a force.
    pub(super) fn of(
        trajectory: &Trajectory<S>,
        model: &dyn EulerLagrange<S>,
        force: Option<&dyn Force<S>>,
    ) -> Result<Self, RolloutError> {
        let invalid = |problem: String| RolloutError::Invalid { what: "trajectory", problem };
        let zero = <S as Real>::zero();
        let Trajectory { coordinates, t, q, v, .. } = trajectory;
        let size = CHUNK * (*coordinates).max(1);
        let (mut energy, mut power) = (Vec::with_capacity(t.len()), Vec::with_capacity(t.len()));
        let mut terms = Terms::default();
        for (q, v) in q.chunks(size).zip(v.chunks(size)) {
            model
                .terms(q, v, Request::ENERGY | Request::FORCE, &mut terms)
                .map_err(|e| invalid(format!("samples from {}: {e}", energy.len())))?;
            energy.extend_from_slice(&terms.energy);
            power.extend_from_slice(&terms.dissipation);
            power.resize(energy.len(), zero);
        }
        let (Some(&first), Some(&last)) = (energy.first(), energy.last()) else {
            return Err(invalid("has no samples".to_string()));
        };
        let work = force.map_or(zero, |force| work(trajectory, force));
        if !work.is_finite() {
            return Err(invalid("the power of the force is not finite".to_string()));
        }
        let size = energy.iter().fold(zero, |size, e| S::max(size, e.abs()));
        Ok(Self { change: last - first, dissipated: integral(t, &power), work, size })
    }
}

impl<S: Scalar> Trajectory<S> {
    /// Energy balance of the motion by `model`; under a force from outside it is
    /// [`Driven::energy_balance`](super::Driven::energy_balance).
    ///
    /// The power is integrated through the polynomials of degree 5 through neighbouring samples, at the distances they
    /// have: the error is of order 6 in the distance of samples, as far as the power is smooth. The work of a force is
    /// integrated from the force itself along states so interpolated, between its breaks.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] if there is no sample, or a sample at which the model cannot be evaluated.
    pub fn energy_balance(&self, model: &dyn EulerLagrange<S>) -> Result<EnergyBalance<S>, RolloutError> {
        EnergyBalance::of(self, model, None)
    }
}

/// First of the samples whose polynomial stands for the interval before sample `k`, of `window` samples among `count`.
fn stencil(k: usize, count: usize, window: usize) -> usize {
    k.saturating_sub(SAMPLES / 2).min(count - window)
}

/// Integral of `v.Q` along the samples.
fn work<S: Scalar>(trajectory: &Trajectory<S>, force: &dyn Force<S>) -> S {
    let Trajectory { coordinates: n, t, q, v, .. } = trajectory;
    let (n, zero) = (*n, <S as Real>::zero());
    let Tableau { nodes, weights, .. } = Tableau::<S>::new(SAMPLES / 2);
    let window = SAMPLES.min(t.len());
    let (mut state, mut value) = (vec![zero; 2 * n], vec![zero; n]);
    let mut sum = zero;
    for k in 1..t.len() {
        let first = stencil(k, t.len(), window);
        let times = &t[first..first + window];
        let mut from = zero;
        for piece in pieces(near(force.breaks(), t[k - 1], t[k]), t[k - 1], t[k]) {
            let h = piece.end - from;
            let after: Vec<S> = nodes.iter().map(|&node| from + node * h).collect();
            let signed = |after: S| if t[k] < t[k - 1] { t[k - 1] - after } else { t[k - 1] + after };
            let points: Vec<S> = after.iter().map(|&after| signed(after)).collect();
            let basis = lagrange(times, &points);
            for ((row, &weight), &point) in basis.chunks_exact(window).zip(&weights).zip(&points) {
                state.fill(zero);
                for (&l, sample) in row.iter().zip(first..) {
                    let values = q[sample * n..(sample + 1) * n].iter().chain(&v[sample * n..(sample + 1) * n]);
                    state.iter_mut().zip(values).for_each(|(sum, &x)| *sum += l * x);
                }
                let (q, v) = state.split_at(n);
                force.force(piece.time(point), q, v, &mut value);
                let power = value.iter().zip(v).fold(zero, |sum, (&force, &v)| sum + force * v);
                sum += if t[k] < t[k - 1] { -(weight * h * power) } else { weight * h * power };
            }
            from = piece.end;
        }
    }
    sum
}

/// Of ascending breaks those that may lie in the interval between two times.
fn near<S: Scalar>(breaks: &[S], a: S, b: S) -> &[S] {
    let (low, high) = (S::min(a, b), S::max(a, b));
    let first = breaks.partition_point(|t| *t < low);
    let end = breaks.partition_point(|t| *t <= high);
    &breaks[first.min(end)..end]
}

/// Integral of samples `y` over the times `t`, in order: each interval by the polynomial through the samples around it.
fn integral<S: Scalar>(t: &[S], y: &[S]) -> S {
    let Tableau { nodes, weights, .. } = Tableau::<S>::new(SAMPLES / 2);
    let window = SAMPLES.min(t.len());
    let mut sum = <S as Real>::zero();
    for k in 1..t.len() {
        let first = stencil(k, t.len(), window);
        let h = t[k] - t[k - 1];
        let points: Vec<S> = nodes.iter().map(|&node| t[k - 1] + node * h).collect();
        let basis = lagrange(&t[first..first + window], &points);
        for (row, &weight) in basis.chunks_exact(window).zip(&weights) {
            let value = row.iter().zip(&y[first..]).fold(<S as Real>::zero(), |sum, (&l, &y)| sum + l * y);
            sum += weight * h * value;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_five_are_integrated_exactly_at_any_distances() {
        let t = [0.0f64, 0.1, 0.3, 0.35, 0.6, 0.8, 0.85, 1.0];
        let y = t.map(|t| 1.0 + 6.0 * t.powi(5));
        assert!((integral(&t, &y) - 2.0).abs() < 1e-14);
        let backwards: Vec<f64> = t.iter().rev().copied().collect();
        let values: Vec<f64> = y.iter().rev().copied().collect();
        assert!((integral(&backwards, &values) + 2.0).abs() < 1e-14);
        assert!((integral(&t[..2], &[1.0, 3.0]) - 0.2).abs() < 1e-15);
        assert_eq!(integral(&t[..1], &[7.0]), 0.0);
    }

    #[test]
    fn the_order_is_six() {
        let error = |n: usize| {
            let t: Vec<f64> = (0..=n).map(|k| k as f64 / n as f64).collect();
            let y: Vec<f64> = t.iter().map(|t| (2.0 * t).exp()).collect();
            (integral(&t, &y) - 0.5 * (2f64.exp() - 1.0)).abs()
        };
        let order = (error(20) / error(40)).log2();
        assert!((5.5..7.5).contains(&order), "{order}");
    }
}
