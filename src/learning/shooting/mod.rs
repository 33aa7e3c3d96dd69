//! Learning through the motion: multiple shooting with gradients through the integrator.
//!
//! Recorded positions are noisy, and a second derivative of them is noisier still. Here nothing is differentiated: every trajectory is cut
//! into short segments, each with a free start `(q0, v0)`; the network's own motion is integrated from there by a Runge-Kutta method, and
//! its positions (and velocities, if measured) are compared with the data. The loss is
//!
//! ```text
//! mean over all residuals of rho(r),  r = (q - q_observed)/sigma_i, and the same of v if it was measured,
//!     + continuity * (sum over joints of rho(gap/tau)) / residuals,    rho(r) = r^2, linear beyond the Huber bound,
//! ```
//!
//! so that a loss of 1 means noise alone (a little less where the starts were fitted to it). A joint is where a segment ends and the next
//! one starts, and `tau` is the noise of a position or of a velocity. The gradient by weights and starts is the exact gradient of the
//! discrete map: the adjoint Runge-Kutta method over the adjoint identity of the network.
//!
//! Bock, H. G. (1981), "Numerical treatment of inverse problems in chemical reaction kinetics" (multiple shooting);
//! Hager, W. W. (2000), "Runge-Kutta methods in optimal control and the transformed adjoint system" (its discrete adjoint).
//!
//! Under constraints the network's motion includes their multipliers, and starts satisfy the constraints: each Gauss-Newton step is taken
//! along them and then projected back.
//!
//! [`fit`](fit()) does all of this; [`Segments`] and [`ShootingObjective`] are its parts.

mod fit;
mod integrator;
mod learner;
mod loss;
mod motion;
mod objective;
mod segments;
mod settings;
mod starts;
mod starts_allowed;
mod thresholds;

pub use fit::{Fitted, ShootingError, Task, fit, resume};
pub use objective::ShootingObjective;
pub use segments::Segments;
pub use settings::Shooting;
pub use starts::Curvature;
