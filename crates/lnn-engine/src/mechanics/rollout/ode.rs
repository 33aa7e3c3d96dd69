//! Adapter to `ode_solvers`, the only file that uses it.
//!
//! Its pitfalls and how this file handles them:
//! - A right-hand side cannot fail, so the first error of an attempt is stored and `NaN` is returned. The solver then rejects the step and
//!   tries a shorter one; the error only ends the integration when steps become too small.
//! - Its dense output extrapolates the last sample, panics or hangs for some intervals, and is lost on failures. Only the sparse output is
//!   used, and samples are interpolated here from the stages of each accepted step.
//! - Backward integration is unreliable, so the elapsed time always increases from 0 (the caller changes the sign).
//! - Statistics are lost on errors, so calls are counted here.
//! - Underflow is not detected in `f32`, so a step that does not advance the time ends the integration.
//! - The node of stage 12 in its table of order 8 is wrong (0 instead of 1), so the time of that stage is derived from the previous one.

use super::crossing::Dense;
use super::dense::{Interpolant, Rhs, Step};
use super::gauss::Tableau;
use super::run;
use super::thresholds::{QUADRATURE_PANELS, RETRIED_SHARE};
use super::trajectory::Times;
use super::{Force, RolloutError, RolloutOptions, StepCounts};
use crate::lagrangian::EulerLagrange;
use crate::scalar::{Real, Scalar};
use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, OVector};
use ode_solvers::dop_shared::{FloatNumber, IntegrationError};
use ode_solvers::{DVector, Dop853, Dopri5, OutputType, SVector, System};
use std::cell::RefCell;

/// Receives sample `k` with its state, and returns whether to continue.
pub(super) type Output<'a, S> = dyn FnMut(usize, &[S]) -> bool + 'a;

/// Receives elapsed time, weight and state at quadrature nodes within every step.
pub(super) type StepNodes<'a, S> = dyn FnMut(S, S, &[S]) + 'a;

/// Searches a step for events, given its elapsed time, size and dense output; returns the fraction of the step at which the first one
/// happens.
pub(super) type Scan<'a, S> = dyn FnMut(S, S, &mut Dense<'_, S>) -> Option<S> + 'a;

/// The receivers of the results of an integration.
pub(super) type Receivers<'a, 'f, S> =
    (&'a mut Output<'f, S>, Option<&'a mut StepNodes<'f, S>>, Option<&'a mut Scan<'f, S>>);

/// Projects the state at the end of a step of some length onto its manifold; returns the distance in units of the tolerance.
pub(super) type Project<'a, S, E> = dyn FnMut(S, &mut [S]) -> Result<S, E> + 'a;

/// The adaptive methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Adaptive {
    Dopri5,
    Dop853,
}

/// An integration problem.
pub struct Integration<'a, S> {
    pub(super) method: Adaptive,
    pub(super) rtol: S,
    pub(super) atol: S,
    pub(super) max_steps: usize,
    /// Size of the first attempt; 0 lets the solver choose it.
    pub(super) first_step: S,
    /// `true` if the right-hand side depends on time.
    pub(super) timed: bool,
    /// State at elapsed time 0.
    pub(super) start: &'a [S],
    /// Elapsed times of the samples, ascending from 0; the last is the end.
    pub(super) samples: &'a dyn Times<S>,
}

/// The reason why an integration ended early.
#[derive(Debug)]
pub enum EarlyEnd<E> {
    /// The right-hand side fails beyond the last step, however short the next one.
    Failed(E),
    /// The error estimate requires steps that do not advance the time.
    Underflow,
    /// The allowed number of attempts is used up.
    TooManySteps,
    /// The receiver accepts no more samples.
    Stopped,
    /// An event interrupts the motion.
    Event,
}

