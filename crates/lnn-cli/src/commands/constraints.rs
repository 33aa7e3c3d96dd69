//! `lnn constraints`: constraints of recorded motion, or constraints and degenerate directions of a Lagrangian.

use crate::CliError;
use crate::arguments::number::whole;
use crate::arguments::probe::Probe;
use crate::arguments::recording_args::{RecordingArgs, data_or};
use crate::directories::files::{OutputFile, ends_in};
use crate::terminal::output;
use crate::terminal::result_page::PageArgs;
use crate::terminal::watch::search;
use lnn::constraints::{
    ConstraintSearch, ConstraintSearchError, EXAMINED_STATES, ExaminedLagrangian, FoundConstraints, MotionSamples,
    examine,
};
use lnn::recording::SmoothOptions;
use lnn::report::found_constraint_figures;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(mut_args(data_or(
    "DATA|MODEL|SYSTEM",
    "Files of recorded motion, with --coords as for lnn check; or, without --coords, one trained model or system (name or file), \
     to list its constraints and degenerate directions",
)))]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// Largest total degree of the functions of the coordinates; angles enter by sine and cosine.
    #[arg(long, value_name = "N", default_value = "2", value_parser = whole(1, ConstraintSearch::MOST_DEGREE))]
    degree: usize,
    /// Largest total degree of the coefficients of the velocities.
    #[arg(long, value_name = "N", default_value = "1", value_parser = whole(0, ConstraintSearch::MOST_DEGREE))]
    velocity_degree: usize,
    /// Write the table [constraints] to this file; system files and roll-outs take it.
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    #[command(flatten)]
    page: PageArgs,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// `true` for a file that is neither a model nor a system.
fn is_data(path: &Path) -> bool {
    path.is_file() && !ends_in(path, &["toml", "safetensors"])
}

/// Finds constraints and prints them.
///
/// # Errors
/// A usage error for arguments, a data error for data or a model that cannot be used, or a file that cannot be written.
pub fn run(args: &Args) -> Result<(), CliError> {
    if let ([one], []) = (args.recording.data.as_slice(), args.recording.coords.as_slice())
        && !is_data(one)
    {
        return examined(&one.to_string_lossy(), args);
    }
    let files = args.page.files(args.out.as_deref(), &args.recording.inputs(), OutputFile::claim)?;
    let recording = args.recording.read()?.0.recording;
    let samples = MotionSamples::of(&recording, &SmoothOptions::default()).map_err(CliError::data)?.watched(&search()?);
    let wanted = ConstraintSearch { degree: args.degree, velocity_degree: args.velocity_degree };
    let found = FoundConstraints::of(&samples, wanted).map_err(|error| match error {
        ConstraintSearchError::Cancelled(_) => CliError::nothing_written(),
        error => CliError::data(error),
    })?;
    if let Some(out) = &files.out {
        let nothing = "--out: no constraint was found within the noise: there is nothing to write";
        out.write(found.system_table()?.ok_or_else(|| CliError::data(nothing))?.as_bytes())?;
    }
    let figures = found_constraint_figures(&found, &samples);
    files.write_page("Constraints of recorded motion", &found.findings(), &figures)?;
    files.print(&output::shown(&found, args.json, FoundConstraints::findings)?)
}

/// Analyses a system or a model, and prints its constraints and degenerate directions.
fn examined(name: &str, args: &Args) -> Result<(), CliError> {
    if args.out.is_some() {
        return Err(CliError::usage("--out needs recorded motion; a system already lists its constraints in its file"));
    }
    let probe = Probe::with_constraints(name)?;
    let (q, v) = probe.states(EXAMINED_STATES, 0)?;
    let n = probe.model.coordinates();
    let about = (probe.name.as_str(), &probe.columns[..n]);
    let examined = examine(about, probe.model.as_ref(), &probe.constraints, (&q, &v));
    if examined.states == 0 {
        return Err(CliError::data(format_args!("{}: the mass matrix is not finite at any sampled state", probe.name)));
    }
    let files = args.page.files(None, &[Path::new(name)], OutputFile::claim)?;
    files.write_page("Constraints of a Lagrangian", &examined.findings(), &[])?;
    files.print(&output::shown(&examined, args.json, ExaminedLagrangian::findings)?)
}
