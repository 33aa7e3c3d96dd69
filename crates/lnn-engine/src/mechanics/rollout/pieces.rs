//! Roll-outs of any length with little memory: samples are delivered in pieces, together with the energy balance.

use super::event::lost;
use super::force::pieces;
use super::gauss::{Tableau, lagrange};
use super::run::Nodes;
use super::thresholds::{QUADRATURE_SAMPLES, STATES_TOGETHER};
use super::{Force, Integrable, Occurrence, RolloutError, RolloutOptions, StepCounts, Trajectory};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::scalar::{Real, Scalar};
use std::ops::ControlFlow;

/// The end of a roll-out in pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending<S> {
    /// Number of delivered samples, which are all valid, whatever `stop` contains.
    pub samples: usize,
    /// Counts of steps and evaluations.
    pub statistics: StepCounts,
    /// Why it ended before `t_end`; `None` also if an event ended it as requested.
    pub stop: Option<RolloutError>,
    /// The events that happened, ordered by time.
    pub events: Vec<Occurrence<S>>,
    /// The energy balance of a motion with friction, impacts or an external force, if the options request energies. Work and friction are
    /// integrated along the motion, step by step, independently of the samples.
    pub balance: Option<EnergyBalance<S>>,
}

/// Does the same as [`rollout`](super::rollout), but passes the samples to `take` in pieces of at most 256, in order, with the energies if
/// the options request them.
///
/// The concatenated pieces equal the trajectory of [`rollout`](super::rollout) bit for bit; memory does not grow with their number. If
/// `take` breaks, the motion ends with [`RolloutError::Stopped`]. A rejected motion delivers no samples.
pub fn rollout_in_pieces<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    options: &RolloutOptions<S>,
    take: &mut dyn FnMut(&Trajectory<S>) -> ControlFlow<()>,
) -> Ending<S> {
    hand_over(model, None, (q, v), options, take)
}

/// Does the same as [`rollout_in_pieces`] with an optional external force.
pub(super) fn hand_over<S: Integrable>(
    model: &dyn EulerLagrange<S>,
    force: Option<&dyn Force<S>>,
    start: (&[S], &[S]),
    options: &RolloutOptions<S>,
    take: &mut dyn FnMut(&Trajectory<S>) -> ControlFlow<()>,
) -> Ending<S> {
    let mut piece = Trajectory::empty(model.coordinates());
    let (mut samples, mut willing) = (0, true);
    // The first, the last and the largest energy of the samples.
    let mut energies: Option<[S; 3]> = None;
    let mut give = |piece: &mut Trajectory<S>| {
        piece.energy = options.energy.then(|| piece.energy_by(model));
        for &energy in piece.energy.iter().flatten() {
            let [first, _, largest] = energies.unwrap_or([energy; 3]);
            energies = Some([first, energy, S::max(largest.abs(), energy.abs())]);
        }
        samples += piece.len();
        let more = take(piece).is_continue();
        *piece = Trajectory { energy: None, ..std::mem::replace(piece, Trajectory::empty(0)) };
        piece.t.clear();
        piece.q.clear();
        piece.v.clear();
        more
    };
    let mut exchange = Exchange::new(model, force);
    let mut node = |t: S, weight: S, q: &[S], v: &[S]| exchange.add(t, weight, q, v);
    let exchanged = options.energy && (force.is_some() || !model.conserves_energy());
    let nodes = exchanged.then_some(&mut node as &mut Nodes<'_, S>);
    let mut keep = |t: S, q: &[S], v: &[S]| {
        piece.push(t, q, v);
        if piece.len() == STATES_TOGETHER {
            willing = give(&mut piece);
        }
        willing
    };
    let mut events = Vec::new();
    let (statistics, stop) = S::roll_out(model, force, start, options, (&mut keep, nodes, &mut events));
    if willing && !piece.is_empty() {
        give(&mut piece);
    }
    let has_impacts = options.events.iter().any(|event| event.restitution.is_some());
    let balance = energies.filter(|_| exchanged || has_impacts).map(|[first, last, size]| {
        let Exchange { work, dissipated, .. } = exchange;
        EnergyBalance { change: last - first, dissipated, impacts: lost(&events), work, size }
    });
    Ending { samples, statistics, stop, events, balance }
}

/// Integrates work and loss along a motion, at the quadrature nodes of its integrator.
struct Exchange<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    force: Option<&'a dyn Force<S>>,
    terms: Terms<S>,
    external: Vec<S>,
    work: S,
    dissipated: S,
}

