//! Wrappers of models: with forces that are not in the Lagrangian, that is, generalized forces `Q(q, v)` or Rayleigh dissipation; and with
//! a flag that ends the motion.

use super::linearization::{ProgramSlopes, Rate, SlopePrograms, add_jacobian, with_force};
use super::{EulerLagrange, Manifold, MechanicsError, MetricJet, Request, Slopes, Solved, Terms};
use crate::forward::Dual;
use crate::scalar::{Dd, Real, Scalar};
use crate::tape::Program;
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, Ordering};

/// Generalized forces that do not follow from a Lagrangian; also implemented for closures `Fn(&[S], &[S], &mut [S])` of coordinates,
/// velocities and forces.
pub trait GeneralizedForce<S>: Send + Sync {
    /// Writes `Q(q, v)` of one state; all three slices have length `n`, in physical units (N, N m).
    fn force(&self, q: &[S], v: &[S], force: &mut [S]);

    /// Writes `dQ/dq` and `dQ/dv` of one state, `(n, n)` each, with a row for each component of the force. By default it uses central
    /// differences of the fourth order, with errors of about `eps^(4/5)`.
    fn jacobian(&self, q: &[S], v: &[S], by_q: &mut [S], by_v: &mut [S])
    where
        S: Scalar,
    {
        by_q.fill(<S as Real>::zero());
        by_v.fill(<S as Real>::zero());
        add_jacobian(self, (q, v), by_q, by_v);
    }

    /// Returns the derivatives for a [`Linearizer`](super::Linearizer), for a force that provides more than [`jacobian`](Self::jacobian).
    #[doc(hidden)]
    fn slopes(&self, _coordinates: usize) -> Option<Box<dyn Slopes<S> + '_>>
    where
        S: Scalar,
    {
        None
    }
}

impl<S, F: Fn(&[S], &[S], &mut [S]) + Send + Sync> GeneralizedForce<S> for F {
    fn force(&self, q: &[S], v: &[S], force: &mut [S]) {
        self(q, v, force);
    }
}

/// Rayleigh's dissipation function `D(q, v)` in W, half of the power that linear friction dissipates; the force is `Q = -dD/dv`.
pub trait Dissipation: Send + Sync {
    /// Computes `D(q, v)` of one state, where `q` and `v` have length `n`.
    fn dissipation<R: Real>(&self, q: &[R], v: &[R]) -> R;
}

impl<D: Dissipation> Dissipation for &D {
    fn dissipation<R: Real>(&self, q: &[R], v: &[R]) -> R {
        (**self).dissipation(q, v)
    }
}

/// The force `-dD/dv` of a [`Dissipation`] `D`, computed with exact derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Rayleigh<D>(
    /// The dissipation function.
    pub D,
);

impl<S: Scalar, D: Dissipation> GeneralizedForce<S> for Rayleigh<D> {
    fn force(&self, q: &[S], v: &[S], force: &mut [S]) {
        let q: Vec<Dual<S>> = q.iter().map(|&q| Dual::lift(q)).collect();
        let mut v: Vec<Dual<S>> = v.iter().map(|&v| Dual::lift(v)).collect();
        for (i, force) in force.iter_mut().enumerate() {
            v[i].tangent = <S as Real>::one();
            *force = -self.0.dissipation(&q, &v).tangent;
            v[i].tangent = <S as Real>::zero();
        }
    }

    fn slopes(&self, n: usize) -> Option<Box<dyn Slopes<S> + '_>> {
        let value = Program::record(2 * n, 0, |x, _| vec![self.0.dissipation(&x[..n], &x[n..])]).ok()?;
        Some(Box::new(ProgramSlopes::new(SlopePrograms::of(&Rate::of_dissipation(&value).ok()?)?, &[])))
    }
}

