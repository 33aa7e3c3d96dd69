//! Options of a roll-out.

use super::thresholds::{LEAST_TOLERANCES, MOST_SAMPLES};
use super::{Event, RolloutError};
use crate::scalar::{Real, Scalar};
use serde::{Deserialize, Serialize};

/// Integrators: explicit Runge-Kutta methods with step size control, and structure-preserving fixed-step methods.
///
/// The latter are implicit and symplectic in `(q, p)`, `p = dL/dv`, for every Lagrangian with a regular mass matrix. Their energy error
/// stays bounded over long times, whereas adaptive methods drift. See [`RolloutOptions::step`]. Motion with friction conserves no energy:
/// [`Integrator::Variational`] rejects it, and the Gauss methods keep their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Integrator {
    /// Dormand and Prince (1980), order 5(4), interpolation of order 4.
    Dopri5,
    /// Hairer, Norsett and Wanner (1993), order 8(5,3), interpolation of order 7.
    Dop853,
    /// Implicit midpoint rule, order 2.
    Midpoint,
    /// Gauss collocation with two stages, order 4.
    Gauss4,
    /// Gauss collocation with three stages, order 6.
    Gauss6,
    /// Discrete Euler-Lagrange equations of the midpoint discrete Lagrangian, order 2.
    Variational,
}

impl Integrator {
    /// All integrators.
    pub const ALL: [Self; 6] =
        [Self::Dopri5, Self::Dop853, Self::Midpoint, Self::Gauss4, Self::Gauss6, Self::Variational];

    /// Returns its name in configurations.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dopri5 => "dopri5",
            Self::Dop853 => "dop853",
            Self::Midpoint => "midpoint",
            Self::Gauss4 => "gauss4",
            Self::Gauss6 => "gauss6",
            Self::Variational => "variational",
        }
    }

    /// Describes it in a few words.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Dopri5 => "Dormand and Prince, order 5, error control",
            Self::Dop853 => "Dormand and Prince, order 8, error control",
            Self::Midpoint => "Implicit midpoint rule, order 2, symplectic",
            Self::Gauss4 => "Gauss collocation, order 4, symplectic",
            Self::Gauss6 => "Gauss collocation, order 6, symplectic",
            Self::Variational => "Discrete Euler-Lagrange equations, order 2, symplectic",
        }
    }

    /// Returns `true` for symplectic methods with fixed steps.
    pub const fn is_structure_preserving(self) -> bool {
        !matches!(self, Self::Dopri5 | Self::Dop853)
    }
}

/// A box in which a trajectory must stay, such as the bounds of training data or of a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Domain<S> {
    bounds: Vec<Option<(S, S)>>,
}

impl<S: Scalar> Domain<S> {
    /// Creates a domain from bounds `(lower, upper)` of every component of `(q, v)`; `None` means unbounded, as for periodic coordinates.
    pub fn new(bounds: Vec<Option<(S, S)>>) -> Self {
        Self { bounds }
    }

    /// Returns the number of components `2n`.
    pub(crate) fn len(&self) -> usize {
        self.bounds.len()
    }

    /// Returns the bounds of every component of `(q, v)`.
    pub fn bounds(&self) -> &[Option<(S, S)>] {
        &self.bounds
    }

    /// Returns the first component of `(q, v)` outside its bounds, with the bounds.
    pub fn violation(&self, state: &[S]) -> Option<(usize, S, S)> {
        self.bounds.iter().zip(state).enumerate().find_map(|(index, (bounds, &x))| match *bounds {
            Some((lower, upper)) if !(x >= lower && x <= upper) => Some((index, lower, upper)),
            _ => None,
        })
    }

    /// Returns the bounded component of `(q, v)` closest to a bound, relative to its width, with the bounds.
    pub(super) fn tightest(&self, state: &[S]) -> Option<(usize, S, S)> {
        let mut best: Option<(S, (usize, S, S))> = None;
        for (index, (bounds, &x)) in self.bounds.iter().zip(state).enumerate() {
            if let Some((lower, upper)) = *bounds {
                let room = S::min(x - lower, upper - x) / (upper - lower);
                if best.is_none_or(|(smallest, _)| room < smallest) {
                    best = Some((room, (index, lower, upper)));
                }
            }
        }
        best.map(|(_, found)| found)
    }
}

