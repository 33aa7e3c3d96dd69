//! Euler-Lagrange terms of a batch of states: the possible requests, their storage, and derived terms.

use super::constraints::Manifold;
use super::derivatives::MetricJet;
use super::error::MechanicsError;
use super::{Chain, Pattern, RightHandSide, Slopes, Solved};
use crate::scalar::{Dd, Scalar};
use crate::tape::Depth;
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::BitOr;

/// The terms that a caller needs; others are not computed.
///
/// Requests combine with `|`. [`Request::ACCELERATION`] also computes and stores `M`, `c`, `g` and `Q`, and [`Request::ENERGY`] stores `L`
/// and `p`. The default requests nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Request(u16);

impl Request {
    /// `L`.
    pub const LAGRANGIAN: Self = Self(1);
    /// `p = dL/dv`.
    pub const MOMENTUM: Self = Self(2);
    /// `g = dL/dq`.
    pub const DL_DQ: Self = Self(4);
    /// `M = d2L/dv dv`.
    pub const MASS_MATRIX: Self = Self(8);
    /// `c = (d2L/dv dq) v`.
    pub const CORIOLIS: Self = Self(16);
    /// `a = M^-1 (g - c + Q)`, with `M`, `c`, `g`, `Q`; with constraints also `A`, `gamma`, multipliers and their force.
    pub const ACCELERATION: Self = Self(256 | 128 | 32 | 16 | 8 | 4);
    /// `E = p.v - L`, with `L`, `p`.
    pub const ENERGY: Self = Self(64 | 2 | 1);
    /// Forces `Q` that do not follow from `L`, such as friction, and the power they dissipate; empty for a model without them.
    pub const FORCE: Self = Self(128);
    /// The rows `A` of constraints and their drift `gamma`; empty for a model without them.
    pub const CONSTRAINTS: Self = Self(256);
    /// All terms.
    pub const ALL: Self = Self(511);

    /// Returns this request without the solution for the acceleration, but with the terms that the solution needs.
    pub(crate) const fn without_solution(self) -> Self {
        Self(self.0 & !32)
    }

    /// Returns a number below 32 that identifies the combination of `L`, `p`, `g`, `M`, `c`.
    pub(crate) const fn index(self) -> usize {
        (self.0 & 31) as usize
    }

    /// Returns the smallest depth of an evaluation that fills `L`, `p`, `g`, `M`, `c` as requested.
    pub(crate) const fn depth(self) -> Depth {
        if self.includes(Self::CORIOLIS) {
            Depth::Motion
        } else if self.includes(Self::MASS_MATRIX) {
            Depth::MassMatrix
        } else if self.includes(Self::MOMENTUM) || self.includes(Self::DL_DQ) {
            Depth::Gradient
        } else {
            Depth::Value
        }
    }