/// A model with additional forces: `M a = g - c + Q`, where `Q` includes the forces of the model itself.
///
/// ```
/// use lnn::lagrangian::{Dissipation, EulerLagrange, Rayleigh, Request, SystemInstance, Terms, WithForces};
/// use lnn::scalar::Real;
///
/// struct Joints; // D = (c1 v1^2 + c2 (v2 - v1)^2) / 2, c in N m s
/// impl Dissipation for Joints {
///     fn dissipation<R: Real>(&self, _q: &[R], v: &[R]) -> R {
///         (R::of(0.08) * v[0].sqr() + R::of(0.05) * (v[1] - v[0]).sqr()) * R::of(0.5)
///     }
/// }
///
/// let arm = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
/// let damped = WithForces::new(arm, Rayleigh(Joints));
/// let mut terms = Terms::default();
/// damped.terms(&[0.3, 0.1], &[1.0, 3.0], Request::ACCELERATION, &mut terms)?;
/// assert!((terms.force[0] - (0.05 * 2.0 - 0.08)).abs() < 1e-15 && (terms.force[1] + 0.05 * 2.0).abs() < 1e-15);
/// assert!((terms.dissipation[0] - (0.08 + 0.05 * 4.0)).abs() < 1e-15); // W, twice D
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct WithForces<M, F> {
    model: M,
    force: F,
    /// `false` if the force is zero for the given values of its parameters.
    acts: bool,
}

impl<M, F> WithForces<M, F> {
    /// Adds a [`GeneralizedForce`] to a model.
    pub fn new(model: M, force: F) -> Self {
        Self { model, force, acts: true }
    }

    /// Adds a force that is zero for the given values of its parameters, although its derivatives by them are not.
    pub(crate) fn vanishing(model: M, force: F) -> Self {
        Self { model, force, acts: false }
    }

    /// Returns the model without the force.
    pub fn model(&self) -> &M {
        &self.model
    }
}

impl<S: Scalar, M: EulerLagrange<S>, F: GeneralizedForce<S>> EulerLagrange<S> for WithForces<M, F> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        if !self.acts {
            return self.model.terms(q, v, request, terms);
        }
        let n = self.coordinates();
        // The acceleration is solved for only once, with all forces.
        let outcome = self.model.terms(q, v, request.without_solution(), terms);
        let found = terms.drain_failures(outcome)?;
        if request.includes(Request::FORCE) {
            terms.force.resize(v.len(), <S as Real>::zero());
            terms.dissipation.resize(v.len() / n.max(1), <S as Real>::zero());
            let mut own = vec![<S as Real>::zero(); n];
            let rows = q.chunks_exact(n).zip(v.chunks_exact(n));
            let sums = terms.force.chunks_exact_mut(n).zip(&mut terms.dissipation);
            for ((q, v), (force, power)) in rows.zip(sums) {
                own.fill(<S as Real>::zero());
                self.force.force(q, v, &mut own);
                for ((force, &own), &v) in force.iter_mut().zip(&own).zip(v) {
                    *force += own;
                    *power -= own * v;
                }
            }
        }
        terms.complete_beside(found, n, v, request)
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(&self.model)
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        Some(with_force(self.coordinates(), self.model.slopes()?, &self.force))
    }

    fn conserves_energy(&self) -> bool {
        !self.acts && self.model.conserves_energy()
    }

    fn solved(&self) -> Option<Solved<'_, S>> {
        if self.acts { None } else { self.model.solved() }
    }
}

/// A model without its friction: `M a = g - c + Q` with `Q = 0`, to compute its motion or torques without friction.
///
/// It is linearized by differences, like your own types.
#[derive(Clone, Copy)]
pub struct Frictionless<'a, S>(
    /// The model.
    pub &'a dyn EulerLagrange<S>,
);

impl<S: Scalar> EulerLagrange<S> for Frictionless<'_, S> {
    fn coordinates(&self) -> usize {
        self.0.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        self.terms_at(&[], q, v, request, terms)
    }

    fn terms_at(
        &self,
        t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        let outcome = self.0.terms_at(t, q, v, request.without_solution(), terms);
        let found = terms.drain_failures(outcome)?;
        terms.force.clear();
        terms.dissipation.clear();
        terms.complete_beside(found, self.coordinates(), v, request)
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(self.0)
    }

    fn conserves_energy(&self) -> bool {
        true
    }
}

