//! Training: losses, penalties, the solvers hosted by argmin, checkpoints.

pub(crate) mod checkpoint;
pub(crate) mod constrained_motion;
pub(crate) mod epoch;
mod lbfgs;
pub(crate) mod learner;
mod memory;
pub(crate) mod objective;
pub(crate) mod phase;
mod problem;
mod recipe;
pub(crate) mod reduction;
pub(crate) mod solver;
pub(crate) mod trainer;
pub(crate) mod violations;

#[doc(hidden)]
pub use checkpoint::{
    CheckpointError, CheckpointInterval, CheckpointManager, Fingerprint, LATEST, PREVIOUS, Restored, Saved, Snapshot,
    remove_checkpoints, saved,
};
pub use epoch::Epoch;
#[doc(hidden)]
pub use memory::training_memory;
pub use objective::Objective;
#[doc(hidden)]
pub use objective::{BatchReport, ThreadsError};
pub use phase::StopReason;
pub use problem::TrainingProblem;
#[doc(hidden)]
pub use recipe::RecipeError;
pub use recipe::{TrainingResult, run};
pub use solver::Hooks;
#[doc(hidden)]
pub use solver::{Progress, StepError, Watcher};
#[doc(hidden)]
pub use trainer::{ResumeOptions, resume};
pub use trainer::{Trained, TrainingError, train};
