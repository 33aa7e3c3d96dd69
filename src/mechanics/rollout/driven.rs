//! A model under a force from outside.

use super::pieces::{Ending, hand_over};
use super::run::{adaptive_or_fixed, fixed};
use super::{EnergyBalance, Force, Integrable, Options, Rollout, RolloutError, Trajectory};
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar};
use std::ops::ControlFlow;

/// A model and a force `Q(t, q, v)` that acts on it from outside, beside its own friction: `M a = g - c - dD/dv + Q`.
///
/// ```
/// use lnn::lagrangian::configure;
/// use lnn::rollout::{Driven, Options};
///
/// let arm = configure::<f64>("double-pendulum", &[])?.build()?;
/// // A motor in the shoulder, in N m, and a brake in the elbow.
/// let motor = |t: f64, _: &[f64], v: &[f64], force: &mut [f64]| {
///     force[0] = 2.0 * t.sin();
///     force[1] = -0.5 * v[1];
/// };
/// let driven = Driven::new(arm.as_ref(), &motor);
/// let motion = driven.rollout(&[0.0, 0.0], &[0.0, 0.0], &Options::reference(5.0, 0.01)).complete()?;
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
    /// The model under the force.
    pub fn new(model: &'a dyn EulerLagrange<S>, force: &'a dyn Force<S>) -> Self {
        Self { model, force }
    }

    /// [`rollout`](super::rollout) under the force, by any method. Energies are those of the model, which the force
    /// changes; the variational method takes the force into its discrete equations (Marsden and West 2001, 3.2.1).
    pub fn rollout(&self, q: &[S], v: &[S], options: &Options<S>) -> Rollout<S>
    where
        S: Integrable,
    {
        adaptive_or_fixed(self.model, Some(self.force), q, v, options)
    }

    /// [`rollout_in_pieces`](super::rollout_in_pieces) under the force.
    pub(crate) fn rollout_in_pieces(
        &self,
        q: &[S],
        v: &[S],
        options: &Options<S>,
        take: &mut dyn FnMut(&Trajectory<S>) -> ControlFlow<()>,
    ) -> Ending
    where
        S: Integrable,
    {
        hand_over(self.model, Some(self.force), (q, v), options, take)
    }

    /// [`rollout_fixed`](super::rollout_fixed) under the force.
    pub fn rollout_fixed(&self, q: &[S], v: &[S], options: &Options<S>) -> Rollout<S> {
        fixed(self.model, Some(self.force), q, v, options)
    }

    /// [`Trajectory::energy_balance`] with the work of the force.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] if there is no sample, or a sample at which the model or the force cannot be evaluated.
    pub fn energy_balance(&self, trajectory: &Trajectory<S>) -> Result<EnergyBalance<S>, RolloutError> {
        EnergyBalance::of(trajectory, self.model, Some(self.force))
    }

    /// Accelerations `(n)` of one state at time `t`, for external solvers.
    ///
    /// # Errors
    /// [`MechanicsError`] of the model; a force that is not finite.
    pub fn acceleration(&self, t: S, q: &[S], v: &[S]) -> Result<Vec<S>, MechanicsError> {
        let (mut terms, mut force) = (Terms::default(), vec![<S as Real>::zero(); q.len()]);
        self.model.terms(q, v, Request::ACCELERATION, &mut terms)?;
        self.force.force(t, q, v, &mut force);
        terms.add_force(self.model.coordinates(), v, &force, &mut Workspace::new())?;
        Ok(terms.acceleration)
    }
}
