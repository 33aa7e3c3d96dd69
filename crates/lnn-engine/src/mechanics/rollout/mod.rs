//! Integrators and trajectories: from `(q, v)` at `t0` to samples at `t0 + k dt`.
//!
//! A roll-out integrates `dq/dt = v`, `dv/dt = a(q, v)` with an explicit Runge-Kutta method of Dormand and Prince (order 5 or 8) with error
//! control, or Hamilton's equations of the same Lagrangian with a symplectic fixed-step method (implicit midpoint, Gauss collocation,
//! variational). If a model fails, the valid part of the trajectory is kept, and a [`RolloutError`] states where and why. All methods
//! except the variational one can integrate models with friction; [`Trajectory::energy_balance`] reports how the energy changed. [`Driven`]
//! adds an external [`Force`] `Q(t, q, v)` to a model: a motor, a controller, or a recording ([`SampledForce`]). Angles in the output are
//! continuous (never wrapped); a model that needs wrapped angles wraps them itself.
//!
//! The motion of a model with constraints satisfies them: the adaptive methods project their states and samples, and the symplectic ones
//! have constrained forms. An initial state is projected onto the constraints if its distance is below a thousandth of its size, and
//! rejected otherwise.
//!
//! An [`Event`] is a zero of a function along the motion. It is recorded with its time and state, and may end the motion or be an impact on
//! a surface. The sample times do not change.
//!
//! [`rollout_in_pieces`] passes the samples to a callback instead of storing them, for motions that do not fit in memory.
//!
//! Adaptive integration is available for the number types [`Integrable`], `f32` and `f64`; [`rollout_fixed`] integrates with fixed steps in
//! every precision.

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
mod integration;
mod observer;
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

// These are for the other packages of this repository.
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