impl<'a, S: Scalar> Exchange<'a, S> {
    fn new(model: &'a dyn EulerLagrange<S>, force: Option<&'a dyn Force<S>>) -> Self {
        let zero = <S as Real>::zero();
        let external = vec![zero; model.coordinates()];
        Self { model, force, terms: Terms::default(), external, work: zero, dissipated: zero }
    }

    /// Adds the powers at a time, with a quadrature weight in the unit of time.
    fn add(&mut self, t: S, weight: S, q: &[S], v: &[S]) {
        if !self.model.conserves_energy() {
            let known = self.model.terms_at(&[t], q, v, Request::FORCE, &mut self.terms).is_ok();
            let power = self.terms.dissipation.first().copied().filter(|_| known).unwrap_or_else(S::nan);
            self.dissipated += weight * power;
        }
        if let Some(force) = self.force {
            force.force(t, q, v, &mut self.external);
            let power = self.external.iter().zip(v).fold(<S as Real>::zero(), |sum, (&force, &v)| sum + force * v);
            self.work += weight * power;
        }
    }
}

/// Energy gained, energy lost to friction and impacts, and work of the external force between the first and the last sample, in the unit of
/// `L`.
///
/// Because of `dE/dt = v.Q - v.dD/dv`, the change equals the work minus friction and impacts, up to the errors of integration and
/// quadrature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyBalance<S> {
    /// `E` at the end minus `E` at the start.
    pub change: S,
    /// Integral of the dissipated power `v.dD/dv` over time; 0 for a model that conserves its energy.
    pub dissipated: S,
    /// Energy lost in impacts; 0 if only the samples are known.
    pub impacts: S,
    /// Integral of the power `v.Q` of the external force over time; 0 without a force.
    pub work: S,
    /// Largest `|E|` of a sample, as a reference for rounding errors.
    pub size: S,
}

impl<S: Scalar> EnergyBalance<S> {
    /// Returns the energy change that friction, impacts and work do not explain, `change + dissipated + impacts - work`.
    pub fn defect(&self) -> S {
        self.change + self.dissipated + self.impacts - self.work
    }

    /// Computes the energy balance of a motion of `model`, with an optional force.
    pub(super) fn of(
        trajectory: &Trajectory<S>,
        model: &dyn EulerLagrange<S>,
        force: Option<&dyn Force<S>>,
    ) -> Result<Self, RolloutError> {
        let invalid = |problem: String| RolloutError::Invalid { what: "trajectory", problem };
        let zero = <S as Real>::zero();
        let Trajectory { coordinates, t, q, v, .. } = trajectory;
        let size = STATES_TOGETHER * (*coordinates).max(1);
        let (mut energy, mut power) = (Vec::with_capacity(t.len()), Vec::with_capacity(t.len()));
        let mut terms = Terms::default();
        for ((q, v), t) in q.chunks(size).zip(v.chunks(size)).zip(t.chunks(STATES_TOGETHER)) {
            model
                .terms_at(t, q, v, Request::ENERGY | Request::FORCE, &mut terms)
                .map_err(|e| invalid(format!("samples from {}: {e}", energy.len())))?;
            energy.extend_from_slice(&terms.energy);
            power.extend_from_slice(&terms.dissipation);
            power.resize(energy.len(), zero);
        }
        let (Some(&first), Some(&last)) = (energy.first(), energy.last()) else {
            return Err(invalid("has no samples".to_string()));
        };
        let work = force.map_or(zero, |force| work(trajectory, force));
        if !work.is_finite() {
            return Err(invalid("the power of the force is not finite".to_string()));
        }
        let size = energy.iter().fold(zero, |size, e| S::max(size, e.abs()));
        Ok(Self { change: last - first, dissipated: integral(t, &power), impacts: zero, work, size })
    }
}

