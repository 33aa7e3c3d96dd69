//! Datasets, losses, regularizers, optimisers hosted by argmin, the trainer.

mod dataset;
mod objective;
mod optimizer;
mod penalty;
mod schedule;

pub use dataset::{Dataset, DatasetError};
pub use objective::{BatchReport, Failure, Objective};
pub use optimizer::{Method, Moments, Update};
pub use penalty::Penalty;
pub use schedule::Schedule;
