//! Observes a solver while it runs: counts its steps, delivers the samples, and finds why it ends.

use super::StepCounts;
use super::dense::{Interpolant, Rhs, Step};
use super::gauss::Tableau;
use super::integration::{Adaptive, EarlyEnd, Integration, Output, Project, Receivers, Scan, StepNodes};
use super::thresholds::{QUADRATURE_PANELS, RETRIED_SHARE};
use crate::scalar::{Real, Scalar};

/// How a run of the solver ended.
pub(super) enum RunEnd {
    /// At the last sample, or where the observer stopped it.
    Complete,
    /// The allowed number of attempts is used up.
    TooManySteps,
    /// The solver found no step that it accepts.
    Failed,
}

/// Observes the solver while it runs.
pub(super) struct Observer<'a, 'f, S, E> {
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
    pub(super) statistics: StepCounts,
    /// Last accepted step.
    pub(super) elapsed: S,
    pub(super) state: Vec<S>,
    slope: Vec<S>,
    pub(super) step: S,
    /// First sample not yet delivered.
    pub(super) next: usize,
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
    pub(super) fn new(
        task: &'a Integration<'a, S>,
        f: &'a mut Rhs<'f, S, E>,
        project: Option<&'a mut Project<'f, S, E>>,
        (output, nodes, scan): Receivers<'a, 'f, S>,
        (slope, next): (Vec<S>, usize),
    ) -> Self {
        let (zero, dim) = (<S as Real>::zero(), task.start.len());
        let ring = task.method.stages() + task.method.closing_calls();
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
    pub(super) fn open_run(&mut self, first_step: S) -> usize {
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
    pub(super) fn count_rejected(&mut self, accepted_before: usize) {
        let accepted = self.statistics.accepted - accepted_before;
        let closing = accepted * self.task.method.closing_calls();
        let attempts = (self.calls - self.opening - closing) / self.task.method.stages();
        self.statistics.rejected += attempts - accepted;
    }

    /// Returns the first step of the next run, if the run that began at an elapsed time was stopped to continue from another state or with
    /// a shorter step.
    pub(super) fn continuation(&mut self, began: S, end: S) -> Option<S> {
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
    pub(super) fn ending(&mut self, run: RunEnd) -> Option<EarlyEnd<E>> {
        match run {
            _ if self.stopped => Some(EarlyEnd::Stopped),
            _ if self.event => Some(EarlyEnd::Event),
            _ if self.stuck => Some(self.cause().map_or(EarlyEnd::Underflow, EarlyEnd::Failed)),
            RunEnd::Complete => {
                // Because of rounding, the last step may end just before the end.
                while self.next < self.task.samples.len() {
                    let _ = (self.output)(self.next, &self.state);
                    self.next += 1;
                }
                None
            }
            RunEnd::TooManySteps => Some(EarlyEnd::TooManySteps),
            RunEnd::Failed => Some(self.cause().map_or(EarlyEnd::Underflow, EarlyEnd::Failed)),
        }
    }

    pub(super) fn evaluate(&mut self, x: S, y: &[S], dy: &mut [S]) {
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
        self.task.method.stages() + self.task.method.closing_calls()
    }

    /// Processes an accepted step; returns `true` to stop the solver.
    pub(super) fn accepted(&mut self, x: S, y: &[S], slope: &[S]) -> bool {
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
