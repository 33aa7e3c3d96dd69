//! Failures of a pipeline.

use crate::analysis::GridError;
use crate::configuration::ConfigError;
use crate::data::{RecordingSplitError, SamplingError};
use crate::lagrangian::SystemError;
use crate::network::NetworkError;
use crate::network::file::ModelFileError;
use crate::pipeline::Unjudged;
use crate::recording::read::DataError;
use crate::recording::smooth::SmoothError;
use crate::shooting::ShootingError;
use crate::training::{CheckpointError, TrainingError};
use std::fmt;
use std::path::{Path, PathBuf};

/// Failure of a pipeline.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// Some values of a configuration are out of range; contains all of them.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Config(Vec<ConfigError>),
    /// The system or one of its parameters is unknown.
    #[error(transparent)]
    System(#[from] SystemError),
    /// States cannot be sampled, or sampling was interrupted.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// Files of recorded motion cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A network cannot learn from the recorded motion.
    #[error(transparent)]
    Recording(#[from] RecordingSplitError),
    /// Derivatives of the recorded motion cannot be estimated.
    #[error(transparent)]
    Smooth(#[from] SmoothError),
    /// Measured accelerations were requested, but there are none.
    #[error("no accelerations were given")]
    NoAccelerations,
    /// Forces were requested, but a coordinate has none.
    #[error("not every coordinate has a known force that changes")]
    NoForces,
    /// Constraints have a mistake, contradict each other, leave no motion, or are not obeyed by the recorded motion.
    #[error("{0}")]
    Constraints(String),
    /// The shape of the network is inconsistent.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The starting model has another shape than the configuration.
    #[error("{place}: the model has another shape: {}", .differences.join("; "))]
    OtherShape {
        /// The model: `--from MODEL` of a configuration, or its file if that has changed since.
        place: String,
        /// Differences, in words.
        differences: Vec<String>,
        /// `true` if the mistake is in the configuration, not in the file.
        configuration: bool,
    },
    /// A model file cannot be read or created.
    #[error("{}: {source}", path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// The problem.
        source: ModelFileError,
    },
    /// The directory contains no model.
    #[error("{}: there is no {} in this directory", .0.display(), crate::pipeline::MODEL)]
    NoModel(PathBuf),
    /// Training failed.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// Multiple shooting failed.
    #[error(transparent)]
    Shooting(#[from] ShootingError),
    /// A required checkpoint is missing, or belongs to another run.
    #[error("{}: {source}", directory.display())]
    Checkpoint {
        /// Directory of the checkpoints.
        directory: PathBuf,
        /// The problem.
        source: CheckpointError,
    },
    /// The system is not a black-hole metric.
    #[error(
        "{0}: expected a metric of t, x, y, z or t, r, theta, phi around a centre, learned over a range of distances"
    )]
    Hole(String),
    /// A picture cannot be drawn on its grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The work does not fit into memory.
    #[error("{work} takes {}", match needed {
        Some(needed) => format!("about {needed} of memory, {available} are available"),
        None => "more memory than can be counted".to_string(),
    })]
    Memory {
        /// The work.
        work: String,
        /// Required memory, in words; none if it cannot be computed.
        needed: Option<String>,
        /// Available memory, in words.
        available: String,
    },
    /// A file could not be written or removed.
    #[error("{}: {problem}", path.display())]
    Output {
        /// The file.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// Another process uses the directory.
    #[error("{}: another run is writing into this directory ({owner})", path.display())]
    Held {
        /// The directory.
        path: PathBuf,
        /// The other process.
        owner: String,
    },
    /// The directory already contains a run.
    #[error("{}: there is {name} of another run, which is replaced on demand alone (overwrite)", path.display())]
    Taken {
        /// The directory.
        path: PathBuf,
        /// A file of the run.
        name: String,
    },
    /// A result cannot be represented in its file format.
    #[error("{0}")]
    Format(String),
    /// The interrupt flag was raised while a finished model was tested.
    #[error("interrupted while the model was judged: the model is written, tables and report are not")]
    Interrupted,
    /// A newly trained model could not be tested.
    #[error("interrupted while the model was judged: the model is kept, tables and report are not written")]
    Unjudged(Box<Unjudged>),
    /// No run of the experiment is finished.
    #[error("none of {} is finished: there are no records to make tables of", crate::names::pluralize(*total, "run", "runs"))]
    NothingFinished {
        /// Runs requested.
        total: usize,
    },
    /// Another process works on runs of the experiment.
    #[error("{} left to other processes, the first to {owner}; start again when they have ended", crate::names::pluralize(*held, "run is", "runs are"))]
    HeldRuns {
        /// Runs that other processes work on.
        held: usize,
        /// The process that works on the first of them.
        owner: String,
    },
    /// The interrupt flag was raised while an experiment ran.
    #[error("interrupted with {finished} of {} finished", crate::names::pluralize(*total, "run", "runs"))]
    InterruptedRuns {
        /// Runs that are finished.
        finished: usize,
        /// Runs requested.
        total: usize,
    },
}

impl PipelineError {
    /// Creates the error for a file that could not be written or removed.
    pub fn output(path: &Path, problem: impl fmt::Display) -> Self {
        Self::Output { path: path.to_path_buf(), problem: problem.to_string() }
    }

    /// `true` if the error is in the configuration, not in data, files or the machine.
    pub fn is_configuration(&self) -> bool {
        match self {
            Self::Config(_) | Self::System(_) | Self::Network(_) | Self::NoAccelerations | Self::NoForces => true,
            Self::Constraints(_) => true,
            Self::Sampling(error) => !matches!(error, SamplingError::Dataset(_) | SamplingError::Interrupted),
            Self::OtherShape { configuration, .. } => *configuration,
            _ => false,
        }
    }

    pub(crate) fn constraints(error: impl fmt::Display) -> Self {
        Self::Constraints(error.to_string())
    }

    pub(crate) fn format(error: impl fmt::Display) -> Self {
        Self::Format(error.to_string())
    }
}

impl From<ConfigError> for PipelineError {
    fn from(error: ConfigError) -> Self {
        Self::Config(vec![error])
    }
}
