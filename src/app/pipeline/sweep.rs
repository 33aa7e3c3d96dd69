//! Sweeps: trainings of several configurations, collected in tables.

use crate::configuration::Config;
use crate::experiments::{Choice, sweep_runs};
use crate::findings::Findings;
use crate::pipeline::{
    Command, Experiment, ExperimentDirectory, KeptRecord, PipelineError, Watch, kept_record, run_experiment,
};
use serde_json::{Map, Value};
use std::path::Path;

/// An experiment whose runs are chosen by the user.
#[derive(Clone, Copy, Debug)]
pub struct Sweep;

impl Experiment for Sweep {
    fn name(&self) -> &str {
        "sweep"
    }

    fn command(&self) -> Command {
        Command::Sweep
    }

    fn title(&self) -> &str {
        "Sweep over configurations"
    }
}

/// The results of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Swept {
    /// One object for each choice, as in `table.csv`.
    pub rows: Vec<Map<String, Value>>,
    /// Number of finished runs.
    pub finished: usize,
    /// Headline and tables.
    pub findings: Findings,
}

impl Sweep {
    /// Trains every configuration with several seeds, starting with its own, as many at a time as there are threads, each into its own
    /// directory below `path`; finished runs are not repeated. A table and a report of all runs are written there.
    ///
    /// # Errors
    /// [`PipelineError::Taken`] for a finished run of another configuration unless `overwrite` is set; files that cannot be written, an
    /// interruption. Finished runs are kept.
    pub fn run(
        configurations: Vec<(Choice, Config)>,
        (seeds, threads): (usize, usize),
        (path, overwrite): (&Path, bool),
        watch: &Watch,
    ) -> Result<Swept, PipelineError> {
        let (runs, store) = (sweep_runs(configurations, seeds), ExperimentDirectory::new(path));
        for run in runs.iter().filter(|_| !overwrite) {
            if matches!(kept_record(&store, run)?, KeptRecord::OtherConfiguration) {
                return Err(PipelineError::Taken { path: path.to_path_buf(), name: run.name.clone() });
            }
        }
        let done = run_experiment(&Sweep, runs, threads, &store, watch)?;
        Ok(Swept { rows: done.table.objects(), finished: done.finished, findings: done.findings })
    }
}
