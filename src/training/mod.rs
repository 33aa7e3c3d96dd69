//! Datasets, losses, regularizers, optimisers hosted by argmin, the trainer.

mod config;
mod dataset;
mod objective;
mod optimizer;
mod penalty;
mod preset;
mod recipe;
mod sampling;
mod schedule;
mod solver;
mod trainer;

pub use config::{Config, ConfigError, Data, Network, OnFailure, Optimizer, Phase, Precision, Scaling};
pub use dataset::{Dataset, DatasetError};
pub use objective::{BatchReport, Failure, Objective};
pub use optimizer::{Method, Moments, Update};
pub use penalty::Penalty;
pub use preset::Preset;
pub use recipe::{Outcome, RecipeError, run};
pub use sampling::{SamplingError, sample, sample_all};
pub use schedule::Schedule;
pub use solver::{Epoch, EpochSolver, Hooks, Progress, StepError, TrainingProblem, TrainingState, Watcher};
pub use trainer::{Datasets, Stop, Stream, Trained, TrainingError, train};
