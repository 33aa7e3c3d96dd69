//! Steps under error control, piece by piece where a force from outside is not smooth.

use super::crossing::{Dense, Watcher};
use super::force::{Piece, pieces};
use super::ode::{Adaptive, EarlyEnd, Integration, Project, Ran, Scan, StepNodes};
use super::regular::Regularity;
use super::run::{Receivers, into_error};
use super::trajectory::{Part, Samples, Times};
use super::{Domain, Force, Integrable, RolloutError, RolloutOptions, StepCounts, StepFailure, UnderflowCause};
use crate::lagrangian::{Accelerations, EulerLagrange, Manifold, MechanicsError, Request, Terms, project};
use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar};

/// Growth of the first step after a break over the last step before it, which may have been cut short.
const GROWTH: f64 = 2.0;

/// The equations of a motion in elapsed time `|t - t0|`.
struct MotionEquations<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    force: Option<&'a dyn Force<S>>,
    options: &'a RolloutOptions<S>,
    n: usize,
    /// `true` if the accelerations depend on the time, through the model or through an external force.
    timed: bool,
    /// The model if they do not.
    accelerations: Accelerations<'a, S>,
    /// The terms of the model if they do.
    terms: Terms<S>,
    external: Vec<S>,
    workspace: Workspace<S>,
}

impl<S: Scalar> MotionEquations<'_, S> {
    fn backwards(&self) -> bool {
        self.options.t_end < self.options.t0
    }

    /// The time when so much has elapsed.
    fn time(&self, elapsed: S) -> S {
        if self.backwards() { self.options.t0 - elapsed } else { self.options.t0 + elapsed }
    }

    /// Derivative of `y = (q, v)` with respect to the elapsed time.
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