impl<S: Scalar> Trajectory<S> {
    /// Computes the energy balance of a motion of `model`; with an external force use
    /// [`Driven::energy_balance`](super::Driven::energy_balance).
    ///
    /// While a motion is integrated, [`rollout_in_pieces`] computes the balance from its steps. Here only samples are available: the power
    /// is integrated with polynomials of degree 5 through neighbouring samples, at their actual spacing, so that the error is of order 6 in
    /// the spacing if the power is smooth. The work of a force is integrated between its breaks, from the force itself at interpolated
    /// states.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] if there is no sample, or the model cannot be evaluated at a sample.
    pub fn energy_balance(&self, model: &dyn EulerLagrange<S>) -> Result<EnergyBalance<S>, RolloutError> {
        EnergyBalance::of(self, model, None)
    }
}

/// Returns the index of the first of `window` samples, among `count`, whose polynomial covers the interval before sample `k`.
fn stencil(k: usize, count: usize, window: usize) -> usize {
    k.saturating_sub(QUADRATURE_SAMPLES / 2).min(count - window)
}

/// Computes the integral of `v.Q` along the samples.
fn work<S: Scalar>(trajectory: &Trajectory<S>, force: &dyn Force<S>) -> S {
    let Trajectory { coordinates: n, t, q, v, .. } = trajectory;
    let (n, zero) = (*n, <S as Real>::zero());
    let Tableau { nodes, weights, .. } = Tableau::<S>::new(QUADRATURE_SAMPLES / 2);
    let window = QUADRATURE_SAMPLES.min(t.len());
    let (mut state, mut value) = (vec![zero; 2 * n], vec![zero; n]);
    let mut sum = zero;
    for k in 1..t.len() {
        let first = stencil(k, t.len(), window);
        let times = &t[first..first + window];
        let mut from = zero;
        for piece in pieces(near(force.breaks(), t[k - 1], t[k]), t[k - 1], t[k]) {
            let h = piece.end - from;
            let after: Vec<S> = nodes.iter().map(|&node| from + node * h).collect();
            let signed = |after: S| if t[k] < t[k - 1] { t[k - 1] - after } else { t[k - 1] + after };
            let points: Vec<S> = after.iter().map(|&after| signed(after)).collect();
            let basis = lagrange(times, &points);
            for ((row, &weight), &point) in basis.chunks_exact(window).zip(&weights).zip(&points) {
                state.fill(zero);
                for (&l, sample) in row.iter().zip(first..) {
                    let values = q[sample * n..(sample + 1) * n].iter().chain(&v[sample * n..(sample + 1) * n]);
                    state.iter_mut().zip(values).for_each(|(sum, &x)| *sum += l * x);
                }
                let (q, v) = state.split_at(n);
                force.force(piece.time(point), q, v, &mut value);
                let power = value.iter().zip(v).fold(zero, |sum, (&force, &v)| sum + force * v);
                sum += if t[k] < t[k - 1] { -(weight * h * power) } else { weight * h * power };
            }
            from = piece.end;
        }
    }
    sum
}

/// Returns the breaks, in ascending order, that may lie in the interval between two times.
fn near<S: Scalar>(breaks: &[S], a: S, b: S) -> &[S] {
    let (low, high) = (S::min(a, b), S::max(a, b));
    let first = breaks.partition_point(|t| *t < low);
    let end = breaks.partition_point(|t| *t <= high);
    &breaks[first.min(end)..end]
}