/// Result of an integration.
pub struct Ran<S, E> {
    pub(super) statistics: StepCounts,
    /// Elapsed time and state at the end of the last accepted step or at the event within it, and the size of the step.
    pub(super) elapsed: S,
    pub(super) state: Vec<S>,
    pub(super) step: S,
    pub(super) ended: Option<EarlyEnd<E>>,
}

/// Number types that support adaptive integration and roll-outs: `f32` and `f64`. Other numbers are integrated with fixed steps
/// ([`rollout_fixed`](super::rollout_fixed)).
pub trait Integrable: Integrates {}

/// Code that this crate compiles once for each of these number types.
pub trait Integrates: Scalar {
    /// Integrates a motion from its start, sample by sample.
    fn roll_out(
        model: &dyn EulerLagrange<Self>,
        force: Option<&dyn Force<Self>>,
        start: (&[Self], &[Self]),
        options: &RolloutOptions<Self>,
        receivers: run::Receivers<'_, '_, Self>,
    ) -> (StepCounts, Option<RolloutError>);

    /// Solves differential equations.
    fn integrate<E>(
        task: &Integration<'_, Self>,
        f: &mut Rhs<'_, Self, E>,
        project: Option<&mut Project<'_, Self, E>>,
        receivers: Receivers<'_, '_, Self>,
    ) -> Ran<Self, E>;
}

macro_rules! integrable {
    ($($float:ty)*) => {
        $(
            impl Integrable for $float {}

            impl Integrates for $float {
                fn roll_out(
                    model: &dyn EulerLagrange<Self>,
                    force: Option<&dyn Force<Self>>,
                    start: (&[Self], &[Self]),
                    options: &RolloutOptions<Self>,
                    receivers: run::Receivers<'_, '_, Self>,
                ) -> (StepCounts, Option<RolloutError>) {
                    run::integrate(model, force, start, options, receivers)
                }

                fn integrate<E>(
                    task: &Integration<'_, Self>,
                    f: &mut Rhs<'_, Self, E>,
                    project: Option<&mut Project<'_, Self, E>>,
                    receivers: Receivers<'_, '_, Self>,
                ) -> Ran<Self, E> {
                    // Small states are stored on the stack.
                    match task.start.len() {
                        2 => integrate(task, |y| SVector::<Self, 2>::from_column_slice(y), f, project, receivers),
                        4 => integrate(task, |y| SVector::<Self, 4>::from_column_slice(y), f, project, receivers),
                        6 => integrate(task, |y| SVector::<Self, 6>::from_column_slice(y), f, project, receivers),
                        _ => integrate(task, DVector::<Self>::from_column_slice, f, project, receivers),
                    }
                }
            }
        )*
    };
}
integrable!(f32 f64);

/// Returns the number of stages after the first one.
const fn stages(method: Adaptive) -> usize {
    match method {
        Adaptive::Dopri5 => 6,
        Adaptive::Dop853 => 11,
    }
}

/// Returns the number of calls per accepted step that are not stages of the attempt.
const fn closing_calls(method: Adaptive) -> usize {
    match method {
        Adaptive::Dopri5 => 0,
        Adaptive::Dop853 => 1,
    }
}

/// Observes the solver while it runs.
struct Observer<'a, 'f, S, E> {
    task: &'a Integration<'a, S>,
    f: &'a mut Rhs<'f, S, E>,
    project: Option<&'a mut Project<'f, S, E>>,
    output: &'a mut Output<'f, S>,
    nodes: Option<&'a mut StepNodes<'f, S>>,
    scan: Option<&'a mut Scan<'f, S>>,
    rule: Tableau<S>,
    /// Slopes of the last calls in a ring of `ring` rows, the newest at `calls - 1`.
    recent: Vec<S>,
    calls: usize,
    /// Number of calls in a run before its first attempt, and the time of the last call.
    opening: usize,
    last_call: S,
    statistics: StepCounts,
    /// Last accepted step.
    elapsed: S,
    state: Vec<S>,
    slope: Vec<S>,
    step: S,
    /// First sample not yet delivered.
    next: usize,
    /// First failure since the last accepted step, and the one before that step.
    failure: Option<E>,
    earlier: Option<E>,
    /// Set if an accepted step failed at its end: the step size to try next.
    retry: Option<S>,
    /// Set if the state was projected: the first step size from the new state.
    restart: Option<S>,
    /// `true` once the time no longer advances.
    stuck: bool,
    /// `true` once the receiver accepts no more samples.
    stopped: bool,
    /// `true` if an event happens at the state.
    event: bool,
    interpolant: Interpolant<S>,
    slopes: Vec<S>,
    sample: Vec<S>,
}

