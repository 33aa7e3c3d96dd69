//! Integrators and trajectories: from `(q, v)` at `t0` to samples at `t0 + k dt`.
//!
//! A roll-out integrates `dq/dt = v`, `dv/dt = a(q, v)` with an explicit Runge-Kutta method of Dormand and Prince (order 5 or 8) under
//! error control, or Hamilton's equations of the same Lagrangian with a symplectic method of fixed step (implicit midpoint, Gauss
//! collocation, variational). When a model fails, the valid part of the trajectory is kept, and a [`RolloutError`] says where and why.
//! Every method except the variational one integrates models with friction; [`Trajectory::energy_balance`] says where the energy went.
//! [`Driven`] is a model under a [`Force`] `Q(t, q, v)` from outside: a motor, a controller, or a recording ([`SampledForce`]). Angles stay
//! continuous (never wrapped) in the output; a model that needs them wrapped wraps them itself.
//!
//! The motion of a model under constraints stays on them: the adaptive methods project their states and samples, the symplectic ones have
//! their constrained forms. A start is projected onto the constraints if it lies within a thousandth of its size, and refused otherwise.
//!
//! An [`Event`] is a zero of some number along the motion: it is recorded with its time and state, may end the motion, or is an impact on a
//! surface. It does not move the samples.
//!
//! [`rollout_in_pieces`] hands the samples over instead of keeping them, for motions longer than the memory.
//!
//! Adaptive integration is available in the precisions of the solver, [`Integrable`]: `f32` and `f64`; fixed steps in every precision by
//! [`rollout_fixed`].

mod adaptive;
mod between;
mod crossing;
mod dense;
mod ensemble;
mod error;
mod event;
mod fixed;
mod flow;
mod force;
mod gauss;
mod impact;
mod ode;
mod options;
mod phase;
mod pieces;
mod regular;
mod run;
mod simplified_newton;
mod spark;
mod thresholds;
mod trajectory;
mod variational;

pub use between::Between;
pub use ensemble::{Start, rollout_many};
pub use error::{RolloutError, UnderflowCause};
pub use event::{Event, Impact, Occurrence};
pub use flow::{Flow, FlowGradient, FlowJacobian};
pub use force::{Driven, Force, SampledForce};
pub use ode::Integrable;
pub use options::{Domain, Integrator, RolloutOptions};
pub use pieces::{Ending, EnergyBalance, rollout_in_pieces};
pub use run::{Motion, Rollout, rollout, rollout_fixed};
pub use trajectory::{StepCounts, Trajectory};

// For the packages of this repository.
#[doc(hidden)]
pub use {
    ensemble::{rollout_each, rollout_together},
    trajectory::quoted,
};

use run::StepFailure;

#[cfg(test)]
pub(crate) mod models;
#[cfg(test)]
mod tests;
