//! Roll-outs of a single motion.

use super::error::UnderflowCause;
use super::fixed::Stepper;
use super::integration::Adaptive;
use super::thresholds::NEAR_CONSTRAINTS;
use super::{
    Force, Integrable, Integrator, Occurrence, RolloutError, RolloutOptions, StepCounts, Trajectory, adaptive, fixed,
};
use crate::lagrangian::{EulerLagrange, ManifoldRows, MechanicsError, OffManifold, project};
use crate::scalar::Scalar;

/// The result of a roll-out.
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout<S> {
    /// The samples up to the end, which are all valid, whatever `stop` contains.
    pub trajectory: Trajectory<S>,
    /// Counts of steps and evaluations.
    pub statistics: StepCounts,
    /// Why it ended before `t_end`; `None` also if an event ended it as requested.
    pub stop: Option<RolloutError>,
    /// The events that happened, ordered by time.
    pub events: Vec<Occurrence<S>>,
}

impl<S: Scalar> Rollout<S> {
    /// Returns `true` if the motion reached `t_end`, or an event that ends it.
    pub fn is_complete(&self) -> bool {
        self.stop.is_none()
    }

    /// Returns the trajectory if `t_end` was reached.
    ///
    /// # Errors
    /// The reason if it was not.
    pub fn complete(self) -> Result<Trajectory<S>, RolloutError> {
        match self.stop {
            None => Ok(self.trajectory),
            Some(error) => Err(error),
        }
    }
}

/// Provides roll-outs as a method of every model.
///
/// ```
/// use lnn::prelude::*;
///
/// let planet = lnn::lagrangian::SystemInstance::<f64>::named("kepler", &[])?.build()?;
/// let motion = planet.rollout(&[1.0, 0.0], &[0.0, 1.1], 10.0, 0.1)?; // 10 s, a sample every 0.1 s
/// let energy = motion.energy.unwrap();
/// assert!(motion.t.len() == 101 && (energy[100] - energy[0]).abs() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Motion<S: Integrable>: EulerLagrange<S> {
    /// Integrates from `(q, v)` at time 0 and samples the motion every `dt` until `t_end`, with the adaptive method and tolerances of
    /// [`RolloutOptions::new`]. Use [`rollout`] to set other options or to keep the samples before a failure.
    ///
    /// # Errors
    /// The reason why the motion ended before `t_end`.
    fn rollout(&self, q: &[S], v: &[S], t_end: S, dt: S) -> Result<Trajectory<S>, RolloutError>;
}

impl<S: Integrable, M: EulerLagrange<S>> Motion<S> for M {
    fn rollout(&self, q: &[S], v: &[S], t_end: S, dt: S) -> Result<Trajectory<S>, RolloutError> {
        rollout(self, q, v, &RolloutOptions::new(t_end, dt)).complete()
    }
}

/// Integrates `dq/dt = v`, `dv/dt = a(q, v)` from `(q, v)` at `options.t0` and samples it at `t0 + k dt` and `t_end`.
///
/// `q` and `v` have length `n` and are in physical units. The domain is checked at every evaluated state, including the trial states of a
/// step. A step that would leave the domain is shortened, so that the reported time is the time of the exit.
///
/// Fixed-step methods check the domain at the stages and the end of every step, and report the last time inside.
pub fn rollout<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    options: &RolloutOptions<S>,
) -> Rollout<S> {
    adaptive_or_fixed(model, None, q, v, options)
}

/// Does the same as [`rollout`] for the structure-preserving methods, in every precision, including [`crate::scalar::Dd`].
pub fn rollout_fixed<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    options: &RolloutOptions<S>,
) -> Rollout<S> {
    fixed(model, None, q, v, options)
}

/// Integrates with any method and an optional external force.
pub(super) fn adaptive_or_fixed<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    q: &[S],
    v: &[S],
    options: &RolloutOptions<S>,
) -> Rollout<S> {
    collected(model, options, |keep, events| S::roll_out(model, force, (q, v), options, (keep, None, events)))
}

/// Integrates with the structure-preserving methods and an optional external force.
pub(super) fn fixed<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    q: &[S],
    v: &[S],
    options: &RolloutOptions<S>,
) -> Rollout<S> {
    collected(model, options, |keep, events| integrate_fixed(model, force, (q, v), options, (keep, None, events)))
}

