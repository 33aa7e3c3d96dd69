//! External forces, which act in addition to the Lagrangian and the friction.

use super::pieces::{Ending, hand_over};
use super::run::{adaptive_or_fixed, fixed};
use super::{Between, EnergyBalance, Integrable, Rollout, RolloutError, RolloutOptions, Trajectory};
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar};
use std::cmp::Ordering;
use std::ops::ControlFlow;

/// An external generalized force `Q(t, q, v)`, added to the right side of `M a = g - c + Q`.
///
/// Implemented for closures `Fn(t, q, v, &mut force)`, and for recorded forces: [`SampledForce`].
pub trait Force<S: Scalar>: Send + Sync {
    /// Writes `Q` at time `t` and state `(q, v)` to `force`; all three slices have `n` numbers. `Q_i` is conjugate to `q_i`: N for a length
    /// in m, N m for an angle in rad, in general the unit of `L` per unit of the coordinate.
    fn force(&self, t: S, q: &[S], v: &[S], force: &mut [S]);

    /// Returns ascending times at which the force is not smooth. Integrators end a step at each of them to keep their order. The force may
    /// jump there: the step before evaluates it just before such a time, and the next step at it.
    fn breaks(&self) -> &[S] {
        &[]
    }
}

impl<S: Scalar, F: Fn(S, &[S], &[S], &mut [S]) + Send + Sync> Force<S> for F {
    fn force(&self, t: S, q: &[S], v: &[S], force: &mut [S]) {
        self(t, q, v, force);
    }
}

/// A force that is known at some times: interpolated linearly, unless [`SampledForce::between`] chooses another interpolation, and constant
/// before the first and after the last time.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledForce<S> {
    n: usize,
    times: Vec<S>,
    values: Vec<S>,
    between: Between,
}

impl<S: Scalar> SampledForce<S> {
    /// Creates a force from values `(times, n)`, row-major, at one or more ascending times.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] if there is no time, the number of values is wrong, times do not ascend, or numbers are not finite.
    pub fn new(n: usize, times: Vec<S>, values: Vec<S>) -> Result<Self, RolloutError> {
        let invalid = |problem: String| Err(RolloutError::Invalid { what: "force", problem });
        if n == 0 || times.is_empty() {
            return invalid("has no values".to_string());
        }
        if values.len() != times.len() * n {
            return invalid(format!("expected {} numbers, found {}", times.len() * n, values.len()));
        }
        if let Some(at) = times.iter().chain(&values).position(|x| !x.is_finite()) {
            return invalid(format!("number {at} of times and values is not finite"));
        }
        if let Some(at) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
            return invalid(format!("time {} does not come after the one before", at + 1));
        }
        Ok(Self { n, times, values, between: Between::default() })
    }

    /// Returns the same values with another interpolation.
    #[must_use]
    pub fn between(self, between: Between) -> Self {
        Self { between, ..self }
    }

    /// Returns a constant force.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] if there are no numbers, or numbers are not finite.
    pub fn constant(values: Vec<S>) -> Result<Self, RolloutError> {
        Self::new(values.len(), vec![<S as Real>::zero()], values)
    }

    /// Returns some of the components, in order.
    pub fn components(&self, of: core::ops::Range<usize>) -> Self {
        let values = self.values.chunks_exact(self.n).flat_map(|row| &row[of.clone()]).copied().collect();
        Self { n: of.len(), values, ..self.clone() }
    }

    /// Returns `true` if the force is 0 at all times.
    pub fn is_zero(&self) -> bool {
        self.values.iter().all(|value| *value == <S as Real>::zero())
    }

    /// Returns the first and the last time.
    pub fn span(&self) -> (S, S) {
        (self.times[0], self.times[self.times.len() - 1])
    }

    /// Writes `Q` at a time to `force`, `(n)`.
    pub fn at(&self, t: S, force: &mut [S]) {
        let (n, last) = (self.n, self.times.len() - 1);
        if t >= self.times[last] || last == 0 {
            return force.copy_from_slice(&self.values[last * n..]);
        }
        let after = self.times.partition_point(|&known| known <= t).max(1);
        let (t0, t1) = (self.times[after - 1], self.times[after]);
        let zero = <S as Real>::zero();
        force.fill(zero);
        self.between.weigh(&self.times, (after, S::max((t - t0) / (t1 - t0), zero)), |sample, weight| {
            let row = &self.values[sample * n..(sample + 1) * n];
            force.iter_mut().zip(row).for_each(|(force, &value)| *force += weight * value);
        });
    }
}