    /// Returns `true` if all of `other` is requested.
    #[inline]
    pub const fn includes(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl BitOr for Request {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Euler-Lagrange terms of `batch` states. A field is filled if it was requested and empty otherwise.
#[derive(Clone, Debug, Default)]
pub struct Terms<S> {
    /// `L`, `(batch)`.
    pub lagrangian: Vec<S>,
    /// `p = dL/dv`, `(batch, n)`.
    pub momentum: Vec<S>,
    /// `g = dL/dq`, `(batch, n)`.
    pub dl_dq: Vec<S>,
    /// `M = d2L/dv dv`, `(batch, n, n)`, symmetric.
    pub mass_matrix: Vec<S>,
    /// `c = (d2L/dv dq) v`, `(batch, n)`.
    pub coriolis: Vec<S>,
    /// Generalized force `Q` that is not in `L`: friction `-dD/dv` for a dissipation `D`, `(batch, n)`; empty for a model that [conserves
    /// its energy](EulerLagrange::conserves_energy).
    pub force: Vec<S>,
    /// Power that leaves the motion, `(batch)`, in the unit of `L` per unit of time: `-v.Q = v.dD/dv`, plus `dL/dt` for a Lagrangian that
    /// depends on the time. It is empty whenever `force` is.
    pub dissipation: Vec<S>,
    /// `a = M^-1 (g - c + Q + A^T lambda)`, `(batch, n)`.
    pub acceleration: Vec<S>,
    /// `E = p.v - L`, `(batch)`.
    pub energy: Vec<S>,
    /// Number of constraints `m` of each state; 0 for a model without constraints, whose constraint fields are empty.
    pub constraints: usize,
    /// `A`, `(batch, m, n)`.
    pub constraint_matrix: Vec<S>,
    /// `gamma = (dA/dt) v - db/dt`, `(batch, m)`.
    pub constraint_drift: Vec<S>,
    /// Multipliers `lambda`, `(batch, m)`; computed with the acceleration.
    pub multipliers: Vec<S>,
    /// Forces of constraint `A^T lambda`, `(batch, n)`; computed with the acceleration.
    pub constraint_force: Vec<S>,
    /// One error for every row that failed, in the order of the rows; [`EulerLagrange::terms`] returns the first.
    pub failures: Vec<MechanicsError>,
}

impl<S: Scalar> Terms<S> {
    /// Copies the requested fields of the rows `rows` of a batch of `n` coordinates, and clears the others.
    #[cfg(feature = "rollout")]
    pub(crate) fn copy_rows(&mut self, batch: &Self, n: usize, rows: core::ops::Range<usize>, request: Request) {
        let copy = |to: &mut Vec<S>, from: &[S], width: usize, what: Request| {
            to.clear();
            // A model without friction has no forces to copy.
            if request.includes(what) && !from.is_empty() {
                to.extend_from_slice(&from[rows.start * width..rows.end * width]);
            }
        };
        copy(&mut self.lagrangian, &batch.lagrangian, 1, Request::LAGRANGIAN);
        copy(&mut self.momentum, &batch.momentum, n, Request::MOMENTUM);
        copy(&mut self.dl_dq, &batch.dl_dq, n, Request::DL_DQ);
        copy(&mut self.mass_matrix, &batch.mass_matrix, n * n, Request::MASS_MATRIX);
        copy(&mut self.coriolis, &batch.coriolis, n, Request::CORIOLIS);
        copy(&mut self.force, &batch.force, n, Request::FORCE);
        copy(&mut self.dissipation, &batch.dissipation, 1, Request::FORCE);
        copy(&mut self.acceleration, &batch.acceleration, n, Request::ACCELERATION);
        copy(&mut self.energy, &batch.energy, 1, Request::ENERGY);
        let m = batch.constraints;
        self.constraints = m;
        copy(&mut self.constraint_matrix, &batch.constraint_matrix, m * n, Request::CONSTRAINTS);
        copy(&mut self.constraint_drift, &batch.constraint_drift, m, Request::CONSTRAINTS);
        copy(&mut self.multipliers, &batch.multipliers, m, Request::ACCELERATION);
        copy(&mut self.constraint_force, &batch.constraint_force, n, Request::ACCELERATION);
        self.failures.clear();
        let failed = batch.failures.iter().filter_map(|error| error.row().map(|row| (row, error)));
        let here = failed.filter(|(row, _)| rows.contains(row));
        self.failures.extend(here.map(|(row, error)| error.at_row(row - rows.start)));
    }
}

/// Computes one field of the terms of a model.
fn field<S: Scalar>(
    compute: &mut dyn FnMut(&mut Terms<S>) -> Result<(), MechanicsError>,
    field: fn(Terms<S>) -> Vec<S>,
) -> Result<Vec<S>, MechanicsError> {
    let mut terms = Terms::default();
    compute(&mut terms)?;
    Ok(field(terms))
}

/// A mechanical model in physical units: a Lagrangian written by hand or learned, with values of its parameters.
///
/// Only two methods are required: [`coordinates`](Self::coordinates) and [`terms`](Self::terms). A type that wraps another model adds
/// [`inner`](Self::inner), and every other method then delegates to that model. The trait is object safe: roll-outs, evaluations and
/// reports take `&dyn EulerLagrange<S>`.
///
/// ```
/// use lnn::prelude::*;
///
/// let arm = lnn::lagrangian::SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
/// let a = arm.acceleration(&[0.3, 0.1], &[0.0, 0.0])?; // rad/s^2; several states, one after the other, give as many rows
/// let m = arm.mass_matrix(&[0.3, 0.1], &[0.0, 0.0])?; // kg m^2, row by row
/// assert!(a[0] < 0.0 && m.len() == 4 && m[1] == m[2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait EulerLagrange<S: Scalar>: Send + Sync {
    /// Returns the number of coordinates `n`.
    fn coordinates(&self) -> usize;

    /// Computes the requested terms of a batch.
    ///
    /// `q` and `v` are `(batch, n)` in physical units. `terms` is resized, and its buffers are reused.
    ///
    /// # Errors
    /// [`MechanicsError`] for the first row that fails; [`Terms::failures`] contains an error for each of them. Terms other than the
    /// acceleration are filled even if a mass matrix is singular. Accelerations of failed rows are `NaN`; those of the other rows are
    /// correct.
    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError>;

    /// Computes [`terms`](Self::terms) at times `t`, `(batch)`. Only a model that [depends on the time](Self::is_timed) needs them; it
    /// rejects states without times.
    ///
    /// # Errors
    /// Those of [`terms`](Self::terms).
    fn terms_at(
        &self,
        _t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        self.terms(q, v, request, terms)
    }

    /// Returns `true` if the Lagrangian or its forces depend on the time, as in [`InTime`](super::InTime), so that a state alone does not
    /// determine the terms.
    fn is_timed(&self) -> bool {
        self.inner().is_some_and(|inner| inner.is_timed())
    }

    /// Returns the wrapped model of a wrapper. The methods below delegate to it, so that a wrapper only overrides those that it changes.
    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        None
    }

    /// Computes the accelerations `a` of a batch, `(batch, n)`.
    ///
    /// # Errors
    /// Those of [`terms`](Self::terms).
    fn acceleration(&self, q: &[S], v: &[S]) -> Result<Vec<S>, MechanicsError> {
        field(&mut |terms| self.terms(q, v, Request::ACCELERATION, terms), |terms| terms.acceleration)
    }

    /// Computes the mass matrices `M = d2L/dv dv` of a batch, `(batch, n, n)`.
    ///
    /// # Errors
    /// Those of [`terms`](Self::terms).
    fn mass_matrix(&self, q: &[S], v: &[S]) -> Result<Vec<S>, MechanicsError> {
        field(&mut |terms| self.terms(q, v, Request::MASS_MATRIX, terms), |terms| terms.mass_matrix)
    }

    /// Computes the momenta `p = dL/dv` of a batch, `(batch, n)`.
    ///
    /// # Errors
    /// Those of [`terms`](Self::terms).
    fn momentum(&self, q: &[S], v: &[S]) -> Result<Vec<S>, MechanicsError> {
        field(&mut |terms| self.terms(q, v, Request::MOMENTUM, terms), |terms| terms.momentum)
    }

    /// Computes the energies `E = p.v - L` of a batch, `(batch)`.
    ///
    /// # Errors
    /// Those of [`terms`](Self::terms).
    fn energy(&self, q: &[S], v: &[S]) -> Result<Vec<S>, MechanicsError> {
        field(&mut |terms| self.terms(q, v, Request::ENERGY, terms), |terms| terms.energy)
    }

    /// Returns the motion as `dy/dt = f(y)`, `y = (q, v)`, for a solver of another crate.
    fn rhs(&self) -> RightHandSide<'_, S>
    where
        Self: Sized,
    {
        RightHandSide::new(self)
    }

    /// Computes the metric `M = d2L/dv dv` of every state with its first and second derivatives by the coordinates, exact to rounding.
    ///
    /// `q` and `v` are `(batch, n)` in physical units. Results may contain numbers that are not finite.
    ///
    /// # Errors
    /// [`MechanicsError::Shape`]; [`MechanicsError::Derivatives`] for a model that cannot be differentiated: one that branches on its data,
    /// or one that neither overrides this method nor wraps a model that does.
    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        match self.inner() {
            Some(inner) => inner.metric_jets(q, v),
            None => Err(MechanicsError::Derivatives { what: "mass matrix" }),
        }
    }