/// Collects the samples of a motion in a trajectory, with the energies if the options request them.
fn collected<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    options: &RolloutOptions<S>,
    motion: impl FnOnce(&mut Keep<'_, S>, &mut Vec<Occurrence<S>>) -> (StepCounts, Option<RolloutError>),
) -> Rollout<S> {
    let (mut trajectory, mut events) = (Trajectory::empty(model.coordinates()), Vec::new());
    let mut keep = |t: S, q: &[S], v: &[S]| {
        trajectory.push(t, q, v);
        true
    };
    let (statistics, stop) = motion(&mut keep, &mut events);
    if options.energy && !matches!(stop, Some(RolloutError::Invalid { .. } | RolloutError::OffConstraints { .. })) {
        trajectory.energy = Some(trajectory.energy_by(model));
    }
    Rollout { trajectory, statistics, stop, events }
}

/// Integrates with any method and passes every sample and, if requested, every quadrature node to the receivers without storing them.
pub(super) fn integrate<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    (q, v): (&[S], &[S]),
    options: &RolloutOptions<S>,
    receivers: Receivers<'_, '_, S>,
) -> (StepCounts, Option<RolloutError>) {
    let method = match options.method {
        Integrator::Dopri5 => Adaptive::Dopri5,
        Integrator::Dop853 => Adaptive::Dop853,
        Integrator::Midpoint | Integrator::Gauss4 | Integrator::Gauss6 | Integrator::Variational => {
            return integrate_fixed(model, force, (q, v), options, receivers);
        }
    };
    let checked = check(model.coordinates(), q, v, options).and_then(|()| reachable(q, v, options));
    match checked.and_then(|()| allowed(model, q, v)) {
        Err(error) => (StepCounts::default(), Some(error)),
        Ok((q, v)) => adaptive::run(model, force, method, (&q, &v), options, receivers),
    }
}

/// Integrates with the structure-preserving methods and passes every sample to the receivers without storing them.
fn integrate_fixed<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    (q, v): (&[S], &[S]),
    options: &RolloutOptions<S>,
    receivers: Receivers<'_, '_, S>,
) -> (StepCounts, Option<RolloutError>) {
    let n = model.coordinates();
    let refused = |error| (StepCounts::default(), Some(error));
    if let Err(error) = check(n, q, v, options) {
        return refused(error);
    }
    let (q, v) = match allowed(model, q, v) {
        Ok(start) => start,
        Err(error) => return refused(error),
    };
    let Some(mut stepper) = Stepper::new(options.method, model) else {
        let problem = format!("{} adapts its steps; {} offers fixed steps only", options.method.name(), S::NAME);
        return refused(RolloutError::Invalid { what: "method", problem });
    };
    if options.method == Integrator::Variational && !model.conserves_energy() && !model.is_timed() {
        let problem = "the variational integrator keeps the energy and this model loses it by friction; \
                       dopri5, dop853, midpoint, gauss4 and gauss6 integrate it";
        return refused(RolloutError::Invalid { what: "method", problem: problem.to_string() });
    }
    fixed::run(model, force, &mut stepper, (&q, &v), options, receivers)
}

/// Returns the initial state, projected onto the constraints of the model.
///
/// # Errors
/// [`RolloutError::OffConstraints`] for an initial state that is not close to them.
fn allowed<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Result<(Vec<S>, Vec<S>), RolloutError> {
    let (mut on_q, mut on_v) = (q.to_vec(), v.to_vec());
    let Some(manifold) = model.manifold() else { return Ok((on_q, on_v)) };
    let name = |row: usize| manifold.names().get(row).cloned().unwrap_or_default();
    let [moved, turned] = match project(manifold, &mut on_q, &mut on_v) {
        Ok(distances) => distances,
        Err(OffManifold { row, defect }) => {
            return Err(RolloutError::OffConstraints { constraint: name(row), distance: defect, nearest: Vec::new() });
        }
    };
    let size = |x: &[S]| x.iter().map(|x| x.to_f64().powi(2)).sum::<f64>().sqrt();
    let far = [(moved, size(q)), (turned, size(v))].into_iter().find(|(moved, size)| *moved > NEAR_CONSTRAINTS * size);
    let Some((distance, _)) = far else { return Ok((on_q, on_v)) };
    let mut rows = ManifoldRows::default();
    manifold.rows(q, v, &mut rows);
    let missed = if moved > NEAR_CONSTRAINTS * size(q) { &rows.values } else { &rows.rates };
    let most = missed.iter().enumerate().max_by(|(_, a), (_, b)| a.abs().to_f64().total_cmp(&b.abs().to_f64()));
    let nearest = on_q.iter().chain(&on_v).map(|x| x.to_f64()).collect();
    let constraint = most.map_or_else(String::new, |(row, _)| name(row));
    Err(RolloutError::OffConstraints { constraint, distance, nearest })
}

