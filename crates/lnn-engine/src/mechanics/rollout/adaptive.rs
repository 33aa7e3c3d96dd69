//! Adaptive steps with error control, divided into pieces within which the external force is smooth.

use super::crossing::{Dense, Found, Watcher};
use super::force::{Piece, pieces};
use super::integration::{Adaptive, EarlyEnd, Integration, Project, Scan, StepNodes};
use super::regular::Regularity;
use super::run::{Keep, Nodes, Receivers, into_error};
use super::thresholds::STEP_GROWTH_AFTER_BREAK;
use super::trajectory::{Part, Samples, Times};
use super::{
    Domain, Force, Integrable, Occurrence, RolloutError, RolloutOptions, StepCounts, StepFailure, UnderflowCause,
};
use crate::lagrangian::{Accelerations, EulerLagrange, Manifold, MechanicsError, Request, Terms, project};
use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar};

/// The equations of a motion in elapsed time `|t - t0|`.
struct MotionEquations<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    force: Option<&'a dyn Force<S>>,
    options: &'a RolloutOptions<S>,
    n: usize,
    /// `true` if the accelerations depend on the time, through the model or through an external force.
    timed: bool,
    /// The model, if they do not.
    accelerations: Accelerations<'a, S>,
    /// The terms of the model, if they do.
    terms: Terms<S>,
    external: Vec<S>,
    workspace: Workspace<S>,
}

impl<S: Scalar> MotionEquations<'_, S> {
    fn backwards(&self) -> bool {
        self.options.t_end < self.options.t0
    }

    /// Returns the time at which this much time has elapsed since the start.
    fn time(&self, elapsed: S) -> S {
        time(self.options, elapsed)
    }

    /// Computes the derivative of `y = (q, v)` by the elapsed time.
    fn derivative(&mut self, piece: &Piece<S>, elapsed: S, y: &[S], dy: &mut [S]) -> Result<(), StepFailure> {
        let n = self.n;
        StepFailure::check(self.options.domain.as_ref(), y)?;
        let (q, v) = y.split_at(n);
        let (speed, a) = dy.split_at_mut(n);
        speed.copy_from_slice(v);
        if self.timed {
            let t = piece.time(self.time(elapsed));
            self.model.terms_at(&[t], q, v, Request::ACCELERATION, &mut self.terms).map_err(StepFailure::Model)?;
            if let Some(force) = self.force {
                force.force(t, q, v, &mut self.external);
                self.terms.add_force(n, v, &self.external, &mut self.workspace).map_err(StepFailure::Model)?;
            }
            a.copy_from_slice(&self.terms.acceleration);
        } else {
            self.accelerations.at(q, v, a).map_err(StepFailure::Model)?;
        }
        if a.iter().any(|a| !a.is_finite()) {
            return Err(StepFailure::Model(MechanicsError::NotFinite { row: 0, what: "acceleration" }));
        }
        if self.backwards() {
            dy.iter_mut().for_each(|slope| *slope = -*slope);
        }
        Ok(())
    }
}

/// Returns the time of a motion for an elapsed time.
fn time<S: Scalar>(options: &RolloutOptions<S>, elapsed: S) -> S {
    if options.t_end < options.t0 { options.t0 - elapsed } else { options.t0 + elapsed }
}

/// Integrates from `(q, v)` to the end of the options, or as far as possible. The arguments must be checked before.
pub(super) fn run<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    method: Adaptive,
    start: (&[S], &[S]),
    options: &RolloutOptions<S>,
    (keep, nodes, events): Receivers<'_, '_, S>,
) -> (StepCounts, Option<RolloutError>) {
    let mut progress = match Progress::new(model, force, start, options, events) {
        Ok(progress) => progress,
        Err(error) => return (StepCounts::default(), Some(error)),
    };
    let cuts = pieces(force.map_or(&[], |force| force.breaks()), options.t0, options.t_end);
    let outcome = progress.run(&cuts, method, keep, nodes);
    (progress.total, outcome.err())
}

