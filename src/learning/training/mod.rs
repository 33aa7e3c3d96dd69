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
mod shard;
pub(crate) mod solver;
mod thresholds;
pub(crate) mod trainer;
pub(crate) mod violations;

pub use checkpoint::CheckpointError;
pub(crate) use checkpoint::Restored;
pub use epoch::Epoch;
pub use objective::{BatchReport, Objective, ThreadsError};
pub use phase::StopReason;
pub use problem::TrainingProblem;
pub use recipe::{RecipeError, TrainingResult, run};
pub use solver::{Hooks, Progress, StepError, Watcher};
pub use trainer::{Trained, TrainingError, train};

// Used by the other packages of this repository.
#[doc(hidden)]
pub use {
    checkpoint::{
        CheckpointInterval, CheckpointManager, Fingerprint, LATEST, PREVIOUS, Snapshot, remove_checkpoints, saved,
    },
    memory::training_memory,
    trainer::{ResumeOptions, resume},
};
