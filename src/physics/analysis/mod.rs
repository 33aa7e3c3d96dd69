//! Energy and trajectory errors, comparisons of learned and exact Lagrangians, predictions of recorded motion.
//!
//! ```
//! use lnn::analysis::{energy_error, mass_matrix_error};
//! use lnn::lagrangian::build;
//! use lnn::rollout::{Options, rollout};
//!
//! // A double pendulum, and one whose second mass is 1 % too heavy, as a learned model might have it.
//! let exact = build::<f64>("double-pendulum", &[])?;
//! let heavy = build::<f64>("double-pendulum", &[("m2".to_string(), "1.01".to_string())])?;
//! let found = mass_matrix_error(&*exact, &*heavy, &[0.0, 0.0, 1.0, 0.2, -2.0, 1.5]); // at three positions
//! assert!(found.error.count == 3 && found.error.max < 0.01);
//!
//! // How far its motion is from keeping the exact energy, relative to 1 J at least.
//! let motion = rollout(&*heavy, &[1.0, 0.5], &[0.0, 0.0], &Options::new(5.0, 0.1)).complete()?;
//! let error = energy_error(&*exact, &motion, 1.0);
//! assert!(error.error.iter().all(|e| *e < 0.05) && error.error.iter().any(|e| *e > 1e-4));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod accelerations;
mod affine;
mod conserved;
mod coordinates;
mod curvature;
mod determination;
mod dissipation;
mod energy;
mod grid;
mod instability;
mod lyapunov;
mod mass_matrix;
mod portrait;
mod prediction;
mod signature;
mod summary;
mod trajectories;
mod valid_time;

pub use accelerations::acceleration_errors;
pub(crate) use affine::{AffineFit, affine_fit, factor_fit};
#[doc(hidden)]
pub(crate) use conserved::conserved_change;
pub use conserved::conserved_error;
pub(crate) use coordinates::angle_difference;
#[doc(hidden)]
pub use coordinates::{CoordinateError, coordinate_error, velocity_error};
pub(crate) use curvature::{MetricComponent, Spread};
pub(crate) use curvature::{
    curvature_grid, curvature_scalars, grid_points, is_metric, metric_components, metric_grids,
};
#[doc(hidden)]
pub use determination::{
    Decay, Determination, Estimate, MOST_MISFIT, Observed, RANGE, constants, decay, determination, misfit,
};
#[doc(hidden)]
pub use dissipation::{EnergyLoss, energy_loss};
#[doc(hidden)]
pub use energy::energy_drift;
pub use energy::{EnergyError, energy_error};
#[doc(hidden)]
pub use grid::{Axis, Grid, GridError, determinant_grid, lagrangian_grid};
#[doc(hidden)]
pub use instability::stretches;
pub(crate) use instability::training_instability;
#[doc(hidden)]
pub use lyapunov::REGULAR;
pub use lyapunov::{Lyapunov, lyapunov};
pub use mass_matrix::{MassMatrixError, mass_matrix_error, mass_matrix_error_within};
pub(crate) use mass_matrix::{matrices_at_rest, nearest_factor};
#[doc(hidden)]
pub use portrait::Portrait;
#[doc(hidden)]
pub use prediction::PredictionError;
#[doc(hidden)]
pub use prediction::{Predictions, Window, follow, predict_by_constant_velocity, predict_by_motion, prediction_error};
pub(crate) use prediction::{coordinate_errors, window_valid_times};
pub use signature::wrong_signatures;
#[doc(hidden)]
pub use summary::{ErrorDistribution, Statistics, statistics};
#[doc(hidden)]
pub use trajectories::{StartBox, TrajectoryRun, TrajectorySummary, TrajectoryTest};
pub(crate) use valid_time::relative_error;
#[doc(hidden)]
pub use valid_time::{VALID, ValidTime, ValidTimes, spread, valid_time};