impl<'a, 'f, S: Scalar, E> Observer<'a, 'f, S, E> {
    /// Creates an observer at the start, given the slope and the index of the first sample after it.
    fn new(
        task: &'a Integration<'a, S>,
        f: &'a mut Rhs<'f, S, E>,
        project: Option<&'a mut Project<'f, S, E>>,
        (output, nodes, scan): Receivers<'a, 'f, S>,
        (slope, next): (Vec<S>, usize),
    ) -> Self {
        let (zero, dim) = (<S as Real>::zero(), task.start.len());
        let ring = stages(task.method) + closing_calls(task.method);
        Self {
            task,
            f,
            project,
            output,
            nodes,
            scan,
            rule: Tableau::new(3),
            recent: vec![zero; ring * dim],
            calls: 0,
            opening: 0,
            last_call: zero,
            statistics: StepCounts { evaluations: 1, ..StepCounts::default() },
            elapsed: zero,
            state: task.start.to_vec(),
            slope,
            step: zero,
            next,
            failure: None,
            earlier: None,
            retry: None,
            restart: None,
            stuck: false,
            stopped: false,
            event: false,
            interpolant: Interpolant::default(),
            slopes: Vec::with_capacity((ring + 1) * dim),
            sample: vec![zero; dim],
        }
    }

    /// Prepares for a run of the solver; returns the allowed number of attempts.
    fn open_run(&mut self, first_step: S) -> usize {
        self.calls = 0;
        let attempts = self.statistics.accepted + self.statistics.rejected;
        let left = self.task.max_steps.saturating_sub(attempts);
        // Without a given first step, the solver evaluates two more states to choose one.
        self.opening = match () {
            () if left == 0 => 0,
            () if first_step == <S as Real>::zero() => 3,
            () => 1,
        };
        left
    }

    /// Derives the number of rejected attempts in a run from its calls.
    fn count_rejected(&mut self, accepted_before: usize) {
        let accepted = self.statistics.accepted - accepted_before;
        let closing = accepted * closing_calls(self.task.method);
        let attempts = (self.calls - self.opening - closing) / stages(self.task.method);
        self.statistics.rejected += attempts - accepted;
    }

    /// Returns the first step of the next run, if the run that began at an elapsed time was stopped to continue from another state or with
    /// a shorter step.
    fn continuation(&mut self, began: S, end: S) -> Option<S> {
        if let Some(step) = self.restart.take() {
            let first_step = Real::min(step, end - self.elapsed);
            if first_step > <S as Scalar>::epsilon().ldexp(2) * end {
                return Some(first_step);
            }
        }
        let failed = self.retry.take()?;
        // The last step was counted as accepted but not taken.
        self.statistics.accepted -= 1;
        self.statistics.rejected += 1;
        let first_step = failed * S::of_f64(RETRIED_SHARE);
        if began + first_step > began && self.elapsed + first_step > self.elapsed {
            return Some(first_step);
        }
        self.stuck = true;
        None
    }

