//! Fixed-step integration from sample to sample in phase space.

use super::crossing::{Found, Watcher};
use super::dense::{cubic, cubic_slope};
use super::force::{Piece, pieces};
use super::gauss::{Gauss, Tableau};
use super::phase::{Compensated, PhasePoint, PhaseSpace};
use super::regular::Regularity;
use super::run::{Keep, Nodes, Receivers, into_error};
use super::spark::Spark;
use super::trajectory::{Samples, Times};
use super::variational::Variational;
use super::{Force, Integrator, RolloutError, RolloutOptions, StepCounts, StepFailure};
use crate::lagrangian::EulerLagrange;
use crate::scalar::{Real, Scalar};

/// A structure-preserving method with its stored data.
pub(super) enum Stepper<S> {
    Gauss(Gauss<S>),
    Variational(Variational<S>),
    Constrained(Spark<S>),
}

impl<S: Scalar> Stepper<S> {
    /// Returns the stepper of a method for a model; `None` for an adaptive method.
    pub(super) fn new(method: Integrator, model: &dyn EulerLagrange<S>) -> Option<Self> {
        let n = model.coordinates();
        if let Some(manifold) = model.manifold() {
            let stages = match method {
                Integrator::Dopri5 | Integrator::Dop853 => return None,
                Integrator::Midpoint | Integrator::Variational => 1,
                Integrator::Gauss4 => 2,
                Integrator::Gauss6 => 3,
            };
            return Some(Self::Constrained(Spark::new(stages, manifold)));
        }
        match method {
            Integrator::Dopri5 | Integrator::Dop853 => None,
            Integrator::Midpoint => Some(Self::Gauss(Gauss::new(1, n))),
            Integrator::Gauss4 => Some(Self::Gauss(Gauss::new(2, n))),
            Integrator::Gauss6 => Some(Self::Gauss(Gauss::new(3, n))),
            Integrator::Variational => Some(Self::Variational(Variational::new(n))),
        }
    }

    fn step(
        &mut self,
        phase: &mut PhaseSpace<'_, S>,
        state: &mut PhasePoint<S>,
        v: &mut [S],
        h: S,
    ) -> Result<(), StepFailure> {
        match self {
            Self::Gauss(gauss) => gauss.step(phase, state, v, h),
            Self::Variational(variational) => variational.step(phase, state, v, h),
            Self::Constrained(spark) => match phase.manifold() {
                Some(manifold) => spark.step(phase, manifold, state, v, h),
                None => Err(StepFailure::State),
            },
        }
    }

    /// Returns coordinates and velocities at the stages of the last step.
    fn stages(&self) -> (&[S], &[S]) {
        match self {
            Self::Gauss(gauss) => gauss.stages(),
            Self::Variational(variational) => variational.stages(),
            Self::Constrained(spark) => spark.stages(),
        }
    }
}

/// The current position of a roll-out.
struct Position<'a, S> {
    state: PhasePoint<S>,
    /// A velocity close to the current one.
    near: Vec<S>,
    /// Elapsed time at the last sample or break, and the number of steps of size `h` since then.
    since: S,
    steps: usize,
    h: S,
    /// Checks that the constraint rows stay regular.
    regular: Option<Regularity<'a, S>>,
}

/// Integrates from `(q, v)` to the end of the options, or as far as possible. The arguments must be checked before.
pub(super) fn run<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    stepper: &mut Stepper<S>,
    (q, v): (&[S], &[S]),
    options: &RolloutOptions<S>,
    (keep, nodes, events): Receivers<'_, '_, S>,
) -> (StepCounts, Option<RolloutError>) {
    let mut statistics = StepCounts::default();
    let mut phase = PhaseSpace::new(model, force);
    let cuts = pieces(force.map_or(&[], |force| force.breaks()), options.t0, options.t_end);
    let zero = <S as Real>::zero();
    let domain = options.domain.as_ref();
    let start: Vec<S> = q.iter().chain(v).copied().collect();
    phase.stop_at(options.t0);
    let watcher = match Watcher::new(model, (q, v), options, events) {
        Ok(watcher) => watcher,
        Err(error) => return (statistics, Some(error)),
    };
    let moving = StepFailure::check(domain, &start).and_then(|()| phase.momentum(q, v));
    let stop = match moving {
        Err(failure) => Some(into_error(failure, options.t0.to_f64(), start.iter().map(|x| x.to_f64()).collect(), 0.0)),
        Ok(p) => {
            let state = PhasePoint { q: Compensated::new(q.to_vec()), p: Compensated::new(p) };
            let backwards = options.t_end < options.t0;
            let regular = phase.manifold().map(|manifold| Regularity::new(manifold, (q, v), backwards));
            let mut position = Position { state, near: v.to_vec(), since: zero, steps: 0, h: zero, regular };
            if keep(options.t0, q, v) {
                let receivers = (&mut statistics, keep, nodes, watcher);
                advance(&mut phase, stepper, &mut position, options, &cuts, receivers)
            } else {
                Some(RolloutError::Stopped { t: options.t0.to_f64() })
            }
        }
    };
    statistics.evaluations = phase.evaluations;
    statistics.iterations = phase.iterations;
    (statistics, stop)
}