/// Options of a roll-out.
///
/// | Name | Default | Purpose | Range |
/// |---|---|---|---|
/// | `t0` | 0 | time of the start | finite |
/// | `t_end` | given | time of the last sample; before `t0` integrates backwards | finite |
/// | `dt` | given | distance of samples; its sign is ignored | finite, not 0, at most 10^8 samples |
/// | `method` | `Dopri5` | integrator | |
/// | `rtol`, `atol` | 1e-6, 1e-8 | local error per step: `atol + rtol abs(y)` per component, root mean square | >= 0, not both 0, not finer than the rounding of the state |
/// | `step` | `dt` | longest step of the structure-preserving methods, at most the distance of samples; they ignore `rtol` and `atol` | finite, > 0 |
/// | `max_steps` | 1,000,000 | attempts of all steps | >= 1 |
/// | `domain` | none | where the trajectory must stay | `2n` components |
/// | `energy` | true | store `E` at every sample | |
/// | `events` | none | zeros along the motion that are recorded, end it, or are impacts | |
/// [`RolloutOptions::new`] has the defaults; every other field has a setter of its name, `rtol` and `atol` share
/// [`RolloutOptions::tolerances`]:
///
/// ```
/// use lnn::rollout::{Integrator, RolloutOptions};
///
/// let options = RolloutOptions::new(10.0, 0.1).method(Integrator::Gauss4).step(0.02).energy(false);
/// assert_eq!(options.step, Some(0.02));
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[must_use]
pub struct RolloutOptions<S> {
    /// Initial time.
    pub t0: S,
    /// Time of the last sample.
    pub t_end: S,
    /// Sampling interval.
    pub dt: S,
    /// Integrator.
    pub method: Integrator,
    /// Relative tolerance.
    pub rtol: S,
    /// Absolute tolerance in the unit of each component.
    pub atol: S,
    /// Longest step of the structure-preserving methods: the interval between samples is divided into equal steps that are no longer.
    /// `None` means one step per sample. Adaptive methods choose their own steps.
    pub step: Option<S>,
    /// Largest number of attempted steps.
    pub max_steps: usize,
    /// Domain in which the trajectory must stay.
    pub domain: Option<Domain<S>>,
    /// `true` to store the energy at every sample.
    pub energy: bool,
    /// Zeros along the motion that are recorded, end it, or cause impacts.
    pub events: Vec<Event<S>>,
}

impl<S: Scalar> RolloutOptions<S> {
    /// Returns the options for learned motion as in the paper's tests: `Dopri5`, rtol 1e-6, atol 1e-8, from time 0.
    pub fn new(t_end: S, dt: S) -> Self {
        Self {
            t0: <S as Real>::zero(),
            t_end,
            dt,
            method: Integrator::Dopri5,
            rtol: S::of_f64(1e-6),
            atol: S::of_f64(1e-8),
            step: None,
            max_steps: 1_000_000,
            domain: None,
            energy: true,
            events: Vec::new(),
        }
    }

    /// Returns the options for ground truth: `Dop853` with rtol = atol = 1e-12, or sixteen rounding errors if the scalar is less precise.
    pub fn reference(t_end: S, dt: S) -> Self {
        let tolerance = S::max(S::of_f64(1e-12), S::epsilon().ldexp(4));
        Self { method: Integrator::Dop853, rtol: tolerance, atol: tolerance, ..Self::new(t_end, dt) }
    }

    /// Sets the initial time.
    pub fn t0(self, t0: S) -> Self {
        Self { t0, ..self }
    }

    /// Sets the time of the last sample.
    pub fn t_end(self, t_end: S) -> Self {
        Self { t_end, ..self }
    }

    /// Sets the sampling interval.
    pub fn dt(self, dt: S) -> Self {
        Self { dt, ..self }
    }

    /// Sets the integrator.
    pub fn method(self, method: Integrator) -> Self {
        Self { method, ..self }
    }