/// The current state of a motion.
struct Progress<'a, S> {
    equations: MotionEquations<'a, S>,
    manifold: Option<&'a dyn Manifold<S>>,
    regular: Option<Regularity<'a, S>>,
    watcher: Option<Watcher<'a, S>>,
    all: Samples<S>,
    total: StepCounts,
    /// Elapsed time and state.
    start: S,
    state: Vec<S>,
    /// The index of the next sample, and the size of the next step; 0 lets the solver choose it.
    first: usize,
    first_step: S,
}

impl<'a, S: Integrable> Progress<'a, S> {
    /// Starts a motion at `(q, v)`.
    ///
    /// # Errors
    /// The options do not allow an event.
    fn new(
        model: &'a dyn EulerLagrange<S>,
        force: Option<&'a dyn Force<S>>,
        (q, v): (&[S], &[S]),
        options: &'a RolloutOptions<S>,
        events: &'a mut Vec<Occurrence<S>>,
    ) -> Result<Self, RolloutError> {
        let (n, zero) = (model.coordinates(), <S as Real>::zero());
        let equations = MotionEquations {
            model,
            force,
            options,
            n,
            timed: force.is_some() || model.is_timed(),
            accelerations: Accelerations::new(model),
            terms: Terms::default(),
            external: vec![zero; n],
            workspace: Workspace::new(),
        };
        let manifold = model.manifold();
        Ok(Self {
            manifold,
            regular: manifold.map(|manifold| Regularity::new(manifold, (q, v), equations.backwards())),
            watcher: Watcher::new(model, (q, v), options, events)?,
            all: Samples::new(options),
            total: StepCounts::default(),
            start: zero,
            state: q.iter().chain(v).copied().collect(),
            first: 0,
            first_step: zero,
            equations,
        })
    }