/// Receivers of counts, samples, nodes and events.
type AllReceivers<'r, 'a, 'w, S> =
    (&'r mut StepCounts, &'r mut Keep<'a, S>, Option<&'r mut Nodes<'a, S>>, Option<Watcher<'w, S>>);

fn advance<'a, S: Scalar>(
    phase: &mut PhaseSpace<'a, S>,
    stepper: &mut Stepper<S>,
    position: &mut Position<'a, S>,
    options: &RolloutOptions<S>,
    cuts: &[Piece<S>],
    (statistics, keep, mut nodes, mut watcher): AllReceivers<'_, '_, '_, S>,
) -> Option<RolloutError> {
    let samples = Samples::new(options);
    let domain = options.domain.as_ref();
    // All intervals except the last are dt, whatever the rounding of their difference.
    let regular = options.dt.abs();
    let last = samples.len() - 1;
    let mut piece = 0;
    for k in 1..=last {
        let (start, elapsed) = (samples.elapsed(k - 1), samples.elapsed(k));
        let difference = elapsed - start;
        let blur = S::epsilon().ldexp(3) * elapsed;
        let whole = if k < last || (difference - regular).abs() <= blur { regular } else { difference };
        // Integrate to every break on the way, then to the sample.
        let mut legs = vec![(start, whole, cuts[piece])];
        while piece + 1 < cuts.len() && cuts[piece].end <= elapsed + blur {
            let from = cuts[piece].end;
            piece += 1;
            if from < elapsed - blur
                && let Some(leg) = legs.last_mut()
            {
                leg.1 = from - leg.0;
                legs.push((from, elapsed - from, cuts[piece]));
            }
        }
        for (from, distance, piece) in legs {
            let counted = (&mut *statistics, nodes.as_deref_mut(), watcher.as_mut());
            match leg(phase, stepper, position, options, (from, distance, blur), &piece, counted) {
                Stretch::Whole | Stretch::Until(_) => {}
                Stretch::Failed(stop) => return Some(stop),
                Stretch::Ended(t, state) => {
                    let is_taken = keep(t, &state[..phase.n], &state[phase.n..]);
                    return (!is_taken).then(|| RolloutError::Stopped { t: t.to_f64() });
                }
            }
        }
        phase.stop_at(position.time(options, options.t_end < options.t0));
        let arrived = position.velocity(phase).and_then(|v| {
            let sample: Vec<S> = position.state.q.high.iter().copied().chain(v).collect();
            StepFailure::check(domain, &sample).map(|()| sample)
        });
        match arrived {
            Ok(sample) => {
                let (q, v) = sample.split_at(phase.n);
                if !keep(samples.time(k), q, v) {
                    return Some(RolloutError::Stopped { t: samples.time(k).to_f64() });
                }
            }
            Err(failure) => return Some(position.failed(phase, failure, options, options.t_end < options.t0)),
        }
    }
    None
}

/// Receivers of counts, nodes and events.
type Counted<'r, 'n, 'w, S> = (&'r mut StepCounts, Option<&'r mut Nodes<'n, S>>, Option<&'r mut Watcher<'w, S>>);

/// Integrates over an interval of elapsed time within one piece, and continues after events; times that differ by less than `blur` are
/// equal.
fn leg<'a, S: Scalar>(
    phase: &mut PhaseSpace<'a, S>,
    stepper: &mut Stepper<S>,
    position: &mut Position<'a, S>,
    options: &RolloutOptions<S>,
    (from, distance, blur): (S, S, S),
    piece: &Piece<S>,
    (statistics, mut nodes, mut watcher): Counted<'_, '_, '_, S>,
) -> Stretch<S> {
    let (end, mut rest) = (from + distance, (from, distance));
    loop {
        let counted = (&mut *statistics, nodes.as_deref_mut(), watcher.as_deref_mut());
        match stretch(phase, stepper, position, options, rest, piece, counted) {
            Stretch::Until(elapsed) if end - elapsed > blur => rest = (elapsed, end - elapsed),
            ended => return ended,
        }
    }
}

/// The result of integrating over an interval.
enum Stretch<S> {
    /// The end of the interval was reached.
    Whole,
    /// An event interrupts the motion at this elapsed time, from which it continues.
    Until(S),
    /// An event ends the motion at this time and state.
    Ended(S, Vec<S>),
    /// The integration failed.
    Failed(RolloutError),
}