    /// Returns why the last run ended early, if it did; otherwise delivers the remaining samples.
    fn ending(&mut self, result: Result<(), IntegrationError>) -> Option<EarlyEnd<E>> {
        match result {
            _ if self.stopped => Some(EarlyEnd::Stopped),
            _ if self.event => Some(EarlyEnd::Event),
            _ if self.stuck => Some(self.cause().map_or(EarlyEnd::Underflow, EarlyEnd::Failed)),
            Ok(()) => {
                // Because of rounding, the last step may end just before the end.
                while self.next < self.task.samples.len() {
                    let _ = (self.output)(self.next, &self.state);
                    self.next += 1;
                }
                None
            }
            Err(IntegrationError::MaxNumStepReached { .. }) => Some(EarlyEnd::TooManySteps),
            Err(_) => Some(self.cause().map_or(EarlyEnd::Underflow, EarlyEnd::Failed)),
        }
    }

    fn evaluate(&mut self, x: S, y: &[S], dy: &mut [S]) {
        let x = self.stage_time(x);
        self.last_call = x;
        if self.failure.is_some() && y.iter().any(|x| !x.is_finite()) {
            // An earlier failure in this attempt has already made the state invalid.
            dy.fill(S::nan());
        } else if y == self.state.as_slice() && (!self.task.timed || x == self.elapsed) {
            dy.copy_from_slice(&self.slope);
        } else {
            self.statistics.evaluations += 1;
            if let Err(error) = (self.f)(x, y, dy) {
                self.failure.get_or_insert(error);
                dy.fill(S::nan());
            }
        }
        let row = (self.calls % self.ring()) * dy.len();
        self.recent[row..row + dy.len()].copy_from_slice(dy);
        self.calls += 1;
    }

    /// Returns the time of a stage. The table of the method of order 8 puts stage 12 at the start of the step, but it is at its end; stage
    /// 11, evaluated just before, is at 6/7 of the step.
    fn stage_time(&self, x: S) -> S {
        if self.task.method == Adaptive::Dop853 && self.calls >= self.opening && x == self.elapsed {
            self.elapsed + (self.last_call - self.elapsed) * S::ratio(7, 6)
        } else {
            x
        }
    }

    /// Returns the number of rows of `recent`: the calls of one accepted step.
    fn ring(&self) -> usize {
        stages(self.task.method) + closing_calls(self.task.method)
    }

    /// Processes an accepted step; returns `true` to stop the solver.
    fn accepted(&mut self, x: S, y: &[S], slope: &[S]) -> bool {
        self.statistics.accepted += 1;
        let h = x - self.elapsed;
        if h <= <S as Real>::zero() {
            self.stuck = true;
            return true;
        }
        // Failures in rejected attempts are harmless, but not a failure in the last evaluation of a step.
        if slope.iter().any(|x| !x.is_finite()) {
            self.retry = Some(h);
            return true;
        }
        let rejected = self.failure.take();
        let is_dense = self.nodes.is_some() || self.scan.is_some();
        let inside = is_dense || self.task.samples.get(self.next).is_some_and(|t| t < x);
        if inside && !self.interpolate(h, y) {
            self.retry = Some(h);
            return true;
        }
        self.earlier = rejected;
        if self.ends_at_event(h) {
            return true;
        }
        let projected = self.project.as_mut().map(|project| {
            let mut moved = y.to_vec();
            project(h, &mut moved).map(|drift| (drift, moved))
        });
        let projected = match projected.transpose() {
            Ok(projected) => projected,
            Err(error) => {
                (self.failure, self.stuck) = (Some(error), true);
                return true;
            }
        };
        self.visit_nodes(h, <S as Real>::one());
        while let Some(t) = self.task.samples.get(self.next) {
            if t > x {
                break;
            }
            let more = if t == x {
                (self.output)(self.next, y)
            } else {
                self.interpolant.evaluate((t - self.elapsed) / h, &mut self.sample);
                (self.output)(self.next, &self.sample)
            };
            self.next += 1;
            if !more {
                self.stopped = true;
                break;
            }
        }
        self.elapsed = x;
        self.step = h;
        self.state.copy_from_slice(y);
        self.slope.copy_from_slice(slope);
        self.stopped || projected.is_some_and(|(drift, moved)| self.restarts(x, h, drift, moved))
    }