/// Integrates from `(q, v)` to the end of the options, or as far as possible; arguments are checked.
pub(super) fn run<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    method: Adaptive,
    (q, v): (&[S], &[S]),
    options: &RolloutOptions<S>,
    (keep, mut nodes, events): Receivers<'_, '_, S>,
) -> (StepCounts, Option<RolloutError>) {
    let mut total = StepCounts::default();
    let (n, zero) = (model.coordinates(), <S as Real>::zero());
    let (terms, external, workspace) = (Terms::default(), vec![zero; n], Workspace::new());
    let accelerations = Accelerations::new(model);
    let timed = force.is_some() || model.is_timed();
    let mut motion = MotionEquations { model, force, options, n, timed, accelerations, terms, external, workspace };
    let all = Samples::new(options);
    let (domain, manifold) = (options.domain.as_ref(), model.manifold());
    let mut state: Vec<S> = q.iter().chain(v).copied().collect();
    let mut regular = manifold.map(|manifold| Regularity::new(manifold, (q, v), motion.backwards()));
    let (mut start, mut first, mut first_step) = (zero, 0, zero);
    let nodes_are_asked_for = nodes.is_some();
    let mut watcher = match Watcher::new(model, (q, v), options, events) {
        Ok(watcher) => watcher,
        Err(error) => return (total, Some(error)),
    };
    let watched = watcher.is_some();
    let cuts = pieces(force.map_or(&[], |force| force.breaks()), options.t0, options.t_end);
    let mut passed = 0_usize;
    while let Some(piece) = cuts.get(passed) {
        // The samples of this piece; it is integrated to its end even if that is not a sample.
        let last = piece.end >= all.elapsed(all.len() - 1);
        let after = if last { all.len() } else { all.count_until(piece.end) };
        let end = (!last && (after == first || all.elapsed(after - 1) < piece.end)).then_some(piece.end);
        let samples = Part { all, first, after, start, end };
        let attempts = total.accepted + total.rejected;
        let task = Integration {
            method,
            rtol: options.rtol,
            atol: options.atol,
            max_steps: options.max_steps.saturating_sub(attempts),
            first_step: S::min(first_step, piece.end - start),
            timed,
            start: &state,
            samples: &samples,
        };
        let (mut valid, mut delivered, mut found) = (true, 0, None);
        let mut on = Vec::with_capacity(2 * n);
        let mut sample = |k: usize, y: &[S]| {
            delivered = k + 1;
            on.clear();
            on.extend_from_slice(y);
            // Between two states it deviates by the error of the interpolation.
            if let Some(manifold) = manifold {
                let (q, v) = on.split_at_mut(n);
                valid &= project(manifold, q, v).is_ok();
            }
            let y = on.as_slice();
            // An interpolated state may still cross a bound by less than the tolerance.
            valid &= y.iter().all(|x| x.is_finite()) && domain.is_none_or(|domain| domain.violation(y).is_none());
            // The samples after an invalid one are dropped; the motion continues to its end.
            !valid || first + k >= after || keep(all.time(first + k), &y[..n], &y[n..])
        };
        let (t0, backwards) = (options.t0, motion.backwards());
        let mut node = |e: S, weight: S, y: &[S]| {
            let (t, weight) = if backwards { (t0 - (start + e), -weight) } else { (t0 + (start + e), weight) };
            nodes.iter_mut().for_each(|nodes| nodes(t, weight, &y[..n], &y[n..]));
        };
        let node = nodes_are_asked_for.then_some(&mut node as &mut StepNodes<'_, S>);
        let mut scan = |e: S, h: S, dense: &mut Dense<'_, S>| {
            let elapsed = |share: S| start + (e + share * h);
            let time = |share: S| if backwards { t0 - elapsed(share) } else { t0 + elapsed(share) };
            found = watcher.as_mut()?.interruption(manifold, &time, dense);
            found.map(|(_, share)| share)
        };
        let scan = watched.then_some(&mut scan as &mut Scan<'_, S>);
        let mut derivative = |e: S, y: &[S], dy: &mut [S]| motion.derivative(&piece, start + e, y, dy);
        let mut back = |h: S, y: &mut [S]| {
            let drift = returned(manifold, options, n, y)?;
            regular.as_mut().map_or(Ok(()), |regular| regular.step(h, &y[..n], &y[n..]))?;
            Ok(drift)
        };
        let project = manifold.is_some().then_some(&mut back as &mut Project<'_, S, StepFailure>);
        let Ran { statistics, elapsed: reached, state: mut reached_state, step, ended } =
            S::integrate(&task, &mut derivative, project, (&mut sample, node, scan));
        total += statistics;
        let returned = match found {
            Some((_, share)) if manifold.is_some() && share > zero => back(share * step, &mut reached_state),
            _ => Ok(zero),
        };
        let ended = returned.err().map(EarlyEnd::Failed).or(ended);
        let stop = stopped(&mut motion, &piece, ended, valid, (start + reached, &reached_state, step));
        if stop.is_some() {
            return (total, stop);
        }
        let (Some((found, _)), Some(watcher)) = (found, &mut watcher) else {
            first_step = S::of_f64(GROWTH) * step;
            (start, first, state, passed) = (piece.end, after, reached_state, passed + 1);
            continue;
        };
        (start, first, state, first_step) = (start + reached, first + delivered, reached_state, step);
        let t = motion.time(start);
        if let Err(error) = watcher.strike(found, t, &mut state) {
            return (total, Some(error));
        }
        let (q, v) = state.split_at(n);
        if watcher.over {
            let is_taken = keep(t, q, v);
            return (total, (!is_taken).then(|| RolloutError::Stopped { t: t.to_f64() }));
        }
        regular = manifold.map(|manifold| Regularity::new(manifold, (q, v), backwards));
    }
    (total, None)
}

/// Brings a state back to the constraints; returns how far that was, in the norm and the unit of the error of a step.
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

/// Why a piece ended before its time, if it did.
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

/// The error of a trajectory whose samples cross a bound that its steps respect: it is grazed within the tolerance.
fn left<S: Scalar>(domain: Option<&Domain<S>>, reached: &[S], t: f64, state: Vec<f64>) -> Option<RolloutError> {
    let (component, lower, upper) = domain?.violation(reached).or_else(|| domain?.tightest(reached))?;
    let (value, lower, upper) = (state[component], lower.to_f64(), upper.to_f64());
    Some(RolloutError::LeftDomain { t, state, component, value, lower, upper })
}
