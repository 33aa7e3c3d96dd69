//! Events: zeros of a function along a motion, and their effects.

use crate::lagrangian::GivenEvent;
use crate::scalar::{Real, Scalar};
use std::fmt;
use std::sync::Arc;

/// A function along a motion whose zeros are events.
pub(super) trait When<S: Scalar>: Send + Sync {
    /// Returns its value.
    fn value(&self, t: S, q: &[S], v: &[S]) -> S;

    /// Writes its derivatives by the coordinates, `(n)`, and returns its derivative by the time. By default it uses sixth-order differences
    /// with an error of about `epsilon^(6/7)`.
    fn slopes(&self, t: S, q: &[S], v: &[S], normal: &mut [S]) -> S {
        let mut q = q.to_vec();
        for (i, normal) in normal.iter_mut().enumerate() {
            let at = q[i];
            *normal = difference(at, |x| {
                q[i] = x;
                self.value(t, &q, v)
            });
            q[i] = at;
        }
        difference(t, |t| self.value(t, &q, v))
    }
}

/// Weights of `f(x + k h) - f(x - k h)` for `k = 1, 2, 3`, times 60.
const WEIGHTS: [i32; 3] = [45, -9, 1];

/// Returns the derivative of a function at `x`.
fn difference<S: Scalar>(x: S, mut f: impl FnMut(S) -> S) -> S {
    let (one, zero) = (<S as Real>::one(), <S as Real>::zero());
    // A power of 2 above epsilon^(1/7), so that the displacements are exact.
    let exponent = (S::epsilon().to_f64().log2() / 7.0).ceil() as i32;
    let h = S::max(x.abs(), one).ldexp(exponent);
    let pairs = WEIGHTS.iter().zip(1..).map(|(&weight, k)| {
        let shift = S::of_f64(f64::from(k)) * h;
        let (high, low) = (x + shift, x - shift);
        S::ratio(weight, 60) * (f(high) - f(low)) / ((high - low) / (shift + shift))
    });
    pairs.fold(zero, |sum, pair| sum + pair) / h
}

impl<S: Scalar, F: Fn(S, &[S], &[S]) -> S + Send + Sync> When<S> for F {
    fn value(&self, t: S, q: &[S], v: &[S]) -> S {
        self(t, q, v)
    }
}

impl<S: Scalar> When<S> for GivenEvent<S> {
    fn value(&self, t: S, q: &[S], v: &[S]) -> S {
        GivenEvent::value(self, t, (q, v))
    }

    fn slopes(&self, t: S, q: &[S], v: &[S], normal: &mut [S]) -> S {
        GivenEvent::slopes(self, t, (q, v), normal)
    }
}

/// An event along a motion: a zero of a function `when(t, q, v)`. Each zero is recorded, and may end the motion or cause an impact.
///
/// Pass events to [`RolloutOptions::events`](super::RolloutOptions::events); the zeros found are in
/// [`Rollout::events`](super::Rollout::events). They are located within every step with the integrator's interpolation, up to rounding. A
/// zero at the start is not an event. If two zeros are so close that the function does not change sign between eight equidistant points of
/// a step, they are found if its slope does.
///
/// ```
/// use lnn::lagrangian::{ExpressionLagrangian, Mechanics};
/// use lnn::rollout::{Event, RolloutOptions, rollout};
///
/// // A ball of 1 kg falls from 1 m, and has 0.8 of its speed after each impact on the ground.
/// let ball = ExpressionLagrangian::new(&["y"], &["g"], "y_dot^2/2 - g*y")?;
/// let ground = Event::new("ground", |_, q: &[f64], _: &[f64]| q[0]).falling().restitution(0.8);
/// let options = RolloutOptions::new(1.5, 0.01).events(vec![ground]);
/// let motion = rollout(&Mechanics::new(ball, [9.81]), &[1.0], &[0.0], &options);
/// let fall = (2.0 / 9.81_f64).sqrt();
/// assert!((motion.events[0].t - fall).abs() < 1e-9 && (motion.events[1].t - 2.6 * fall).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Event<S> {
    pub(super) name: String,
    pub(super) when: Arc<dyn When<S>>,
    pub(super) falling: bool,
    pub(super) rising: bool,
    pub(super) last: Option<usize>,
    pub(super) restitution: Option<Arc<dyn When<S>>>,
}

impl<S: Scalar> Event<S> {
    /// Defines an event at the zeros of `when(t, q, v)`, where `q` and `v` have `n` numbers, in either direction; each is recorded under
    /// the name.
    pub fn new(name: impl Into<String>, when: impl Fn(S, &[S], &[S]) -> S + Send + Sync + 'static) -> Self {
        Self { name: name.into(), when: Arc::new(when), falling: true, rising: true, last: None, restitution: None }
    }

    /// Counts only zeros at which the function decreases with time.
    #[must_use]
    pub fn falling(self) -> Self {
        Self { falling: true, rising: false, ..self }
    }

    /// Counts only zeros at which the function increases with time.
    #[must_use]
    pub fn rising(self) -> Self {
        Self { falling: false, rising: true, ..self }
    }