    /// Sets the relative and the absolute tolerance of the adaptive methods.
    pub fn tolerances(self, rtol: S, atol: S) -> Self {
        Self { rtol, atol, ..self }
    }

    /// Sets the longest step of the structure-preserving methods; `None` means one step per sample.
    pub fn step(self, step: impl Into<Option<S>>) -> Self {
        Self { step: step.into(), ..self }
    }

    /// Sets the largest number of attempted steps.
    pub fn max_steps(self, max_steps: usize) -> Self {
        Self { max_steps, ..self }
    }

    /// Sets the domain in which the trajectory must stay.
    pub fn domain(self, domain: impl Into<Option<Domain<S>>>) -> Self {
        Self { domain: domain.into(), ..self }
    }

    /// Sets whether the energy at every sample is stored.
    pub fn energy(self, energy: bool) -> Self {
        Self { energy, ..self }
    }

    /// Sets the zeros along the motion that are recorded, end it, or cause impacts.
    pub fn events(self, events: Vec<Event<S>>) -> Self {
        Self { events, ..self }
    }

    /// Returns the finest relative tolerance that the scalar supports, about nine rounding errors: 1e-6 in `f32`, 2e-15 in `f64`. With a
    /// finer one, steps shrink until they no longer advance the time.
    pub fn least_tolerance() -> S {
        S::of_f64(if S::epsilon().to_f64() > 1e-12 { LEAST_TOLERANCES.0 } else { LEAST_TOLERANCES.1 })
    }

    /// Checks the options for `n` coordinates.
    ///
    /// # Errors
    /// [`RolloutError::Invalid`] with the name of the option.
    pub fn check(&self, n: usize) -> Result<(), RolloutError> {
        let invalid = |what, problem: String| Err(RolloutError::Invalid { what, problem });
        for (what, value) in [("t0", self.t0), ("t_end", self.t_end), ("dt", self.dt)] {
            if !value.is_finite() {
                return invalid(what, format!("{value} is not finite"));
            }
        }
        if self.dt == <S as Real>::zero() {
            return invalid("dt", "must not be 0".into());
        }
        let samples = ((self.t_end - self.t0) / self.dt).abs();
        if samples.is_nan() || samples.to_f64() > MOST_SAMPLES {
            return invalid(
                "dt",
                format!(
                    "requires {:.3e} samples, at most {MOST_SAMPLES:.0e} are allowed",
                    samples.to_f64().min(f64::MAX)
                ),
            );
        }
        if blur(self).to_f64() >= 0.5 {
            let (dt, t) = (self.dt, S::max(self.t0.abs(), self.t_end.abs()));
            return invalid("dt", format!("{dt} is too short to distinguish times near {t} in {}", S::NAME));
        }
        for (what, value) in [("rtol", self.rtol), ("atol", self.atol)] {
            if !(value.is_finite() && value >= <S as Real>::zero()) {
                return invalid(what, format!("{value} is not a finite number >= 0"));
            }
        }
        if self.rtol + self.atol <= <S as Real>::zero() {
            return invalid("rtol", "rtol and atol must not both be 0".into());
        }
        let least = Self::least_tolerance();
        if !self.method.is_structure_preserving() && self.rtol > <S as Real>::zero() && self.rtol < least {
            let rtol = self.rtol.to_f64();
            let problem =
                format!("{rtol:e} is finer than {} can keep, the least is {:e}", S::NAME, least.to_f64() as f32);
            return invalid("rtol", problem);
        }
        if let Some(step) = self.step
            && !(step.is_finite() && step > <S as Real>::zero())
        {
            return invalid("step", format!("{step} is not a finite number > 0"));
        }
        if self.max_steps == 0 {
            return invalid("max_steps", "must be at least 1".into());
        }
        if self.method.is_structure_preserving() {
            let shortest = self.step.map_or(self.dt.abs(), |step| S::min(step, self.dt.abs()));
            // This ignores rounding.
            let steps = ((self.t_end - self.t0).abs() / shortest).to_f64() * (1.0 - 1e-6);
            if steps > self.max_steps as f64 {
                let what = if self.step.is_some_and(|step| step < self.dt.abs()) { "step" } else { "dt" };
                let problem =
                    format!("requires {steps:.3e} steps of {shortest}, at most {} are allowed", self.max_steps);
                return invalid(what, problem);
            }
        }
        match &self.domain {
            Some(domain) if domain.len() != 2 * n => {
                invalid("domain", format!("expected {} components, found {}", 2 * n, domain.len()))
            }
            _ => Ok(()),
        }
    }
}

