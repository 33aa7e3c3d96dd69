//! `lnn train`: learns, judges, writes.

use crate::cli::folder::Folder;
use crate::cli::learned::model_file;
use crate::cli::number::threads;
use crate::cli::place::{self, Wanted};
use crate::cli::results::Writer;
use crate::cli::resume::{self, Found, Learner, configuration, find, forget, how_to_go_on, require_same, say_finished};
use crate::cli::train_config::Args;
use crate::cli::watch::watch;
use crate::cli::{CliError, interrupt, output};
use crate::configuration::{Config, Penalty, Regularizer};
use crate::data::{SamplingError, sample_all};
use crate::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use crate::names::{counted, percent};
use crate::pipeline::{Begin, Checkpoints, PipelineError, RunOptions, TrainReport, train};
use crate::training::{LATEST, StopReason, TrainingError};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Trains and writes everything into the output directory; goes on with a training that was stopped, if asked to.
///
/// # Errors
/// A usage error for arguments and configuration, a data error for files and a training that fails, an interruption;
/// after the last two the best model so far is written, if there is one.
pub fn run(args: &Args) -> Result<(), CliError> {
    if let Some(format) = args.run.print_config {
        return args.print(format);
    }
    let Some(Task { config, system, folder, start }) = Task::of(args)? else { return Ok(()) };
    let forbidden = forbidden_share(&config, &system).filter(|share| *share > 0.0);
    if let (Some(share), Regularizer::LorentzianSylvester { time, .. }) = (forbidden, &config.penalty) {
        let place = "as inside of a horizon or of an ergosphere: choose --penalty signature, or other bounds";
        let share = percent(share);
        output::note(&format!("the penalty is against g_{time}{time} > 0, which {share} of the states have, {place}"));
    }
    let stop = interrupt::flag().map_err(CliError::signals)?;
    let checkpoints = Checkpoints::new(folder.path(), args.run.checkpoint_every).beginning(start);
    let options =
        RunOptions { threads: threads(args.run.threads), checkpoints: Some(checkpoints), ..RunOptions::default() };
    let trained = match train(&config, &system, &options, &folder, &watch(&stop)) {
        Ok(trained) => trained,
        Err(
            PipelineError::Sampling(SamplingError::Interrupted)
            | PipelineError::Training(TrainingError::NothingLearned(_)),
        ) if stop.load(Ordering::SeqCst) => {
            let problem = "interrupted before the first epoch ended";
            return Err(CliError::interrupted(format_args!("{problem}{}", how_to_go_on(folder.path()))));
        }
        Err(error @ PipelineError::Training(TrainingError::NothingLearned(_))) => {
            forget(folder.path())?;
            return Err(error.into());
        }
        Err(error) => return Err(resume::keeping(folder.path())(error.into())),
    };
    if trained.stop != StopReason::Interrupted {
        forget(folder.path())?;
    }
    if args.run.json {
        output::print(&trained.json)?;
    } else {
        output::print(&format!("{}report: {}\n", trained.text(), folder.file("report.html").display()))?;
    }
    conclude(&trained, folder.path())
}

/// States that are looked at for a remark on the penalty.
const LOOKED_AT: usize = 512;

/// Share of the training states at which the exact metric is what a penalty forbids; `None` without such a penalty, or where it is not
/// known.
fn forbidden_share(config: &Config, system: &SystemInstance<f64>) -> Option<f64> {
    let Penalty::Sylvester { time: Some(time), .. } = config.penalty().ok()? else { return None };
    let mut few = config.clone();
    (few.data.training, few.data.validation, few.data.test) = (LOOKED_AT, 1, 1);
    let (data, _) = sample_all::<f64>(&few, system).ok()?;
    let (set, n, mut terms) = (&data.training[0], system.coordinates, Terms::default());
    system.build().ok()?.terms(set.q(), set.v(), Request::MASS_MATRIX, &mut terms).ok()?;
    let forbidden = terms.mass_matrix.chunks_exact(n * n).filter(|g| g[time * n + time] > 0.0).count();
    Some(forbidden as f64 / set.len() as f64)
}

/// A training: configuration, system, directory and beginning.
struct Task {
    config: Config,
    system: SystemInstance<f64>,
    folder: Folder,
    start: Begin,
}

impl Task {
    /// The task that the arguments set; `None` if it has been done before.
    fn of(args: &Args) -> Result<Option<Self>, CliError> {
        let Some(path) = &args.run.resume else {
            let (config, system) = args.resolve(None)?;
            let usual = PathBuf::from("runs").join(&config.system);
            let start = config.from.as_deref().map(|from| model_file(Path::new(from))).transpose()?;
            let inputs: Vec<&Path> = args.inputs().chain(start.as_deref()).collect();
            let wanted = Wanted {
                out: args.run.out.as_deref(),
                usual: &usual,
                overwrite: args.run.overwrite,
                inputs: &inputs,
                writer: Writer::Learner,
            };
            return Ok(Some(Self { config, system, folder: place::open(&wanted)?, start: Begin::Anew }));
        };
        // Looked for before anything is created, and again when nobody else can write.
        find(path, Learner::Train)?;
        let folder = Folder::open(path)?;
        match find(path, Learner::Train)? {
            Found::Finished(text, json) => {
                let saved = configuration(path, "config.toml", &text)?;
                require_same(path, &saved, &args.resolve(Some(&saved))?.0)?;
                say_finished(path, args.run.json.then_some(&json))?;
                Ok(None)
            }
            Found::Unfinished(text) => {
                let saved = configuration(path, LATEST, &text)?;
                require_same(path, &saved, &args.resolve(Some(&saved))?.0)?;
                let system = args.check(&saved)?;
                Ok(Some(Self { config: *saved, system, folder, start: Begin::Resume }))
            }
        }
    }
}

/// The exit of a training that did not run to its end.
fn conclude(finished: &TrainReport, path: &Path) -> Result<(), CliError> {
    let kept = format!("the best of {} is in {}", counted(finished.history.len(), "epoch", "epochs"), path.display());
    match &finished.stop {
        StopReason::Finished => Ok(()),
        StopReason::Interrupted => {
            Err(CliError::interrupted(format_args!("interrupted, {kept}{}", how_to_go_on(path))))
        }
        StopReason::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}; {kept}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::configure;
    use crate::network::Structure;
    use crate::presets::Preset;

    #[test]
    fn a_penalty_is_known_to_forbid_the_inside_of_a_horizon() {
        let share = |name: &str, radius: [f64; 2]| {
            let system = configure::<f64>(name, &[]).unwrap();
            let mut config = Preset::Quick.config(&system).unwrap();
            config.take_structure(Structure::BlackBox);
            config.penalty = Regularizer::LorentzianSylvester { lambda: 1.0, time: "t".to_string() };
            config.data.shell_radius = config.data.shell_radius.map(|_| radius);
            forbidden_share(&config, &system)
        };
        // The horizon of mass 1 is at 2.
        assert_eq!(share("schwarzschild-cartesian", [3.0, 20.0]), Some(0.0));
        assert_eq!(share("schwarzschild-cartesian", [1.0, 1.9]), Some(1.0));
        assert!(share("schwarzschild-cartesian", [1.0, 4.0]).is_some_and(|share| (0.3..0.7).contains(&share)));
        assert_eq!(share("ads4-geodesic", [0.0; 2]), Some(0.0));
        let system = configure::<f64>("kepler", &[]).unwrap();
        assert_eq!(forbidden_share(&Preset::Quick.config(&system).unwrap(), &system), None);
    }
}