    /// Restarts from the projection of a state that has drifted by more than the tolerance. Returns `true` to stop the solver, which does
    /// not know the new state.
    fn restarts(&mut self, x: S, h: S, drift: S, moved: Vec<S>) -> bool {
        if drift <= <S as Real>::one() || self.next >= self.task.samples.len() {
            return false;
        }
        self.statistics.evaluations += 1;
        if let Err(error) = (self.f)(x, &moved, &mut self.slope) {
            (self.failure, self.stuck) = (Some(error), true);
            return true;
        }
        self.state = moved;
        self.restart = Some(h);
        true
    }

    /// Ends the step of the interpolant at an event within it, if there is one.
    fn ends_at_event(&mut self, h: S) -> bool {
        let (Some(scan), interpolant) = (&mut self.scan, &self.interpolant) else { return false };
        let Some(share) = scan(self.elapsed, h, &mut |share, state| interpolant.evaluate(share, state)) else {
            return false;
        };
        self.visit_nodes(h, share);
        let at = self.elapsed + share * h;
        while let Some(t) = self.task.samples.get(self.next).filter(|t| *t < at) {
            self.interpolant.evaluate((t - self.elapsed) / h, &mut self.sample);
            self.stopped |= !(self.output)(self.next, &self.sample);
            self.next += 1;
        }
        self.interpolant.evaluate(share, &mut self.state);
        (self.elapsed, self.step, self.event) = (at, h, true);
        true
    }

    /// Passes quadrature nodes to the receiver within the accepted first fraction of the interpolant's step.
    fn visit_nodes(&mut self, h: S, whole: S) {
        let Some(nodes) = &mut self.nodes else { return };
        let part = S::ratio(1, QUADRATURE_PANELS as i32);
        for panel in 0..QUADRATURE_PANELS {
            for (&node, &weight) in self.rule.nodes.iter().zip(&self.rule.weights) {
                let share = (S::of_f64(panel as f64) + node) * part * whole;
                self.interpolant.evaluate(share, &mut self.sample);
                nodes(self.elapsed + share * h, weight * part * whole * h, &self.sample);
            }
        }
    }

    /// Prepares the interpolant of the step to `y`; returns `false` if a required evaluation fails.
    fn interpolate(&mut self, h: S, y: &[S]) -> bool {
        let dim = y.len();
        let ring = self.ring();
        self.slopes.clear();
        self.slopes.extend_from_slice(&self.slope);
        for call in self.calls - ring..self.calls {
            let row = (call % ring) * dim;
            self.slopes.extend_from_slice(&self.recent[row..row + dim]);
        }
        let step = Step { t0: self.elapsed, h, y0: &self.state, y1: y, slopes: &self.slopes };
        match self.task.method {
            Adaptive::Dopri5 => {
                self.interpolant.dopri5(&step);
                true
            }
            Adaptive::Dop853 => {
                self.statistics.evaluations += 3;
                self.interpolant.dop853(&step, self.f).map_err(|error| self.failure = Some(error)).is_ok()
            }
        }
    }

    /// Returns the failure that caused the steps to shrink.
    fn cause(&mut self) -> Option<E> {
        self.failure.take().or_else(|| self.earlier.take())
    }
}

/// The observer in the form that the solver requires.
struct Watched<'w, 'a, 'f, S, E>(&'w RefCell<Observer<'a, 'f, S, E>>);

impl<S, D, E> System<S, OVector<S, D>> for Watched<'_, '_, '_, S, E>
where
    S: Scalar + FloatNumber,
    D: Dim,
    DefaultAllocator: Allocator<D>,
{
    fn system(&self, x: S, y: &OVector<S, D>, dy: &mut OVector<S, D>) {
        self.0.borrow_mut().evaluate(x, y.as_slice(), dy.as_mut_slice());
    }

    fn solout(&mut self, x: S, y: &OVector<S, D>, dy: &OVector<S, D>) -> bool {
        self.0.borrow_mut().accepted(x, y.as_slice(), dy.as_slice())
    }
}