fn check<S: Scalar>(n: usize, q: &[S], v: &[S], options: &RolloutOptions<S>) -> Result<(), RolloutError> {
    let invalid = |what, problem| Err(RolloutError::Invalid { what, problem });
    if n == 0 {
        return invalid("model", "has no coordinates".to_string());
    }
    for (what, values) in [("q", q), ("v", v)] {
        if values.len() != n {
            return invalid(what, format!("expected {n} numbers, found {}", values.len()));
        }
        if let Some(index) = values.iter().position(|x| !x.is_finite()) {
            return invalid(what, format!("number {index} is not finite"));
        }
    }
    options.check(n)
}

/// Rejects a purely absolute tolerance that is below the resolution of the scalar at the start.
fn reachable<S: Scalar>(q: &[S], v: &[S], options: &RolloutOptions<S>) -> Result<(), RolloutError> {
    let zero = S::of_f64(0.0);
    let size = q.iter().chain(v).fold(zero, |size, x| S::max(size, x.abs()));
    let least = RolloutOptions::<S>::least_tolerance() * size;
    if options.rtol > zero || options.atol >= least {
        return Ok(());
    }
    let (atol, size, least) = (options.atol.to_f64(), size.to_f64(), least.to_f64());
    let problem = format!(
        "{atol:e} without rtol is finer than {} can keep of a state of size {size}, the least is {least:e}",
        S::NAME
    );
    Err(RolloutError::Invalid { what: "atol", problem })
}

/// The reason why a derivative or a step could not be computed.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum StepFailure {
    Domain {
        component: usize,
        value: f64,
        lower: f64,
        upper: f64,
    },
    State,
    Model(MechanicsError),
    NotConverged {
        iterations: usize,
        residual: f64,
    },
    /// No nearby state satisfies the constraints.
    OffConstraints,
    /// The constraint rows are dependent at this time after the last state.
    Branch {
        constraint: usize,
        ahead: f64,
    },
}

impl StepFailure {
    /// Checks that a state `(q, v)` is finite and inside the domain.
    pub(super) fn check<S: Scalar>(domain: Option<&super::Domain<S>>, state: &[S]) -> Result<(), Self> {
        if state.iter().any(|x| !x.is_finite()) {
            return Err(Self::State);
        }
        match domain.and_then(|domain| domain.violation(state)) {
            None => Ok(()),
            Some((component, lower, upper)) => {
                let (value, lower, upper) = (state[component].to_f64(), lower.to_f64(), upper.to_f64());
                Err(Self::Domain { component, value, lower, upper })
            }
        }
    }
}

/// Receives the time, coordinates and velocities of every sample in order, and returns whether to continue.
pub(super) type Keep<'a, S> = dyn FnMut(S, &[S], &[S]) -> bool + 'a;

/// Receives time, weight, coordinates and velocities at quadrature nodes along a motion, in addition to the samples.
pub(super) type Nodes<'a, S> = dyn FnMut(S, S, &[S], &[S]) + 'a;

/// Receivers of the samples, of the nodes if requested, and of the events.
pub(super) type Receivers<'r, 'a, S> = (&'r mut Keep<'a, S>, Option<&'r mut Nodes<'a, S>>, &'r mut Vec<Occurrence<S>>);

/// Returns the error for a motion that ended with a failed step.
pub(super) fn into_error(failure: StepFailure, t: f64, state: Vec<f64>, step: f64) -> RolloutError {
    match failure {
        StepFailure::Domain { component, value, lower, upper } => {
            RolloutError::LeftDomain { t, state, component, value, lower, upper }
        }
        StepFailure::State => RolloutError::NotFinite { t, state, what: "state" },
        StepFailure::Model(MechanicsError::Singular { condition, .. }) => {
            RolloutError::SingularMass { t, state, condition }
        }
        StepFailure::Model(MechanicsError::Dependent { constraint, .. }) => {
            RolloutError::DependentConstraint { t, state, constraint }
        }
        StepFailure::Branch { constraint, ahead } => RolloutError::SecondBranch { t, state, constraint, at: t + ahead },
        StepFailure::OffConstraints => RolloutError::NotFinite { t, state, what: "projection onto the constraints" },
        StepFailure::Model(MechanicsError::Interrupted) => RolloutError::Stopped { t },
        StepFailure::Model(MechanicsError::Uncertified { .. }) => RolloutError::Uncertified { t, state },
        StepFailure::Model(MechanicsError::NotFinite { what, .. }) => RolloutError::NotFinite { t, state, what },
        StepFailure::NotConverged { iterations, residual } => {
            RolloutError::NotConverged { t, state, iterations, residual }
        }
        StepFailure::Model(error) => {
            RolloutError::StepUnderflow { t, state, step, cause: UnderflowCause::Model(error) }
        }
    }
}