/// Integrates samples `y` over the ascending times `t`, each interval with the polynomial through the samples around it.
fn integral<S: Scalar>(t: &[S], y: &[S]) -> S {
    let Tableau { nodes, weights, .. } = Tableau::<S>::new(QUADRATURE_SAMPLES / 2);
    let window = QUADRATURE_SAMPLES.min(t.len());
    let mut sum = <S as Real>::zero();
    for k in 1..t.len() {
        let first = stencil(k, t.len(), window);
        let h = t[k] - t[k - 1];
        let points: Vec<S> = nodes.iter().map(|&node| t[k - 1] + node * h).collect();
        let basis = lagrange(&t[first..first + window], &points);
        for (row, &weight) in basis.chunks_exact(window).zip(&weights) {
            let value = row.iter().zip(&y[first..]).fold(<S as Real>::zero(), |sum, (&l, &y)| sum + l * y);
            sum += weight * h * value;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::models::BROKEN;
    use super::super::{Integrator, rollout};
    use super::*;
    use crate::lagrangian::SystemInstance;

    fn oscillator() -> Box<dyn EulerLagrange<f64>> {
        SystemInstance::named("harmonic-oscillator", &[]).unwrap().build().unwrap()
    }

    /// Joins at most `most` pieces to one trajectory; returns it, the number of pieces, and how the motion ended.
    fn joined(
        model: &dyn EulerLagrange<f64>,
        options: &RolloutOptions<f64>,
        most: usize,
    ) -> (Trajectory<f64>, usize, Ending<f64>) {
        let mut whole = Trajectory { energy: options.energy.then(Vec::new), ..Trajectory::empty(1) };
        let mut pieces = 0;
        let ending = rollout_in_pieces(model, &[1.0], &[0.2], options, &mut |piece| {
            pieces += 1;
            (0..piece.len()).for_each(|k| whole.push(piece.t[k], piece.state(k).0, piece.state(k).1));
            if let (Some(all), Some(energy)) = (&mut whole.energy, &piece.energy) {
                all.extend_from_slice(energy);
            }
            if pieces == most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        (whole, pieces, ending)
    }

    #[test]
    fn the_pieces_are_the_whole() {
        for method in [Integrator::Dopri5, Integrator::Dop853, Integrator::Gauss4, Integrator::Variational] {
            for (t_end, energy) in [(10.0, true), (-7.681, false), (0.0, true), (2.559, true)] {
                let options = RolloutOptions { method, energy, ..RolloutOptions::new(t_end, 0.01) };
                let whole = rollout(&*oscillator(), &[1.0], &[0.2], &options);
                let (trajectory, pieces, ending) = joined(&*oscillator(), &options, 99);
                assert_eq!((&trajectory, ending.statistics), (&whole.trajectory, whole.statistics));
                assert_eq!((ending.samples, ending.stop), (trajectory.len(), None));
                assert_eq!(pieces, trajectory.len().div_ceil(STATES_TOGETHER));
            }
        }
    }

    #[test]
    fn a_motion_that_fails_hands_over_what_it_has() {
        let options = RolloutOptions::new(5.0, 0.001);
        let (trajectory, _, ending) = joined(&BROKEN, &options, 99);
        let whole = rollout(&BROKEN, &[1.0], &[0.2], &options);
        assert!(ending.stop.is_some() && trajectory.len() > STATES_TOGETHER);
        assert_eq!((trajectory, ending.stop), (whole.trajectory, whole.stop));
        let (nothing, pieces, refused) = joined(&*oscillator(), &RolloutOptions::new(1.0, 0.0), 99);
        assert!(nothing.is_empty() && pieces == 0 && matches!(refused.stop, Some(RolloutError::Invalid { .. })));
    }

    #[test]
    fn a_receiver_that_takes_no_more_ends_the_motion() {
        for method in [Integrator::Dopri5, Integrator::Gauss4] {
            let options = RolloutOptions { method, ..RolloutOptions::new(1e3, 0.001) };
            let (trajectory, pieces, ending) = joined(&*oscillator(), &options, 2);
            assert_eq!((trajectory.len(), pieces, ending.samples), (2 * STATES_TOGETHER, 2, 2 * STATES_TOGETHER));
            assert!(matches!(ending.stop, Some(RolloutError::Stopped { t }) if t < 5.0), "{:?}", ending.stop);
        }
    }

    #[test]
    fn polynomials_of_degree_five_are_integrated_exactly_at_any_distances() {
        let t = [0.0f64, 0.1, 0.3, 0.35, 0.6, 0.8, 0.85, 1.0];
        let y = t.map(|t| 1.0 + 6.0 * t.powi(5));
        assert!((integral(&t, &y) - 2.0).abs() < 1e-14);
        let backwards: Vec<f64> = t.iter().rev().copied().collect();
        let values: Vec<f64> = y.iter().rev().copied().collect();
        assert!((integral(&backwards, &values) + 2.0).abs() < 1e-14);
        assert!((integral(&t[..2], &[1.0, 3.0]) - 0.2).abs() < 1e-15);
        assert_eq!(integral(&t[..1], &[7.0]), 0.0);
    }

    #[test]
    fn the_order_is_six() {
        let error = |n: usize| {
            let t: Vec<f64> = (0..=n).map(|k| k as f64 / n as f64).collect();
            let y: Vec<f64> = t.iter().map(|t| (2.0 * t).exp()).collect();
            (integral(&t, &y) - 0.5 * (2f64.exp() - 1.0)).abs()
        };
        let order = (error(20) / error(40)).log2();
        assert!((5.5..7.5).contains(&order), "{order}");
    }
}