/// Integrates over an interval of elapsed time within one piece, up to the first event.
fn stretch<'a, S: Scalar>(
    phase: &mut PhaseSpace<'a, S>,
    stepper: &mut Stepper<S>,
    position: &mut Position<'a, S>,
    options: &RolloutOptions<S>,
    (from, distance): (S, S),
    piece: &Piece<S>,
    (statistics, mut nodes, mut watcher): Counted<'_, '_, '_, S>,
) -> Stretch<S> {
    let backwards = options.t_end < options.t0;
    let longest = options.step.unwrap_or(distance);
    // The step is at most the whole interval.
    let count = ((distance / longest - S::epsilon().ldexp(4)).floor().to_f64() + 1.0).max(1.0);
    let h = distance / S::of_f64(count);
    (position.since, position.steps, position.h) = (from, 0, h);
    let signed = if backwards { -h } else { h };
    // `max_steps` ends the loop if the count exceeds any integer.
    while (position.steps as f64) < count {
        if statistics.accepted == options.max_steps {
            let t = position.time(options, backwards).to_f64();
            return Stretch::Failed(RolloutError::TooManySteps { t, steps: options.max_steps });
        }
        let t = position.time(options, backwards);
        phase.begin(t, piece);
        let before = (position.state.clone(), position.near.clone());
        let stepped = stepper
            .step(phase, &mut position.state, &mut position.near, signed)
            .and_then(|()| inside(stepper, phase.n, options))
            .and_then(|()| {
                let (q, v) = (&position.state.q.high, &position.near);
                position.regular.as_mut().map_or(Ok(()), |regular| regular.step(h, q, v))
            });
        if let Err(failure) = stepped {
            (position.state, position.near) = before;
            return Stretch::Failed(position.failed(phase, failure, options, backwards));
        }
        statistics.accepted += 1;
        let watched = watcher.as_mut();
        let found = watched.map(|watcher| interruption(phase, stepper, position, &before, (t, signed), watcher));
        let found = match found.transpose() {
            Ok(found) => found.flatten(),
            Err(failure) => {
                (position.state, position.near) = before;
                return Stretch::Failed(position.failed(phase, failure, options, backwards));
            }
        };
        let share = found.as_ref().map_or(<S as Real>::one(), |(_, share, _)| *share);
        if let Some(nodes) = nodes.as_mut().filter(|_| share > <S as Real>::zero()) {
            visit_stages(stepper, phase.n, (t, signed * share), *nodes);
        }
        if let (Some((found, share, state)), Some(watcher)) = (found, &mut watcher) {
            let elapsed = position.since + (S::of_f64(position.steps as f64) + share) * h;
            return position.strike(phase, watcher, found, (t + share * signed, elapsed), state);
        }
        position.steps += 1;
    }
    Stretch::Whole
}

/// An event, its fraction of the step, and the state there.
type Interruption<S> = (Found<S>, S, Vec<S>);

/// Returns the first event that interrupts the last step, which began at `before`, with its fraction of the step and the state there, to
/// which the motion is reset. Earlier events that do not interrupt it are recorded.
fn interruption<S: Scalar>(
    phase: &mut PhaseSpace<'_, S>,
    stepper: &mut Stepper<S>,
    position: &mut Position<'_, S>,
    before: &(PhasePoint<S>, Vec<S>),
    (t, signed): (S, S),
    watcher: &mut Watcher<'_, S>,
) -> Result<Option<Interruption<S>>, StepFailure> {
    let (n, zero) = (phase.n, <S as Real>::zero());
    let after = (position.state.clone(), position.near.clone());
    phase.stop_at(t + signed);
    let (q1, v1) = (after.0.q.high.clone(), position.velocity(phase)?);
    let mut start = vec![zero; 2 * n];
    let mut exact = |share: S, state: &mut [S]| {
        (position.state, position.near) = before.clone();
        phase.stop_at(t);
        if share > zero {
            stepper.step(phase, &mut position.state, &mut position.near, signed * share)?;
        }
        let (q, v) = state.split_at_mut(n);
        q.copy_from_slice(&position.state.q.high);
        phase.stop_at(t + share * signed);
        v.copy_from_slice(&position.velocity(phase)?);
        Ok(())
    };
    exact(zero, &mut start)?;
    let time = |share: S| t + share * signed;
    let (mut from, one) = (zero, <S as Real>::one());
    while from < one {
        // Start from the last known state.
        let rest = one - from;
        let mut dense = |share: S, state: &mut [S]| {
            for i in 0..n {
                let (x, h, ends) = ((share - from) / rest, signed * rest, [start[i], start[n + i], q1[i], v1[i]]);
                (state[i], state[n + i]) = (cubic(x, h, ends), cubic_slope(x, h, ends));
            }
        };
        let Some(found) = watcher.first(from, &time, &mut dense) else { break };
        let Some(found) = watcher.sharpened(found, &time, &mut exact)? else {
            watcher.follow(time(one), &[&q1[..], &v1[..]].concat());
            from = one;
            break;
        };
        let (share, mut state) = (watcher.share(&found), vec![zero; 2 * n]);
        exact(share, &mut state)?;
        if watcher.interrupts(&found) {
            return Ok(Some((found, share, state)));
        }
        watcher.mark(found, time(share), [&state, &state]);
        (from, start) = (share, state);
    }
    if from > zero {
        // Compute the stages of the whole step again.
        exact(one, &mut start)?;
    }
    (position.state, position.near) = after;
    Ok(None)
}

