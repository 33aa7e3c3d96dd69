//! The tape: reverse mode, and recorded programs.
//!
//! Three ways to derivatives, all generic over the number:
//!
//! - [`Tape`] records while it computes; one reverse sweep gives the gradient at those very numbers. The code under
//!   it may branch on values. Elements are any [`Real`](crate::scalar::Real): a tape over forward numbers gives
//!   Hessians.
//! - [`Program`] records once, without numbers, and is replayed on many states side by side (lanes) by a [`Replay`],
//!   without allocating; recorded over forward numbers, it computes their derivatives. A branch on a value cannot be recorded
//!   and is refused; [`Real::select`](crate::scalar::Real::select) can.
//! - [`Recorded`] holds a function `L(q, v)` of numbers and dense layers ([`Real::affine`](crate::scalar::Real::affine)), and
//!   an [`Evaluation`] gives everything a Lagrangian is asked for: `p`, `g`, `M`, `c`, and gradients of losses of the
//!   accelerations by parameters and state.
//!
//! Memory of a [`Tape`] over numbers of `s` bytes: `8 + 2 s` bytes per node (24 for `f64`), of which there is one per
//! variable and one per operation on two variables; functions of one variable, constant factors and constant summands
//! need none. The sweep holds `s` bytes per node besides, in [`Adjoints`]. A reset keeps the memory and costs nothing per
//! node (the one after a recording that outgrew the room allocates room for it); the next sweep clears one adjoint per
//! node recorded, not per node held. A [`Replay`] holds `s` bytes per row and lane of one chunk of 64 states.
//!
//! In all of them constants are never recorded and variables of two recordings never mix silently. On the [`Tape`] a zero
//! adjoint times an infinite partial derivative contributes 0, so that a branch not taken leaves no `NaN`; a [`Recorded`]
//! Lagrangian needs finite slopes in both branches.
//!
//! ```
//! use lnn::scalar::Real;
//! use lnn::tape::{Depth, Evaluation, Recorded, TapeError};
//! use std::sync::Arc;
//!
//! // A bead on a rotating hoop, L = v^2/2 + w^2 sin^2 q / 2 + cos q, recorded once with w as parameter.
//! let hoop = Recorded::new(vec![1.0], 1, |w, q, v| {
//!     v[0].sqr() * Real::half() + (w[0] * q[0].sin()).sqr() * Real::half() + q[0].cos()
//! })?;
//! let mut evaluation = Evaluation::new(Arc::new(hoop));
//! evaluation.evaluate(&[2.0], &[0.5], &[1.0], Depth::Motion);
//! let (sin, cos) = 0.5_f64.sin_cos();
//! assert!((evaluation.dl_dq[0] - sin * (4.0 * cos - 1.0)).abs() < 1e-15);
//! assert_eq!((evaluation.momentum[0], evaluation.mass_matrix[0]), (1.0, 1.0));
//! # Ok::<(), TapeError>(())
//! ```

mod driver;
mod eager;
mod engine;
mod error;
mod program;
mod var;

#[doc(hidden)]
pub use driver::gradient_on;
pub use driver::{ScalarFunction, VectorFunction, derivative, gradient, hessian, hessian_vector, jacobian};
#[doc(hidden)]
pub use eager::Statistics;
pub use eager::{Adjoints, Tape};
pub use engine::{Depth, Evaluation, Recorded};
#[doc(hidden)]
pub use engine::{MixedDirections, STATES};
pub use error::TapeError;
#[doc(hidden)]
pub use program::{Listing, Operation, Program, Replay, Tracer};
pub use var::Var;
