//! Energy and trajectory errors, comparisons of learned and exact Lagrangians, predictions of recorded motion.
//!
//! ```
//! use lnn::analysis::{EnergyError, MassMatrixError};
//! use lnn::lagrangian::SystemInstance;
//! use lnn::rollout::{RolloutOptions, rollout};
//!
//! // A double pendulum, and one whose second mass is 1 % too heavy, as a learned model might have it.
//! let exact = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
//! let heavy = SystemInstance::<f64>::named("double-pendulum", &[("m2".to_string(), "1.01".to_string())])?.build()?;
//! let found = MassMatrixError::of(&*exact, &*heavy, &[0.0, 0.0, 1.0, 0.2, -2.0, 1.5]); // at three positions
//! assert!(found.error.count == 3 && found.error.max < 0.01);
//!
//! // Drift of the exact energy along the model's motion, relative to at least 1 J.
//! let motion = rollout(&*heavy, &[1.0, 0.5], &[0.0, 0.0], &RolloutOptions::new(5.0, 0.1)).complete()?;
//! let error = EnergyError::of(&*exact, &motion, 1.0);
//! assert!(error.error.iter().all(|e| *e < 0.05) && error.error.iter().any(|e| *e > 1e-4));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod determination;
mod distance;
mod energy;
mod grid;
mod lyapunov;
mod prediction;
mod state_report;
mod statistics;
mod terms;
mod thresholds;
mod trajectories;
mod tube;

pub(crate) use determination::{Decay, decay};
pub(crate) use distance::{
    CoordinateError, ValidTime, ValidTimes, coordinate_error, spread, valid_time, velocity_error,
};
pub(crate) use distance::{angle_difference, relative_error};
pub use energy::EnergyError;
pub(crate) use energy::conserved_change;
pub(crate) use energy::{EnergyLoss, conserved_error, energy_drift, energy_loss};
pub use grid::GridError;
pub(crate) use grid::{Axis, Grid, determinant_grid, lagrangian_grid};
pub(crate) use grid::{
    MetricComponent, Spread, curvature_grid, curvature_scalars, grid_points, is_metric, metric_components, metric_grids,
};
pub use lyapunov::Lyapunov;
pub use prediction::PredictionError;
pub(crate) use prediction::follow;
pub(crate) use prediction::{coordinate_errors, window_valid_times};
pub use statistics::ErrorDistribution;
pub(crate) use statistics::training_instability;
pub(crate) use statistics::{Statistics, statistics, stretches};
pub use terms::MassMatrixError;
pub(crate) use terms::wrong_signatures;
pub(crate) use terms::{AffineFit, affine_fit, element_factor, matrices_at_rest, nearest_factor};
pub(crate) use thresholds::{REGULAR, VALID};
pub(crate) use trajectories::{Portrait, StartBox, TrajectoryRun, TrajectorySummary, TrajectoryTest};

// For the packages of this repository.
#[doc(hidden)]
pub use {
    determination::{Determination, Estimate, Observed, constants, determination, misfit},
    prediction::{Predictions, Window, predict_by_constant_velocity, predict_by_motion, prediction_error},
    state_report::{StateReport, StateReporter},
    terms::{acceleration_errors, mass_matrix_error_within},
    thresholds::MOST_MISFIT,
    tube::{MotionTube, Tube, TubeError},
};