/// Passes the stages of the last step, of length `h` from `t`, to the receiver as quadrature nodes.
fn visit_stages<S: Scalar>(stepper: &Stepper<S>, n: usize, (t, h): (S, S), nodes: &mut Nodes<'_, S>) {
    let (q, v) = stepper.stages();
    let Tableau { nodes: places, weights, .. } = Tableau::<S>::new(q.len() / n);
    let stages = q.chunks_exact(n).zip(v.chunks_exact(n));
    for ((&place, &weight), (q, v)) in places.iter().zip(&weights).zip(stages) {
        nodes(t + place * h, weight * h, q, v);
    }
}

/// Checks that the stages of the last step are finite and inside the domain.
fn inside<S: Scalar>(stepper: &Stepper<S>, n: usize, options: &RolloutOptions<S>) -> Result<(), StepFailure> {
    let Some(domain) = options.domain.as_ref() else { return Ok(()) };
    let (q, v) = stepper.stages();
    let mut stage = vec![<S as Real>::zero(); 2 * n];
    for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
        stage[..n].copy_from_slice(q);
        stage[n..].copy_from_slice(v);
        StepFailure::check(Some(domain), &stage)?;
    }
    Ok(())
}

impl<'a, S: Scalar> Position<'a, S> {
    /// Applies an event at a time, an elapsed time and a state, and restarts the motion from there.
    fn strike(
        &mut self,
        phase: &mut PhaseSpace<'a, S>,
        watcher: &mut Watcher<'_, S>,
        found: Found<S>,
        (t, elapsed): (S, S),
        mut state: Vec<S>,
    ) -> Stretch<S> {
        let n = phase.n;
        if let Err(error) = watcher.strike(found, t, &mut state) {
            return Stretch::Failed(error);
        }
        if watcher.over {
            return Stretch::Ended(t, state);
        }
        let (q, v) = state.split_at(n);
        phase.stop_at(t);
        match phase.momentum(q, v) {
            Ok(p) => (self.state.p, self.near) = (Compensated::new(p), v.to_vec()),
            Err(failure) => {
                let state = state.iter().map(|x| x.to_f64()).collect();
                return Stretch::Failed(into_error(failure, t.to_f64(), state, self.h.to_f64()));
            }
        }
        // Impacts only occur in motions forward in time.
        self.regular = phase.manifold().map(|manifold| Regularity::new(manifold, (q, v), false));
        Stretch::Until(elapsed)
    }

    fn velocity(&self, phase: &mut PhaseSpace<'_, S>) -> Result<Vec<S>, StepFailure> {
        let mut v = self.near.clone();
        let (q, p) = (&self.state.q.high, &self.state.p.high);
        match phase.manifold() {
            Some(manifold) => phase.land(manifold, q, p, &mut v).map(|_| v),
            None => phase.velocity(q, p, &mut v).map(|()| v),
        }
    }

    fn time(&self, options: &RolloutOptions<S>, backwards: bool) -> S {
        let elapsed = self.since + S::of_f64(self.steps as f64) * self.h;
        if backwards { options.t0 - elapsed } else { options.t0 + elapsed }
    }

    /// Returns the error for a failure beyond the current position; if the velocity cannot be computed, the nearest known one is used.
    fn failed(
        &self,
        phase: &mut PhaseSpace<'_, S>,
        failure: StepFailure,
        options: &RolloutOptions<S>,
        backwards: bool,
    ) -> RolloutError {
        phase.stop_at(self.time(options, backwards));
        let v = self.velocity(phase).unwrap_or_else(|_| self.near.clone());
        let state = self.state.q.high.iter().chain(&v).map(|x| x.to_f64()).collect();
        let step = if self.steps == 0 && self.since == <S as Real>::zero() { 0.0 } else { self.h.to_f64() };
        into_error(failure, self.time(options, backwards).to_f64(), state, step)
    }
}
