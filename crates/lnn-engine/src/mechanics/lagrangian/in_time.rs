//! Lagrangians and forces that depend on the time, and on inputs that are known functions of it: the time and these inputs are the last
//! coordinates of a Lagrangian, and the time increases at the rate 1.

use super::{EulerLagrange, MechanicsError, Request, Terms};
use crate::scalar::{Real, Scalar};
use alloc::boxed::Box;
use alloc::vec::Vec;

/// A Lagrangian `L(q, v, t)` of `n` coordinates: a model of `n + 1` coordinates, the last of which is the time.
///
/// Write the Lagrangian with the time as its last coordinate. It needs no velocity of the time, because `dt/dt = 1`. Then
///
/// ```text
/// M a = g - c + Q,    c = (d2L/dv dq) v + d2L/dv dt,    dE/dt = v.Q - dL/dt
/// ```
///
/// with `M`, `g` and `Q` of the first `n` coordinates. The energy lost through the time dependence, `dL/dt`, counts as
/// [`Terms::dissipation`]. [`terms_at`](EulerLagrange::terms_at) gives these terms at a time; roll-outs know the time.
///
/// ```
/// use lnn::lagrangian::{InTime, Lagrangian, Mechanics};
/// use lnn::rollout::{RolloutOptions, rollout};
/// use lnn::scalar::Real;
///
/// struct Shrinking; // a pendulum of 1 kg whose length, 1 m at first, grows by 0.1 m/s
/// impl Lagrangian for Shrinking {
///     fn coordinates(&self) -> usize {
///         2 // the angle and the time
///     }
///     fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
///         let (length, g) = (R::one() + R::of(0.1) * q[1], R::of(9.8));
///         (length * v[0]).sqr() * R::of(0.5) + g * length * q[0].cos()
///     }
/// }
///
/// let model = InTime::new(Mechanics::new(Shrinking, Vec::new()));
/// let motion = rollout(&model, &[0.1], &[0.0], &RolloutOptions::<f64>::new(20.0, 0.01)).complete()?;
/// // The amplitude falls as the length to the power -3/4.
/// let last = motion.q[1500..].iter().fold(0.0, |most: f64, q| most.max(q.abs()));
/// assert!((0.1 * 2.6_f64.powf(-0.75) - last).abs() < 2e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct InTime<M, U = ()> {
    model: M,
    inputs: U,
}

/// Known functions of the time.
pub trait Inputs<S>: Send + Sync {
    /// Returns the number of functions.
    fn count(&self) -> usize;

    /// Writes their values, `(count)`, at a time.
    fn write(&self, t: S, values: &mut [S]);
}

impl<S> Inputs<S> for () {
    fn count(&self) -> usize {
        0
    }

    fn write(&self, _: S, _: &mut [S]) {}
}

/// A pair of the number of functions and a closure that writes all values.
impl<S, F: Fn(S, &mut [S]) + Send + Sync> Inputs<S> for (usize, F) {
    fn count(&self) -> usize {
        self.0
    }

    fn write(&self, t: S, values: &mut [S]) {
        self.1(t, values);
    }
}

impl<S> Inputs<S> for Box<dyn Inputs<S> + '_> {
    fn count(&self) -> usize {
        (**self).count()
    }

    fn write(&self, t: S, values: &mut [S]) {
        (**self).write(t, values);
    }
}

impl<M> InTime<M> {
    /// Wraps a model of `n` coordinates and the time.
    pub fn new(model: M) -> Self {
        Self { model, inputs: () }
    }
}

impl<M, U> InTime<M, U> {
    /// Wraps a model of `n` coordinates, the time, and inputs, on which its forces may depend but not its Lagrangian. Inputs are, for
    /// instance, a pair of their number and a closure `Fn(t, &mut values)`.
    pub fn with_inputs(model: M, inputs: U) -> Self {
        Self { model, inputs }
    }
}

impl<S: Scalar, M: EulerLagrange<S>, U: Inputs<S>> EulerLagrange<S> for InTime<M, U> {
    fn coordinates(&self) -> usize {
        self.model.coordinates() - 1 - self.inputs.count()
    }

    /// Always fails, because a state alone has no time.
    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        self.terms_at(&[], q, v, request, terms)
    }

    fn terms_at(
        &self,
        t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        let n = EulerLagrange::<S>::coordinates(self);
        let batch = v.len() / n.max(1);
        if t.len() != batch {
            terms.clear();
            let shape = MechanicsError::Shape { what: "times", expected: batch, found: t.len() };
            return Err(if t.is_empty() { MechanicsError::Timed } else { shape });
        }
        let all = self.model.coordinates();
        let mut states = vec![<S as Real>::zero(); batch * all];
        let mut rates = states.clone();
        for (row, (state, rate)) in states.chunks_exact_mut(all).zip(rates.chunks_exact_mut(all)).enumerate() {
            state[..n].copy_from_slice(&q[row * n..][..n]);
            rate[..n].copy_from_slice(&v[row * n..][..n]);
            (state[n], rate[n]) = (t[row], <S as Real>::one());
            self.inputs.write(t[row], &mut state[n + 1..]);
        }
        let power = request.includes(Request::FORCE);
        let asked = request.without_solution() | if power { Request::DL_DQ } else { Request::default() };
        let outcome = self.model.terms(&states, &rates, asked, terms);
        let found = terms.drain_failures(outcome)?;
        if power {
            terms.force.resize(batch * all, <S as Real>::zero());
            terms.dissipation.resize(batch, <S as Real>::zero());
            for (row, power) in terms.dissipation.iter_mut().enumerate() {
                let time = row * all + n;
                // A force along the time has no effect on the motion; its power is already counted.
                *power += terms.dl_dq[time] + terms.force[time];
            }
        }
        terms.keep_first(n, all);
        terms.complete_beside(found, n, v, request)
    }

    fn is_timed(&self) -> bool {
        true
    }

    fn conserves_energy(&self) -> bool {
        false
    }
}

impl<S: Scalar> Terms<S> {
    /// Removes all coordinates except the first `n`.
    fn keep_first(&mut self, n: usize, all: usize) {
        let keep = |field: &mut Vec<S>, is_kept: &dyn Fn(usize) -> bool| {
            let mut at = 0;
            field.retain(|_| {
                at += 1;
                is_kept(at - 1)
            });
        };
        for field in [&mut self.momentum, &mut self.dl_dq, &mut self.coriolis, &mut self.force] {
            keep(field, &|at| at % all < n);
        }
        keep(&mut self.mass_matrix, &|at| at % all < n && at / all % all < n);
    }
}
