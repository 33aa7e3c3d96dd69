//! `lnn page`: writes a model as an interactive page.

use crate::CliError;
use crate::arguments::input::place;
use crate::arguments::learned::{Learned, model_file};
use crate::directories::files::OutputFile;
use lnn::report::page;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Model, a file or the directory of a run.
    model: PathBuf,
    /// Page: one HTML file that needs no internet; - is standard output.
    #[arg(long, value_name = "FILE.html")]
    out: PathBuf,
    /// Replace the file.
    #[arg(long)]
    overwrite: bool,
}

/// Writes the page.
///
/// # Errors
/// A data error for a bad model, one that is too large for a page, or a file that cannot be written.
pub fn run(args: &Args) -> Result<(), CliError> {
    let path = model_file(&args.model)?;
    let out = OutputFile::claim(&args.out, &[&path], args.overwrite)?;
    let learned = Learned::<f64>::load(&path)?;
    // For recorded motion, no exact system is known.
    let system = learned.system(&path).ok();
    let text = page(&learned.header, &learned.network, system.as_ref()).map_err(|e| CliError::file(&path, e))?;
    out.write(text.as_bytes())?;
    OutputFile::print(Some(out), &format!("{}: {} kB\n", place(&args.out), text.len().div_ceil(1000)))
}
