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

pub use checkpoint::CheckpointError;
pub(crate) use checkpoint::Restored;
#[doc(hidden)]
pub use checkpoint::{
    CheckpointInterval, CheckpointManager, Fingerprint, LATEST, PREVIOUS, Snapshot, remove_checkpoints, saved,
};
pub use epoch::Epoch;
#[doc(hidden)]
pub use memory::training_memory;
pub use objective::{BatchReport, Objective, ThreadsError};
pub use phase::StopReason;
pub use problem::TrainingProblem;
pub use recipe::{RecipeError, TrainingResult, run};
pub use solver::{Hooks, Progress, StepError, Watcher};
#[doc(hidden)]
pub use trainer::{ResumeOptions, resume};
pub use trainer::{Trained, TrainingError, train};
