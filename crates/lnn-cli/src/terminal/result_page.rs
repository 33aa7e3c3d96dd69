//! The files of a result: the one that `--out` names, and the page, which shows what the terminal prints, as HTML with pictures.

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
    /// Claims the files of a result of these inputs, as far as they were requested: that of `--out` by `claim`, such as
    /// [`OutputFile::claim_system`], then the page.
    ///
    /// # Errors
    /// Those of `claim` and of [`OutputFile::claim`].
    pub fn files<'a>(
        &'a self,
        out: Option<&'a Path>,
        inputs: &[&Path],
        claim: impl FnOnce(&'a Path, &[&Path], bool) -> Result<OutputFile<'a>, CliError>,
    ) -> Result<ResultFiles<'a>, CliError> {
        let out = out.map(|out| claim(out, inputs, self.overwrite)).transpose()?;
        let page = self.html.as_deref().map(|html| OutputFile::claim(html, inputs, self.overwrite)).transpose()?;
        Ok(ResultFiles { out, page })
    }
}

/// The files of a result, checked to be free before the work.
pub struct ResultFiles<'a> {
    /// The file of `--out`.
    pub out: Option<OutputFile<'a>>,
    page: Option<OutputFile<'a>>,
}

impl ResultFiles<'_> {
    /// Writes the page of a result with its figures.
    ///
    /// # Errors
    /// Those of [`OutputFile::write`].
    pub fn write_page(&self, title: &str, findings: &Findings, figures: &[Figure]) -> Result<(), CliError> {
        let Some(page) = &self.page else { return Ok(()) };
        let report = Report::new(title).findings(findings).section("Pictures", figures);
        page.write(report.to_html().as_bytes())
    }

    /// Prints the result.
    ///
    /// # Errors
    /// Those of [`OutputFile::print`].
    pub fn print(self, text: &str) -> Result<(), CliError> {
        OutputFile::print(self.out, text)
    }
}
