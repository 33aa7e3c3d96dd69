//! The page of a result: what the terminal prints, as HTML with pictures.

use crate::CliError;
use crate::directories::files::OutputFile;
use lnn::findings::Findings;
use lnn::report::{Figure, Report};
use std::path::{Path, PathBuf};

/// Where the page goes.
#[derive(Clone, Debug, clap::Args)]
pub struct PageArgs {
    /// Also write the report as a self-contained HTML page, with pictures where there are some.
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Replace existing files.
    #[arg(long)]
    pub overwrite: bool,
}

impl PageArgs {
    /// The file, checked to be free, if one was requested.
    ///
    /// # Errors
    /// Those of [`OutputFile::claim`].
    pub fn claim<'a>(&'a self, inputs: &[&Path]) -> Result<Option<OutputFile<'a>>, CliError> {
        self.html.as_deref().map(|html| OutputFile::claim(html, inputs, self.overwrite)).transpose()
    }
}

/// Writes the page of a report.
///
/// # Errors
/// Those of [`OutputFile::write`].
pub fn write(
    page: Option<OutputFile<'_>>,
    title: &str,
    findings: &Findings,
    figures: &[Figure],
) -> Result<(), CliError> {
    let Some(page) = page else { return Ok(()) };
    let report = Report::new(title).findings(findings).section("Pictures", figures);
    page.write(report.to_html().as_bytes())
}
