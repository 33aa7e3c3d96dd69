//! `lnn fit`: learns from recorded motion, judges by motion that was held out, writes.

use crate::cli::fit_args::Args;
use crate::cli::fit_config::{Settled, columns_of, commented_fit, fit_reference};
use crate::cli::fit_resume::Order;
use crate::cli::folder::Folder;
use crate::cli::learned::model_file;
use crate::cli::number::threads;
use crate::cli::place::{self, Wanted};
use crate::cli::print_config::PrintFormat;
use crate::cli::results::Writer;
use crate::cli::resume::{self, forget, how_to_go_on};
use crate::cli::said::Said;
use crate::cli::watch::watch;
use crate::cli::{CliError, interrupt, output};
use crate::configuration::{Precision, Regularizer};
use crate::network::Structure;
use crate::pipeline::{
    Begin, Checkpoints, FitConfig, FitOptions, PipelineError, PreparedFit, RunOptions, StartModel, fit, shorten,
};
use crate::presets::configuration_reference;
use crate::recording::Targets;
use crate::shooting::Shooting;
use crate::training::StopReason;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Learns and writes everything into the output directory.
///
/// # Errors
/// A usage error for arguments, a data error for files and data that cannot be learned from, an interruption; after the
/// last the best model so far is written, if there is one.
pub fn run(args: &Args, words: &[OsString]) -> Result<(), CliError> {
    let started = Instant::now();
    if args.print_config == Some(PrintFormat::Markdown) {
        return output::print(&(fit_reference() + &configuration_reference()));
    }
    let Some(Order { args, said, resumed }) = Order::of(args, words)? else { return Ok(()) };
    let settled = Settled::of(&args)?;
    let args = &settled.args;
    let reading = args.recording.read()?;
    if let Some(time) = &args.timelike {
        let names = &reading.recording.coordinates;
        if !names.contains(time) {
            let known = names.join(", ");
            return Err(CliError::usage(format_args!("--timelike {time}: expected one of the coordinates {known}")));
        }
    }
    let options = FitOptions {
        targets: args.targets.map(Targets::from),
        held_out: args.share(),
        window: args.window,
        noise: args.noise.clone(),
        seed: args.seed(),
    };
    let prepared = PreparedFit::new(&reading, &options).map_err(|error| match error {
        PipelineError::NoAccelerations => {
            CliError::usage(format_args!("--targets measured: {error}, see --acceleration"))
        }
        _ => error.into(),
    })?;
    prepared.check_horizon(args.horizon).map_err(|fault| CliError::usage(format_args!("--{fault}")))?;
    let prepared = PreparedFit { started, ..prepared };
    prepared.survey()?.warnings.iter().for_each(|warning| output::note(warning));
    let forced = reading.recording.tracks.iter().any(|track| !track.force.is_empty());
    if args.friction.is_some() && reading.recording.n() == 1 && !forced {
        let motion = "every motion of one coordinate has a Lagrangian";
        output::note(&format!("{motion}: without known forces (--force) L and the friction are not told apart"));
    }
    if args.print_config.is_some() {
        let config = configured(&settled, &prepared, Precision::F64)?;
        return output::print(&commented_fit(&FitConfig { shooting: Some(shooting_of(&settled)), ..config })?);
    }
    let begin = if resumed.is_some() { Begin::Resume } else { Begin::Anew };
    let folder = match resumed {
        Some(folder) => folder,
        None => {
            let usual = PathBuf::from("runs").join(args.name());
            let start = args.from.as_deref().map(|from| model_file(Path::new(from))).transpose()?;
            let inputs: Vec<&Path> = args.inputs().chain(start.as_deref()).collect();
            let (out, writer) = (args.out.as_deref(), Writer::Learner);
            place::open(&Wanted { out, usual: &usual, overwrite: args.overwrite, inputs: &inputs, writer })?
        }
    };
    perform(&settled, &said, &prepared, begin, &folder).map_err(resume::keeping(folder.path()))
}

