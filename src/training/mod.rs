//! Datasets, losses, regularizers, optimisers hosted by argmin, the trainer.

mod checkpoint;
mod config;
mod dataset;
mod measured;
mod memory;
mod motions;
mod objective;
mod optimizer;
mod penalty;
mod polish;
mod preset;
mod problem;
mod recipe;
mod reference;
mod sampling;
mod schedule;
pub mod shooting;
mod signature;
mod solver;
mod stripes;
mod trainer;
mod violations;

pub use checkpoint::{
    CheckpointError, Every, Identity, Keeper, NEWEST, PREVIOUS, Restored, Saved, Snapshot, remove_checkpoints, saved,
};
pub use config::{Config, ConfigError, Data, Known, Network, OnFailure, Optimizer, Phase, Polish, Precision, Scaling};
pub use dataset::{Dataset, DatasetError};
pub use measured::{Measured, MeasuredError, Part, Preparation};
pub use memory::training_memory;
pub use objective::{BatchReport, Failure, Objective};
pub use optimizer::{Method, Moments, Update};
pub use penalty::{Penalty, Regularizer};
pub use preset::Preset;
pub use problem::TrainingProblem;
pub use recipe::{Outcome, RecipeError, run};
pub use reference::{Key, SHOOTING_SECTION, Section, TRAINING_SECTIONS, configuration_reference, section_reference};
pub use sampling::{SamplingError, sample, sample_all};
pub use schedule::Schedule;
pub use signature::{
    Buffers as SignatureBuffers, Violation, characteristic_scales, eigenvalue_violation, has_signature,
    sylvester_violation,
};
pub use solver::{Epoch, EpochSolver, Hooks, Progress, StepError, TrainingState, Watcher};
pub use trainer::{Datasets, Sitting, Stop, Stream, Trained, TrainingError, resume, train};