    /// Computes the metric jets in double-double precision, if the cost is reasonable: curvature is a difference of larger terms, for
    /// example for flat space in curved coordinates. Returns `None` if the model cannot do this or has that precision already.
    ///
    /// # Errors
    /// Those of [`EulerLagrange::metric_jets`].
    fn wide_metric_jets(&self, q: &[S], v: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        self.inner().map_or(Ok(None), |inner| inner.wide_metric_jets(q, v))
    }

    /// Returns which second derivatives of the Lagrangian are zero and which are constant at all states; `None` for a model that is not
    /// recorded.
    fn pattern(&self) -> Option<Pattern> {
        self.inner().and_then(|inner| inner.pattern())
    }

    /// Returns the manifold of states that the constraints allow; `None` for a model without constraints.
    fn manifold(&self) -> Option<&dyn Manifold<S>> {
        self.inner().and_then(|inner| inner.manifold())
    }

    /// Returns `true` if the motion conserves the energy `E = p.v - L`, that is, without friction and other forces that are not in `L`.
    fn conserves_energy(&self) -> bool {
        self.inner().is_none_or(|inner| inner.conserves_energy())
    }

    /// Returns the program of the accelerations alone, for [`Accelerations`](super::Accelerations); `None` if there is none.
    #[doc(hidden)]
    fn solved(&self) -> Option<Solved<'_, S>> {
        None
    }

    /// Returns the derivatives of the equations of motion, for a [`Linearizer`](super::Linearizer); `None` if there are none.
    #[doc(hidden)]
    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        None
    }

    /// Returns the chain of links of the model, whose recursions [`Torques`](super::Torques) uses; `None` for any other model.
    #[doc(hidden)]
    fn links(&self) -> Option<&Chain<S>> {
        None
    }

    /// Returns `true` if evaluating several states at once takes less time per state, by more than the synchronization of threads costs.
    fn prefers_batches(&self) -> bool {
        self.inner().is_some_and(|inner| inner.prefers_batches())
    }
}