/// Returns the rounding error of the quotient of time span and `dt`: a quotient this close to an integer counts as one, because the times
/// are not more accurate. From one half on, samples cannot be distinguished.
pub(super) fn blur<S: Scalar>(options: &RolloutOptions<S>) -> S {
    let span = options.t_end - options.t0;
    S::epsilon().ldexp(2) * (options.t0.abs() + options.t_end.abs() + span.abs()) / options.dt.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_is_named() {
        let good = RolloutOptions::<f64>::new(1.0, 0.1);
        assert!(good.check(1).is_ok());
        let name = |options: RolloutOptions<f64>| match options.check(1) {
            Err(RolloutError::Invalid { what, .. }) => what,
            other => panic!("{other:?}"),
        };
        assert_eq!(name(RolloutOptions { dt: 0.0, ..good.clone() }), "dt");
        assert_eq!(name(RolloutOptions { dt: 1e-12, ..good.clone() }), "dt");
        assert_eq!(name(RolloutOptions { t_end: f64::INFINITY, ..good.clone() }), "t_end");
        assert_eq!(name(RolloutOptions { rtol: f64::NAN, ..good.clone() }), "rtol");
        assert_eq!(name(RolloutOptions { atol: -1.0, ..good.clone() }), "atol");
        assert_eq!(name(RolloutOptions { rtol: 0.0, atol: 0.0, ..good.clone() }), "rtol");
        assert_eq!(name(RolloutOptions { rtol: 1e-30, ..good.clone() }), "rtol");
        assert_eq!(name(RolloutOptions { t0: 1e16, t_end: 1e16 + 10.0, ..good.clone() }), "dt");
        let least = RolloutOptions::<f64>::least_tolerance();
        assert!(RolloutOptions { rtol: least, ..good.clone() }.check(1).is_ok());
        assert!(RolloutOptions { rtol: 1e-30, method: Integrator::Gauss4, ..good.clone() }.check(1).is_ok());
        assert!(RolloutOptions::<f32>::new(1.0, 0.1).check(1).is_ok());
        assert_eq!(name(RolloutOptions { step: Some(0.0), ..good.clone() }), "step");
        assert_eq!(name(RolloutOptions { step: Some(f64::NAN), ..good.clone() }), "step");
        assert_eq!(name(RolloutOptions { max_steps: 0, ..good.clone() }), "max_steps");
        let fixed = RolloutOptions { method: Integrator::Gauss4, ..good.clone() };
        assert!(RolloutOptions { step: Some(1e-6), ..fixed.clone() }.check(1).is_ok());
        assert_eq!(name(RolloutOptions { step: Some(9e-7), ..fixed.clone() }), "step");
        assert_eq!(name(RolloutOptions { step: Some(1e-308), ..fixed.clone() }), "step");
        assert_eq!(name(RolloutOptions { dt: 1e-7, ..fixed.clone() }), "dt");
        assert!(RolloutOptions { dt: 1e-7, ..good.clone() }.check(1).is_ok());
        assert_eq!(name(RolloutOptions { max_steps: 9, ..fixed }), "dt");
        assert_eq!(name(RolloutOptions { domain: Some(Domain::new(vec![None])), ..good.clone() }), "domain");
    }

    #[test]
    fn domain_reports_the_first_violation() {
        let domain = Domain::new(vec![None, Some((-1.0, 1.0))]);
        assert_eq!(domain.violation(&[1e9, 0.5]), None);
        assert_eq!(domain.violation(&[0.0, 1.5]), Some((1, -1.0, 1.0)));
        assert_eq!(domain.violation(&[0.0, f64::NAN]), Some((1, -1.0, 1.0)));
    }
}
