//! Pipelines: a training, a fit of recorded motion or an evaluation, each from its configuration to model, tables, pictures and report.
//!
//! The command line and the Python package call the same functions:
//!
//! | function | from | to |
//! |---|---|---|
//! | [`train`] | a [`Config`](crate::configuration::Config) | a model of a known system and its [`Evaluation`] |
//! | [`Fit`] | recorded motion | a model, judged by motion that was held out ([`HoldOut`]) |
//! | [`Evaluation::of`] | a model and the system it learned | an [`Evaluation`] |
//!
//! Files go into an [`Output`], such as a [`Directory`] or [`InMemory`]; progress is reported as an [`Event`] to the [`Watch`], whose flag
//! ends the work. Nothing is printed, a [`Directory`] is not locked, and existing files of the same names are replaced; [`Fit::out`] and
//! experiments lock theirs, and replace an existing run only on request.
//!
//! # A fit of recorded motion, judged
//!
//! ```
//! use lnn::pipeline::Fit;
//! use lnn::recording::{RecordedTrajectory, Recording};
//!
//! // Two swings of a pendulum: an angle every 20 ms.
//! let swing = |amplitude: f64| -> Vec<f64> { (0..400).map(|k| amplitude * (0.06 * f64::from(k)).sin()).collect() };
//! let times: Vec<f64> = (0..400).map(|k| 0.02 * f64::from(k)).collect();
//! let trajectory = |name: &str, amplitude| RecordedTrajectory {
//!     name: name.into(), times: times.clone(), q: swing(amplitude), v: vec![], a: vec![], force: vec![],
//! };
//! let recording = Recording {
//!     coordinates: vec!["angle".into()],
//!     periodic: vec![true],
//!     tracks: vec![trajectory("first", 0.3), trajectory("second", 0.2), trajectory("third", 0.25)],
//! };
//!
//! let fit = Fit::recording(recording).options(|options| options.held_out = 0.3).configure(|config| {
//!     config.training.network.hidden = vec![8]; // as small as can be: this runs in a moment
//!     (config.training.phases[0].epochs, config.training.phases[0].t_max) = (2, 2.0);
//! });
//! # let directory = tempfile::tempdir().unwrap();
//! # let out = directory.path();
//! let fitted = fit.out(out).run()?;
//! assert_eq!(fitted.history.len(), 2);
//! assert!(fitted.hold_out.model[0].median.is_finite()); // rad, a quarter of the horizon ahead
//! assert!(out.join("report.html").exists() && out.join("model.safetensors").exists());
//! # Ok::<(), lnn::pipeline::PipelineError>(())
//! ```

mod checkpoints;
mod constraint_figures;
mod determination;
mod energy;
mod equivalence;
mod error;
mod evaluation;
mod evaluation_tables;
mod experiment;
mod experiment_directory;
mod experiment_report;
mod file_names;
mod first_look;
mod fit;
mod fit_builder;
mod fit_config;
mod fit_constraints;
mod fit_summary;
mod force_errors;
mod headline;
mod hold_out;
mod judging;
mod learned_functions;
mod losses;
mod members;
mod memory;
mod model;
mod output;
mod physics;
mod physics_report;
mod prediction;
mod prepared_fit;
mod report_files;
mod robot;
mod run_file;
mod run_table;
mod start;
mod sweep;
mod tables;
#[doc(hidden)]
pub mod text;
mod thresholds;
mod time_steps;
mod train;
mod watch;

pub use error::PipelineError;
pub use evaluation::{Evaluation, EvaluationOptions};
pub use first_look::{FirstLook, NextStep};
pub use fit::FitReport;
pub use fit_builder::Fit;
pub use fit_config::{FitColumns, FitConfig, FitConstraints, FitOptions};
pub use force_errors::ForceError;
pub use hold_out::{CoordinatePredictions, HoldOut, UsefulTime};
pub use judging::Unjudged;
pub use model::model_file;
pub use output::{Directory, InMemory, Output};
pub use robot::{parse_robot, rewrite_robot};
pub use sweep::{Sweep, Swept};
pub use text::parse_system;
pub use train::{RunOptions, TrainFigures, TrainReport, train};
pub use watch::{Event, Watch};

// Used by the other packages of this repository.
#[doc(hidden)]
pub use {
    checkpoints::{Begin, Checkpoints},
    experiment::{Experiment, KeptRecord, finish_runs, kept_record, merge_experiment, run_experiment},
    experiment_directory::{ExperimentDirectory, LockedDirectory},
    experiment_report::{Additions, ExperimentReport, Results},
    file_names::{CAPTIONS, LEARNED, MODEL, PLAY, RECORD, RUN, SUMMARY},
    fit::{fit, usual_force},
    fit_config::unit,
    memory::require as require_memory,
    model::{CONSTRAINTS_UNSUPPORTED, all_parameters, trained_on},
    prepared_fit::{PreparedFit, shorten},
    robot::is_robot,
    run_file::Command,
    start::StartModel,
    tables::from_table,
    thresholds::{MAX_RESULT_BYTES, RTOL},
};