    /// Integrates piece after piece, and from event to event.
    fn run(
        &mut self,
        cuts: &[Piece<S>],
        method: Adaptive,
        keep: &mut Keep<'_, S>,
        mut nodes: Option<&mut Nodes<'_, S>>,
    ) -> Result<(), RolloutError> {
        for piece in cuts {
            while let Some(found) = self.advance(piece, method, keep, &mut nodes)? {
                if self.is_ended_by(found, keep)? {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Returns the remaining samples of a piece, which is integrated to its end even if there is no sample at it.
    fn samples(&self, piece: &Piece<S>) -> Part<S> {
        let (all, first) = (self.all, self.first);
        let last = piece.end >= all.elapsed(all.len() - 1);
        let after = if last { all.len() } else { all.count_until(piece.end) };
        let end = (!last && (after == first || all.elapsed(after - 1) < piece.end)).then_some(piece.end);
        Part { all, first, after, start: self.start, end }
    }

    /// Integrates to the end of a piece, or to the first event that interrupts the motion, which is returned.
    fn advance(
        &mut self,
        piece: &Piece<S>,
        method: Adaptive,
        keep: &mut Keep<'_, S>,
        nodes: &mut Option<&mut Nodes<'_, S>>,
    ) -> Result<Option<Found<S>>, RolloutError> {
        let samples = self.samples(piece);
        let Self { equations, manifold, regular, watcher, start, .. } = self;
        let (options, n, backwards) = (equations.options, equations.n, equations.backwards());
        let (manifold, start) = (*manifold, *start);
        let task = Integration {
            method,
            rtol: options.rtol,
            atol: options.atol,
            max_steps: options.max_steps.saturating_sub(self.total.accepted + self.total.rejected),
            first_step: S::min(self.first_step, piece.end - start),
            timed: equations.timed,
            start: &self.state,
            samples: &samples,
        };
        let mut delivery = Delivery { manifold, options, samples, on: Vec::with_capacity(2 * n), next: 0, valid: true };
        let mut sample = |k: usize, y: &[S]| delivery.deliver(k, y, keep);
        let are_nodes_wanted = nodes.is_some();
        let mut node = |e: S, weight: S, y: &[S]| {
            let weight = if backwards { -weight } else { weight };
            nodes.iter_mut().for_each(|nodes| nodes(time(options, start + e), weight, &y[..n], &y[n..]));
        };
        let node = are_nodes_wanted.then_some(&mut node as &mut StepNodes<'_, S>);
        let (mut found, are_events_watched) = (None, watcher.is_some());
        let mut scan = |e: S, h: S, dense: &mut Dense<'_, S>| {
            let time = |share: S| time(options, start + (e + share * h));
            found = watcher.as_mut()?.interruption(manifold, &time, dense);
            found.map(|(_, share)| share)
        };
        let scan = are_events_watched.then_some(&mut scan as &mut Scan<'_, S>);
        let mut derivative = |e: S, y: &[S], dy: &mut [S]| equations.derivative(piece, start + e, y, dy);
        let mut back = |h: S, y: &mut [S]| {
            let drift = returned(manifold, options, n, y)?;
            regular.as_mut().map_or(Ok(()), |regular| regular.step(h, &y[..n], &y[n..]))?;
            Ok(drift)
        };
        let project = manifold.is_some().then_some(&mut back as &mut Project<'_, S, StepFailure>);
        let mut ran = S::integrate(&task, &mut derivative, project, (&mut sample, node, scan));
        let struck = found.map(|(_, share)| share).filter(|share| manifold.is_some() && *share > <S as Real>::zero());
        let failed = struck.and_then(|share| back(share * ran.step, &mut ran.state).err());
        let Delivery { next, valid, .. } = delivery;
        let ended = failed.map(EarlyEnd::Failed).or(ran.ended);
        self.total += ran.statistics;
        if let Some(error) = stopped(equations, piece, ended, valid, (start + ran.elapsed, &ran.state, ran.step)) {
            return Err(error);
        }
        self.state = ran.state;
        (self.start, self.first, self.first_step) = match found {
            Some(_) => (start + ran.elapsed, self.first + next, ran.step),
            None => (piece.end, samples.after, S::of_f64(STEP_GROWTH_AFTER_BREAK) * ran.step),
        };
        Ok(found.map(|(found, _)| found))
    }

    /// Applies an event to the state; returns `true` if it ends the motion, after adding a last sample there.
    ///
    /// # Errors
    /// The impact is not determined, or the receiver accepts no more samples.
    fn is_ended_by(&mut self, found: Found<S>, keep: &mut Keep<'_, S>) -> Result<bool, RolloutError> {
        let t = self.equations.time(self.start);
        let Some(watcher) = &mut self.watcher else { return Ok(false) };
        watcher.strike(found, t, &mut self.state)?;
        let (q, v) = self.state.split_at(self.equations.n);
        if watcher.over {
            return if keep(t, q, v) { Ok(true) } else { Err(RolloutError::Stopped { t: t.to_f64() }) };
        }
        let backwards = self.equations.backwards();
        self.regular = self.manifold.map(|manifold| Regularity::new(manifold, (q, v), backwards));
        Ok(false)
    }
}

/// Delivers the samples of a piece.
struct Delivery<'a, S> {
    manifold: Option<&'a dyn Manifold<S>>,
    options: &'a RolloutOptions<S>,
    samples: Part<S>,
    /// The sample projected onto the constraints.
    on: Vec<S>,
    /// The number of delivered samples.
    next: usize,
    /// `true` until a sample is outside the domain or not finite.
    valid: bool,
}

impl<S: Scalar> Delivery<'_, S> {
    /// Delivers sample `k` of the piece at the state `y`; returns `false` if no more are accepted.
    fn deliver(&mut self, k: usize, y: &[S], keep: &mut Keep<'_, S>) -> bool {
        let n = y.len() / 2;
        self.next = k + 1;
        self.on.clear();
        self.on.extend_from_slice(y);
        // Between steps, the interpolation error moves a sample off the constraints.
        if let Some(manifold) = self.manifold {
            let (q, v) = self.on.split_at_mut(n);
            self.valid &= project(manifold, q, v).is_ok();
        }
        let y = self.on.as_slice();
        // The interpolation may exceed a bound by less than the tolerance.
        let is_outside = |domain: &Domain<S>| domain.violation(y).is_some();
        self.valid &= y.iter().all(|x| x.is_finite()) && !self.options.domain.as_ref().is_some_and(is_outside);
        // Samples after an invalid one are dropped, but the motion is integrated to the end of the piece.
        let Part { all, first, after, .. } = self.samples;
        !self.valid || first + k >= after || keep(all.time(first + k), &y[..n], &y[n..])
    }
}

/// Projects a state back onto the constraints; returns the distance in the norm and unit of the step error.
fn returned<S: Scalar>(
    manifold: Option<&dyn Manifold<S>>,
    options: &RolloutOptions<S>,
    n: usize,
    y: &mut [S],
) -> Result<S, StepFailure> {
    let (before, zero) = (y.to_vec(), <S as Real>::zero());
    let (q, v) = y.split_at_mut(n);
    manifold.map_or(Ok([0.0; 2]), |manifold| project(manifold, q, v)).map_err(|_| StepFailure::OffConstraints)?;
    let squares = before.iter().zip(&*y).fold(zero, |sum, (&a, &b)| {
        sum + Real::sqr((a - b) / (options.atol + options.rtol * a.abs() + S::min_positive()))
    });
    Ok(Real::sqrt(squares / S::of_f64(2.0 * n as f64)))
}

/// Returns the reason why a piece ended early, if it did.
fn stopped<S: Integrable>(
    motion: &mut MotionEquations<'_, S>,
    piece: &Piece<S>,
    ended: Option<EarlyEnd<StepFailure>>,
    valid: bool,
    (elapsed, reached, step): (S, &[S], S),
) -> Option<RolloutError> {
    let t = motion.time(elapsed).to_f64();
    let state: Vec<f64> = reached.iter().map(|x| x.to_f64()).collect();
    let step = step.to_f64();
    match ended {
        None | Some(EarlyEnd::Event) if valid => None,
        None | Some(EarlyEnd::Event) => left(motion.options.domain.as_ref(), reached, t, state),
        Some(EarlyEnd::Stopped) => Some(RolloutError::Stopped { t }),
        Some(EarlyEnd::TooManySteps) => Some(RolloutError::TooManySteps { t, steps: motion.options.max_steps }),
        Some(EarlyEnd::Failed(failure)) => Some(into_error(failure, t, state, step)),
        Some(EarlyEnd::Underflow) => {
            let mut slope = vec![S::nan(); reached.len()];
            let largest_acceleration = match motion.derivative(piece, elapsed, reached, &mut slope) {
                Ok(()) => slope[motion.n..].iter().map(|a| a.abs().to_f64()).fold(0.0, f64::max),
                Err(_) => f64::NAN,
            };
            let cause = UnderflowCause::ErrorTest { largest_acceleration };
            Some(RolloutError::StepUnderflow { t, state, step, cause })
        }
    }
}

/// Returns the error for a trajectory whose samples exceed a bound within the tolerance, although its steps do not.
fn left<S: Scalar>(domain: Option<&Domain<S>>, reached: &[S], t: f64, state: Vec<f64>) -> Option<RolloutError> {
    let (component, lower, upper) = domain?.violation(reached).or_else(|| domain?.tightest(reached))?;
    let (value, lower, upper) = (state[component], lower.to_f64(), upper.to_f64());
    Some(RolloutError::LeftDomain { t, state, component, value, lower, upper })
}