    /// Ends the motion at the first zero, where it adds a last sample.
    #[must_use]
    pub fn stop(self) -> Self {
        self.stop_after(1)
    }

    /// Ends the motion when the event has happened `times` times.
    #[must_use]
    pub fn stop_after(self, times: usize) -> Self {
        Self { last: Some(times.max(1)), ..self }
    }

    /// Returns `true` for an impact.
    pub fn is_impact(&self) -> bool {
        self.restitution.is_some()
    }

    /// Makes the event an impact on the surface `when(t, q) = 0`, which must not depend on velocities. With its normal `n = d when/dq` and
    /// the velocity `u = n.v + d when/dt` across it, `v` becomes `v - (1 + e) u M^-1 n / (n.M^-1 n)`, where the coefficient of restitution
    /// `e` is from 0 to 1. On a surface at rest the motion loses the energy `(1 - e^2) u^2 / (2 n.M^-1 n)`. With constraints, `M^-1` is the
    /// inverse within them.
    #[must_use]
    pub fn restitution(self, e: S) -> Self {
        Self { restitution: Some(Arc::new(move |_: S, _: &[S], _: &[S]| e)), ..self }
    }
}

/// Converts an event of a system file.
impl<S: Scalar> From<GivenEvent<S>> for Event<S> {
    fn from(given: GivenEvent<S>) -> Self {
        let event = given.event.clone();
        let nan = S::nan();
        let own = given.clone();
        let e = move |t: S, q: &[S], v: &[S]| own.restitution(t, (q, v)).unwrap_or(nan);
        let is_impact = event.is_impact();
        Self {
            name: event.name,
            falling: event.falling,
            rising: event.rising,
            last: event.last,
            when: Arc::new(given),
            restitution: is_impact.then(|| Arc::new(e) as Arc<dyn When<S>>),
        }
    }
}

impl<S> fmt::Debug for Event<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, falling, rising, last, .. } = self;
        let mut shown = f.debug_struct("Event");
        shown.field("name", name).field("falling", falling).field("rising", rising).field("last", last);
        shown.finish_non_exhaustive()
    }
}

/// Events are equal if they share the same functions.
impl<S> PartialEq for Event<S> {
    fn eq(&self, other: &Self) -> bool {
        let same = |a: &Arc<dyn When<S>>, b: &Arc<dyn When<S>>| Arc::ptr_eq(a, b);
        let restitution = match (&self.restitution, &other.restitution) {
            (Some(a), Some(b)) => same(a, b),
            (a, b) => a.is_none() && b.is_none(),
        };
        let plain = |event: &Self| (event.name.clone(), event.falling, event.rising, event.last);
        restitution && same(&self.when, &other.when) && plain(self) == plain(other)
    }
}

/// An occurrence of an event.
#[derive(Clone, Debug, PartialEq)]
pub struct Occurrence<S> {
    /// Name of the event.
    pub name: String,
    /// Time of the event.
    pub t: S,
    /// Coordinates at the event, `(n)`.
    pub q: Vec<S>,
    /// Velocities at the event, or after an impact, `(n)`.
    pub v: Vec<S>,
    /// The effect of an impact.
    pub impact: Option<Impact<S>>,
}

/// Velocities and energies of an impact.
#[derive(Clone, Debug, PartialEq)]
pub struct Impact<S> {
    /// Velocities before the impact, `(n)`.
    pub v_before: Vec<S>,
    /// Energy `p.v - L` before the impact, in the unit of `L`.
    pub energy_before: S,
    /// Energy after the impact.
    pub energy_after: S,
}

impl<S: Scalar> Impact<S> {
    /// Returns the energy lost in the impact.
    pub fn lost(&self) -> S {
        self.energy_before - self.energy_after
    }
}

/// Returns the energy lost in all impacts.
pub(super) fn lost<S: Scalar>(events: &[Occurrence<S>]) -> S {
    let impacts = events.iter().filter_map(|event| event.impact.as_ref());
    impacts.fold(<S as Real>::zero(), |sum, impact| sum + impact.lost())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dd;

    #[test]
    fn the_slopes_of_closures_are_near_those_of_the_function() {
        let when = |t: f64, q: &[f64], _: &[f64]| (3.0 * q[0]).sin() - q[1].exp() + 2.0 * t;
        let mut normal = [0.0; 2];
        let by_time = when.slopes(0.7, &[0.3, -1.2], &[0.0; 2], &mut normal);
        let exact = [3.0 * 0.9_f64.cos(), -(-1.2_f64).exp()];
        assert!((by_time - 2.0).abs() < 1e-13);
        assert!((normal[0] - exact[0]).abs() < 3e-11 && (normal[1] - exact[1]).abs() < 3e-11, "{normal:?} {exact:?}");
        let wide = |_: Dd, q: &[Dd], _: &[Dd]| q[0] * q[0] * q[0];
        let mut normal = [Dd::of_f64(0.0)];
        wide.slopes(Dd::of_f64(0.0), &[Dd::of_f64(2.0)], &[], &mut normal);
        assert!((normal[0] - Dd::of_f64(12.0)).to_f64().abs() < 1e-25);
    }
}