impl<S: Scalar> Force<S> for SampledForce<S> {
    fn force(&self, t: S, _: &[S], _: &[S], force: &mut [S]) {
        self.at(t, force);
    }

    fn breaks(&self) -> &[S] {
        if self.times.len() > 1 { &self.times } else { &[] }
    }
}

/// An interval of a motion in which the force is smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece<S> {
    /// Elapsed time `|t - t0|` at its end.
    pub(super) end: S,
    /// First and last times at which the force is evaluated; the last one is just before a break.
    lower: S,
    upper: S,
}

impl<S: Scalar> Piece<S> {
    /// Returns the time nearest to `t` within the piece.
    pub(super) fn time(&self, t: S) -> S {
        S::max(S::min(t, self.upper), self.lower)
    }
}

/// Divides the time from `t0` to `t_end` at the breaks; without breaks there is one piece.
pub(super) fn pieces<S: Scalar>(breaks: &[S], t0: S, t_end: S) -> Vec<Piece<S>> {
    let (low, high) = if t_end < t0 { (t_end, t0) } else { (t0, t_end) };
    // Times closer than this are equal.
    let blur = S::epsilon().ldexp(3) * S::max(low.abs(), high.abs());
    let mut cuts: Vec<S> = breaks.iter().copied().filter(|b| *b > low + blur && *b < high - blur).collect();
    cuts.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    cuts.dedup_by(|next, last| (*next - *last).abs() <= blur);
    let at_end = breaks.iter().any(|b| (*b - high).abs() <= blur);
    let bounds: Vec<S> = [low].into_iter().chain(cuts).chain([high]).collect();
    let mut pieces: Vec<Piece<S>> = bounds
        .windows(2)
        .enumerate()
        .map(|(k, pair)| {
            let (lower, end) = (pair[0], pair[1]);
            let is_break = k + 2 < bounds.len() || at_end;
            let upper = if is_break { S::max(end - blur, lower) } else { end };
            Piece { end: if t_end < t0 { t0 - lower } else { end - t0 }, lower, upper }
        })
        .collect();
    if t_end < t0 {
        pieces.reverse();
    }
    pieces
}

/// A model with an external force `Q(t, q, v)` in addition to its own friction: `M a = g - c - dD/dv + Q`.
///
/// ```
/// use lnn::lagrangian::SystemInstance;
/// use lnn::rollout::{Driven, RolloutOptions};
///
/// let arm = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
/// // A motor in the shoulder, in N m, and a brake in the elbow.
/// let motor = |t: f64, _: &[f64], v: &[f64], force: &mut [f64]| {
///     force[0] = 2.0 * t.sin();
///     force[1] = -0.5 * v[1];
/// };
/// let driven = Driven::new(arm.as_ref(), &motor);
/// let motion = driven.rollout(&[0.0, 0.0], &[0.0, 0.0], &RolloutOptions::reference(5.0, 0.01)).complete()?;
/// let balance = driven.energy_balance(&motion)?;
/// assert!(balance.defect().abs() < 1e-8 * balance.work.abs());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct Driven<'a, S: Scalar> {
    model: &'a dyn EulerLagrange<S>,
    force: &'a dyn Force<S>,
}

impl<'a, S: Scalar> Driven<'a, S> {
    /// Adds the force to a model.
    pub fn new(model: &'a dyn EulerLagrange<S>, force: &'a dyn Force<S>) -> Self {
        Self { model, force }
    }

    /// Does the same as [`rollout`](super::rollout) with the force, by any method. Energies are those of the model, which the force
    /// changes; the variational method includes the force in its discrete equations (Marsden and West 2001, 3.2.1).
    pub fn rollout(&self, q: &[S], v: &[S], options: &RolloutOptions<S>) -> Rollout<S>
    where
        S: Integrable,
    {
        adaptive_or_fixed(self.model, Some(self.force), q, v, options)
    }