/// Runs the solver, restarting it from every state that its observer has changed, until the last sample.
fn integrate<S, D, E>(
    task: &Integration<'_, S>,
    vector: impl Fn(&[S]) -> OVector<S, D>,
    f: &mut Rhs<'_, S, E>,
    project: Option<&mut Project<'_, S, E>>,
    (output, nodes, scan): Receivers<'_, '_, S>,
) -> Ran<S, E>
where
    S: Scalar + FloatNumber,
    f64: From<S>,
    D: Dim,
    DefaultAllocator: Allocator<D>,
    OVector<S, D>: std::ops::Mul<S, Output = OVector<S, D>>,
{
    let zero = <S as Real>::zero();
    let mut ran = Ran {
        statistics: StepCounts { evaluations: 1, ..StepCounts::default() },
        elapsed: zero,
        state: task.start.to_vec(),
        step: zero,
        ended: None,
    };
    let end = task.samples.len().checked_sub(1).and_then(|last| task.samples.get(last));
    let (begun, end) = match (begin(task, f, output), end) {
        (Ok(begun), Some(end)) => (begun, end),
        (begun, _) => return Ran { ended: begun.err(), ..ran },
    };
    let project = project.map(|project| project as &mut Project<'_, S, E>);
    let nodes = nodes.map(|nodes| nodes as &mut StepNodes<'_, S>);
    let scan = scan.map(|scan| scan as &mut Scan<'_, S>);
    let observer = RefCell::new(Observer::new(task, f, project, (output, nodes, scan), begun));
    let mut first_step = task.first_step;
    while ran.ended.is_none() && observer.borrow().next < task.samples.len() {
        let (elapsed, y, attempts_left) = {
            let mut observer = observer.borrow_mut();
            let attempts_left = observer.open_run(first_step);
            (observer.elapsed, vector(&observer.state), attempts_left)
        };
        let accepted_before = observer.borrow().statistics.accepted;
        let result = if attempts_left == 0 {
            Err(IntegrationError::MaxNumStepReached { x: 0.0, n_step: 0 })
        } else {
            run(task, Watched(&observer), elapsed, end, y, first_step, attempts_left)
        };
        let mut observer = observer.borrow_mut();
        observer.count_rejected(accepted_before);
        match observer.continuation(elapsed, end) {
            Some(step) => first_step = step,
            None => ran.ended = observer.ending(result),
        }
    }
    let observer = observer.into_inner();
    Ran {
        statistics: observer.statistics,
        elapsed: observer.elapsed,
        state: observer.state,
        step: observer.step,
        ..ran
    }
}

/// Computes the slope at the start, delivers the samples there, and returns the index of the first one after it.
///
/// # Errors
/// The right-hand side fails at the start, or the receiver accepts no more samples.
fn begin<S: Scalar, E>(
    task: &Integration<'_, S>,
    f: &mut Rhs<'_, S, E>,
    output: &mut Output<'_, S>,
) -> Result<(Vec<S>, usize), EarlyEnd<E>> {
    let zero = <S as Real>::zero();
    let mut slope = vec![zero; task.start.len()];
    f(zero, task.start, &mut slope).map_err(EarlyEnd::Failed)?;
    let mut next = 0;
    while task.samples.get(next).is_some_and(|t| t <= zero) {
        if !output(next, task.start) {
            return Err(EarlyEnd::Stopped);
        }
        next += 1;
    }
    Ok((slope, next))
}

/// Runs the solver once from `elapsed` to `end` with its default settings, except that stiffness detection is off, because the number of
/// steps is limited instead.
fn run<S, D, E>(
    task: &Integration<'_, S>,
    watched: Watched<'_, '_, '_, S, E>,
    elapsed: S,
    end: S,
    y: OVector<S, D>,
    first_step: S,
    max_steps: usize,
) -> Result<(), IntegrationError>
where
    S: Scalar + FloatNumber,
    f64: From<S>,
    D: Dim,
    DefaultAllocator: Allocator<D>,
    OVector<S, D>: std::ops::Mul<S, Output = OVector<S, D>>,
{
    let number = <S as Scalar>::of_f64;
    // For a component that stays 0, the error would be 0/0.
    let smallest = <S as Scalar>::min_positive();
    let atol = if task.atol > smallest { task.atol } else { smallest };
    let max_steps = u32::try_from(max_steps).unwrap_or(u32::MAX - 1);
    macro_rules! solve {
        ($solver:ident, $beta:expr, $shrink:expr, $grow:expr) => {
            $solver::from_param(
                watched,
                elapsed,
                end,
                end,
                y,
                task.rtol,
                atol,
                number(0.9),
                number($beta),
                number($shrink),
                number($grow),
                end - elapsed,
                first_step,
                max_steps,
                u32::MAX,
                OutputType::Sparse,
            )
            .integrate()
            .map(|_| ())
        };
    }
    match task.method {
        Adaptive::Dopri5 => solve!(Dopri5, 0.04, 0.2, 10.0),
        Adaptive::Dop853 => solve!(Dop853, 0.0, 0.333, 6.0),
    }
}

#[cfg(test)]
mod tests {
    //! Tests the dense output of single steps, and samples at equal times.

    use super::*;

    /// Returns samples of `y' = -y` from 1.
    fn decay(method: Adaptive, tolerance: f64, first_step: f64, samples: &Vec<f64>) -> (Vec<f64>, StepCounts) {
        let task = Integration {
            method,
            rtol: tolerance,
            atol: tolerance,
            max_steps: 1000,
            first_step,
            timed: false,
            start: &[1.0],
            samples,
        };
        let mut got = Vec::new();
        let ran = f64::integrate::<()>(
            &task,
            &mut |_, y, dy| {
                dy[0] = -y[0];
                Ok(())
            },
            None,
            (
                &mut |k, y| {
                    assert_eq!(k, got.len());
                    got.push(y[0]);
                    true
                },
                None,
                None,
            ),
        );
        assert!(ran.ended.is_none());
        (got, ran.statistics)
    }

    /// Returns the largest error of the samples of a single step of size `h`.
    fn single_step(method: Adaptive, h: f64) -> f64 {
        let samples: Vec<f64> = (0..=20).map(|k| h * f64::from(k) / 20.0).collect();
        let (got, statistics) = decay(method, 1e6, h, &samples);
        assert_eq!((statistics.accepted, statistics.rejected), (1, 0));
        assert_eq!(got.len(), samples.len());
        samples.iter().zip(got).map(|(t, y)| (y - (-t).exp()).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn interpolation_is_right_inside_a_single_step_with_its_order() {
        for (method, order, bound) in [(Adaptive::Dopri5, 4.0, 2e-4), (Adaptive::Dop853, 7.0, 2e-7)] {
            assert!(single_step(method, 0.5) < bound, "{method:?}: {:e}", single_step(method, 0.5));
            // The local error is proportional to h^(order + 1).
            let slope = (single_step(method, 0.5) / single_step(method, 0.25)).log2();
            assert!((slope - order - 1.0).abs() < 0.35, "{method:?}: {slope}");
        }
    }

    #[test]
    fn a_sample_at_zero_and_two_at_one_time() {
        let (got, _) = decay(Adaptive::Dop853, 1e-10, 0.0, &vec![0.0, 0.0, 1.0, 1.0]);
        assert_eq!(got[..2], [1.0, 1.0]);
        assert_eq!(got[2], got[3]);
        assert!((got[2] - (-1.0_f64).exp()).abs() < 1e-9);
    }
}