/// Fits, prints the result, and says how it ended.
fn perform(
    settled: &Settled,
    said: &Said,
    prepared: &PreparedFit<'_>,
    begin: Begin,
    folder: &Folder,
) -> Result<(), CliError> {
    let args = &settled.args;
    let config = configured(settled, prepared, args.precision().into())?;
    let stop = interrupt::flag().map_err(CliError::signals)?;
    let checkpoints = Checkpoints::new(folder.path(), args.checkpoint_every)
        .beginning(begin)
        .identified_by(said.text(&config.without_files())?);
    let options =
        RunOptions { threads: threads(args.threads), checkpoints: Some(checkpoints), ..RunOptions::default() };
    let fitted = match fit(prepared, &config, &options, folder, &watch(&stop)) {
        Ok(fitted) => fitted,
        // There is no model: after an error nothing is left to go on from.
        Err(error @ (PipelineError::Training(_) | PipelineError::Shooting(_))) => {
            if stop.load(Ordering::SeqCst) {
                let on = how_to_go_on(folder.path());
                return Err(CliError::interrupted(format_args!("interrupted before the first epoch ended{on}")));
            }
            return Err(forget(folder.path()).err().unwrap_or_else(|| error.into()));
        }
        Err(error) => return Err(error.into()),
    };
    if fitted.stop != StopReason::Interrupted {
        forget(folder.path())?;
    }
    if args.json {
        output::print(&fitted.json)?;
    } else {
        output::print(&format!("{}\nreport: {}\n", fitted.text(), folder.file("report.html").display()))?;
    }
    match &fitted.stop {
        StopReason::Finished => Ok(()),
        StopReason::Interrupted => {
            let (place, on) = (folder.path().display(), how_to_go_on(folder.path()));
            Err(CliError::interrupted(format_args!("interrupted, the best model so far is in {place}{on}")))
        }
        StopReason::Failed(error) => Err(CliError::data(format_args!("training stopped: {error}"))),
    }
}

/// Width of the network beside a known part, and its weight decay: small, since what network and constants share is not
/// identifiable and should go to the constants.
const RESIDUAL_WIDTH: usize = 8;
const RESIDUAL_DECAY: f64 = 0.01;

/// The configuration that suits the data, changed by the file, by the model to start from and by the arguments.
fn configured(settled: &Settled, prepared: &PreparedFit<'_>, precision: Precision) -> Result<FitConfig, CliError> {
    let (args, targets) = (&settled.args, prepared.targets());
    let mut suggested = prepared.suggest_training(args.name(), precision)?;
    let start = args.from.as_deref().map(StartModel::read).transpose()?;
    if targets == Targets::Motion && args.changes.epochs.is_none() && !settled.has_epochs() {
        shorten(&mut suggested);
    }
    if args.changes.known.is_some() {
        suggested.network.hidden = vec![RESIDUAL_WIDTH];
        suggested.optimizer.weight_decay = RESIDUAL_DECAY;
    }
    if let Some(start) = &start {
        start.shape(&mut suggested);
    }
    let mut config = settled.training(&suggested)?;
    config.system = args.name().to_string();
    config.from.clone_from(&args.from);
    config.seed = args.seed();
    config.precision = args.precision().into();
    config.network.dissipation = args.friction.or(config.network.dissipation);
    config.network.time_like = args.timelike.clone().or(config.network.time_like);
    if let Some(time) = &args.timelike
        && config.network.structure == Structure::BlackBox
    {
        config.penalty = Regularizer::LorentzianSylvester { lambda: config.penalty.lambda(), time: time.clone() };
    }
    args.changes.apply(&mut config, args.timelike.as_deref(), ", name it by --timelike")?;
    let shooting = (targets == Targets::Motion).then(|| shooting_of(settled));
    Ok(prepared.config(config, args.horizon, columns_of(&args.recording), shooting))
}

/// Multiple shooting by the file and the arguments.
fn shooting_of(settled: &Settled) -> Shooting {
    let default = if settled.args.changes.known.is_some() { Shooting::grey_box() } else { Shooting::default() };
    let mut shooting = settled.shooting().unwrap_or(default);
    shooting.epochs = settled.args.shooting_epochs.unwrap_or(shooting.epochs);
    shooting.samples_per_segment = settled.args.segment.unwrap_or(shooting.samples_per_segment);
    shooting
}
