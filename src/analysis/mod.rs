//! Energy and trajectory errors, comparisons of learned and exact Lagrangians, predictions of recorded motion.

mod accelerations;
mod affine;
mod conserved;
mod coordinates;
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
pub use conserved::conserved_error;
pub(crate) use coordinates::angle_difference;
pub use coordinates::{CoordinateError, coordinate_error, velocity_error};
pub use determination::{Determination, Estimate, Observed, RANGE, determination, places};
pub use dissipation::{EnergyLoss, energy_loss};
pub use energy::{EnergyError, energy_drift, energy_error};
pub use grid::{Axis, Grid, GridError, determinant_grid, lagrangian_grid};
pub use instability::{stretches, training_instability};
pub use lyapunov::{Lyapunov, REGULAR, lyapunov};
pub use mass_matrix::{MassMatrixError, mass_matrix_error};
pub use portrait::Portrait;
pub(crate) use prediction::window_valid_times;
pub use prediction::{
    PredictionError, Predictions, Window, follow, predict_by_constant_velocity, predict_by_motion, prediction_error,
};
pub use signature::wrong_signatures;
pub use summary::{ErrorDistribution, Statistics, statistics};
pub use trajectories::{StartBox, TrajectoryRun, TrajectorySummary, TrajectoryTest};
pub(crate) use valid_time::relative_error;
pub use valid_time::{VALID, ValidTime, ValidTimes, spread, valid_time};
