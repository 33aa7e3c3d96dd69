//! Directory of an experiment, where processes of several machines may work at a time: every run is claimed by one of them.

use crate::cli::claimed_run::ClaimedRun;
use crate::pipeline::{Directory, ExperimentStore, Output, PipelineError, RunClaim, RunOutput};
use crate::storage::Claimant;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two attempts to write tables that another process is writing.
const PAUSE: Duration = Duration::from_millis(20);

/// Leases that one waits for another process to write its tables.
const PATIENCE: u32 = 3;

/// Directory of an experiment.
#[derive(Debug)]
pub struct ExperimentFolder {
    path: PathBuf,
    claimant: Claimant,
}

impl ExperimentFolder {
    /// The directory of a path, created when something is written.
    pub fn new(path: &Path, claimant: Claimant) -> Self {
        Self { path: path.to_path_buf(), claimant }
    }

    fn take(&self, path: &Path, interrupt: &Arc<AtomicBool>) -> Result<Result<ClaimedRun, String>, PipelineError> {
        ClaimedRun::take(path, &self.claimant, interrupt).map_err(|error| PipelineError::Place(error.to_string()))
    }
}

impl ExperimentStore for ExperimentFolder {
    fn read(&self, run: &str, name: &str) -> Option<Vec<u8>> {
        Directory::at(&self.path).read(run, name)
    }

    fn names(&self, run: &str) -> Vec<String> {
        Directory::at(&self.path).names(run)
    }

    fn claim_run(&self, run: &str, interrupt: &Arc<AtomicBool>) -> Result<RunClaim<'_>, PipelineError> {
        Ok(match self.take(&self.path.join(run), interrupt)? {
            Ok(run) => RunClaim::Ours(Box::new(run)),
            Err(holder) => RunClaim::Held(holder),
        })
    }

    fn open_tables(&self, interrupt: &Arc<AtomicBool>) -> Result<Box<dyn Output + '_>, PipelineError> {
        let began = Instant::now();
        loop {
            match self.take(&self.path, interrupt)? {
                Ok(ours) => return Ok(Box::new(Tables(ours))),
                Err(holder)
                    if interrupt.load(Ordering::SeqCst) || began.elapsed() > PATIENCE * self.claimant.lease() =>
                {
                    let path = self.path.display();
                    let problem = format!("{path}: another run is writing into this directory ({holder})");
                    return Err(PipelineError::Place(problem));
                }
                Err(_) => std::thread::sleep(PAUSE),
            }
        }
    }
}

/// Tables of an experiment while they are written; no claim is left of it.
struct Tables(ClaimedRun);

impl Output for Tables {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        self.0.write(name, bytes)
    }
}

impl Drop for Tables {
    fn drop(&mut self) {
        self.0.finish();
    }
}