/// Wraps a model so that a flag ends its motion: once the flag is raised, every evaluation fails with [`MechanicsError::Interrupted`]. The
/// energy of given states is still computed.
pub struct Interruptible<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    flag: &'a AtomicBool,
}

impl<'a, S> Interruptible<'a, S> {
    /// Wraps a model with a flag.
    pub fn new(model: &'a dyn EulerLagrange<S>, flag: &'a AtomicBool) -> Self {
        Self { model, flag }
    }
}

impl<S: Scalar> EulerLagrange<S> for Interruptible<'_, S> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        self.terms_at(&[], q, v, request, terms)
    }

    fn terms_at(
        &self,
        t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        if request != Request::ENERGY && self.flag.load(Ordering::Relaxed) {
            terms.clear();
            return Err(MechanicsError::Interrupted);
        }
        self.model.terms_at(t, q, v, request, terms)
    }

    fn is_timed(&self) -> bool {
        self.model.is_timed()
    }

    fn solved(&self) -> Option<Solved<'_, S>> {
        Some(self.model.solved()?.until(self.flag))
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        self.model.slopes()
    }

    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        self.model.metric_jets(q, v)
    }

    fn wide_metric_jets(&self, q: &[S], v: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        self.model.wide_metric_jets(q, v)
    }

    fn manifold(&self) -> Option<&dyn Manifold<S>> {
        self.model.manifold()
    }

    fn conserves_energy(&self) -> bool {
        self.model.conserves_energy()
    }

    fn prefers_batches(&self) -> bool {
        self.model.prefers_batches()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;

    #[test]
    fn a_model_without_its_friction_moves_as_the_bare_one() {
        let model = || SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
        let friction = |_: &[f64], v: &[f64], force: &mut [f64]| {
            force.iter_mut().zip(v).for_each(|(force, v)| *force = -0.5 * v);
        };
        let (q, v) = ([0.3, 0.1], [1.0, 3.0]);
        let (mut free, mut bare) = (Terms::default(), Terms::default());
        model().terms(&q, &v, Request::ALL, &mut free).unwrap();
        let damped = WithForces::new(model(), friction);
        let frictionless = Frictionless(&damped);
        frictionless.terms(&q, &v, Request::ALL, &mut bare).unwrap();
        assert_eq!((&bare.acceleration, &bare.energy), (&free.acceleration, &free.energy));
        assert!(bare.force.is_empty() && bare.dissipation.is_empty() && frictionless.conserves_energy());
    }

    #[test]
    fn forces_move_and_take_power() {
        let model = || SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
        let friction = |_: &[f64], v: &[f64], force: &mut [f64]| {
            force.iter_mut().zip(v).for_each(|(force, v)| *force = -0.5 * v);
        };
        let (q, v) = ([0.3, 0.1, -1.0, 2.0], [1.0, 3.0, 0.0, -0.5]);
        let (mut free, mut damped, mut twice) = (Terms::default(), Terms::default(), Terms::default());
        model().terms(&q, &v, Request::ALL, &mut free).unwrap();
        let once = WithForces::new(model(), friction);
        once.terms(&q, &v, Request::ALL, &mut damped).unwrap();
        WithForces::new(once, friction).terms(&q, &v, Request::ALL, &mut twice).unwrap();
        assert_eq!((&damped.lagrangian, &damped.energy), (&free.lagrangian, &free.energy));
        for row in 0..2 {
            let at = |values: &[f64], i: usize| values[2 * row + i];
            for i in 0..2 {
                // M (a - a_free) = Q
                let change = (0..2).map(|j| {
                    damped.mass_matrix[4 * row + 2 * i + j] * (at(&damped.acceleration, j) - at(&free.acceleration, j))
                });
                assert!((change.sum::<f64>() + 0.5 * at(&v, i)).abs() < 1e-12);
                assert_eq!(at(&twice.force, i), -at(&v, i));
            }
            let power = 0.5 * (at(&v, 0).powi(2) + at(&v, 1).powi(2));
            assert!(
                (damped.dissipation[row] - power).abs() < 1e-15 && (twice.dissipation[row] - 2.0 * power).abs() < 1e-15
            );
        }
    }
}