    /// Does the same as [`rollout_in_pieces`](super::rollout_in_pieces) with the force.
    pub fn rollout_in_pieces(
        &self,
        q: &[S],
        v: &[S],
        options: &RolloutOptions<S>,
        take: &mut dyn FnMut(&Trajectory<S>) -> ControlFlow<()>,
    ) -> Ending<S>
    where
        S: Integrable,
    {
        hand_over(self.model, Some(self.force), (q, v), options, take)
    }

    /// Does the same as [`rollout_fixed`](super::rollout_fixed) with the force.
    pub fn rollout_fixed(&self, q: &[S], v: &[S], options: &RolloutOptions<S>) -> Rollout<S> {
        fixed(self.model, Some(self.force), q, v, options)
    }

    /// Does the same as [`Trajectory::energy_balance`], including the work of the force.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] if there is no sample, or the model or the force cannot be evaluated at a sample.
    pub fn energy_balance(&self, trajectory: &Trajectory<S>) -> Result<EnergyBalance<S>, RolloutError> {
        EnergyBalance::of(trajectory, self.model, Some(self.force))
    }

    /// Computes the accelerations, `(n)`, of one state at time `t`, for external solvers.
    ///
    /// # Errors
    /// [`MechanicsError`] of the model; also if the force is not finite.
    pub fn acceleration(&self, t: S, q: &[S], v: &[S]) -> Result<Vec<S>, MechanicsError> {
        let (mut terms, mut force) = (Terms::default(), vec![<S as Real>::zero(); q.len()]);
        self.model.terms_at(&[t], q, v, Request::ACCELERATION, &mut terms)?;
        self.force.force(t, q, v, &mut force);
        terms.add_force(self.model.coordinates(), v, &force, &mut Workspace::new())?;
        Ok(terms.acceleration)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

    #[test]
    fn samples_are_joined_by_lines_and_held_at_the_ends() {
        let force = SampledForce::new(2, vec![1.0, 2.0, 4.0], vec![0.0, 1.0, 2.0, 1.0, -2.0, 5.0]).unwrap();
        let at = |t: f64| {
            let mut values = [f64::NAN; 2];
            force.force(t, &[], &[], &mut values);
            values
        };
        assert_eq!(
            [at(-1.0), at(1.0), at(1.5), at(3.0), at(9.0)],
            [[0.0, 1.0], [0.0, 1.0], [1.0, 1.0], [0.0, 3.0], [-2.0, 5.0]]
        );
        assert_eq!((force.breaks(), force.span()), (&[1.0, 2.0, 4.0][..], (1.0, 4.0)));
        let steady = SampledForce::constant(vec![Dd::of_f64(3.0)]).unwrap();
        let mut value = [Dd::default()];
        steady.at(Dd::of_f64(7.0), &mut value);
        assert!(value[0] == Dd::of_f64(3.0) && steady.breaks().is_empty());
    }

    #[test]
    fn nonsense_is_refused() {
        let says = |n, times: &[f64], values: &[f64], part: &str| {
            let text = SampledForce::new(n, times.to_vec(), values.to_vec()).unwrap_err().to_string();
            assert!(text.contains(part), "{text}");
        };
        says(1, &[], &[], "no values");
        says(2, &[0.0], &[1.0], "expected 2 numbers, found 1");
        says(1, &[0.0, 0.0], &[1.0, 1.0], "time 1");
        says(1, &[0.0, 1.0], &[1.0, f64::NAN], "number 3");
    }

    #[test]
    fn time_is_cut_at_breaks_in_both_directions() {
        let breaks = [-1.0, 0.0, 1.0, 1.0 + 1e-16, 2.5, 3.0, 9.0];
        let ends = |t0: f64, t_end: f64| pieces(&breaks, t0, t_end).iter().map(|p| p.end).collect::<Vec<_>>();
        assert_eq!(ends(0.0, 3.0), [1.0, 2.5, 3.0]);
        assert_eq!(ends(3.0, 0.0), [0.5, 2.0, 3.0]);
        assert_eq!(ends(0.25, 0.5), [0.25]);
        assert_eq!(ends(2.0, 2.0), [0.0]);
        let cut = pieces(&breaks, 0.0, 3.0);
        // The piece before a break evaluates just before it, and the piece after the break at it.
        assert!(cut[0].time(1.0) < 1.0 && cut[1].time(1.0 - 1e-16) == 1.0 && cut[2].time(3.0) < 3.0);
        assert_eq!(pieces(&[], -1.0, 2.0)[0].time(2.0), 2.0);
    }
}