impl<S: Scalar> EulerLagrange<S> for Box<dyn EulerLagrange<S> + '_> {
    fn coordinates(&self) -> usize {
        (**self).coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        (**self).terms(q, v, request, terms)
    }

    fn terms_at(
        &self,
        t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        (**self).terms_at(t, q, v, request, terms)
    }

    fn solved(&self) -> Option<Solved<'_, S>> {
        (**self).solved()
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        (**self).slopes()
    }

    fn links(&self) -> Option<&Chain<S>> {
        (**self).links()
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(&**self)
    }
}

impl<S: Scalar> EulerLagrange<S> for &(dyn EulerLagrange<S> + '_) {
    fn coordinates(&self) -> usize {
        (**self).coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        (**self).terms(q, v, request, terms)
    }

    fn terms_at(
        &self,
        t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        (**self).terms_at(t, q, v, request, terms)
    }

    fn solved(&self) -> Option<Solved<'_, S>> {
        (**self).solved()
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        (**self).slopes()
    }

    fn links(&self) -> Option<&Chain<S>> {
        (**self).links()
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(*self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A model that overrides every method.
    struct Odd;

    impl EulerLagrange<f64> for Odd {
        fn coordinates(&self) -> usize {
            1
        }
        fn terms(&self, q: &[f64], v: &[f64], _: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
            terms.clear();
            terms.acceleration.extend(q.iter().map(|q| -q));
            terms.energy.extend(v.iter().map(|v| v * v));
            Ok(())
        }
        fn metric_jets(&self, _: &[f64], _: &[f64]) -> Result<Vec<MetricJet<f64>>, MechanicsError> {
            Ok(Vec::new())
        }
        fn wide_metric_jets(&self, _: &[f64], _: &[f64]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
            Ok(Some(Vec::new()))
        }
        fn conserves_energy(&self) -> bool {
            false
        }
        fn prefers_batches(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_wrapper_answers_as_the_model_it_wraps() {
        let boxed: Box<dyn EulerLagrange<f64>> = Box::new(Odd);
        let twice: Box<dyn EulerLagrange<f64>> = Box::new(boxed);
        for model in [&Odd as &dyn EulerLagrange<f64>, &*twice, &twice] {
            assert_eq!(model.acceleration(&[2.0, 3.0], &[0.0, 1.0]), Ok(vec![-2.0, -3.0]));
            assert_eq!(model.energy(&[2.0], &[3.0]), Ok(vec![9.0]));
            assert!(model.metric_jets(&[], &[]).is_ok());
            assert!(matches!(model.wide_metric_jets(&[], &[]), Ok(Some(_))));
            assert!(!model.conserves_energy() && model.prefers_batches());
        }
    }
}
