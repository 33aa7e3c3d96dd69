//! The files that a roll-out writes.

use crate::CliError;
use crate::arguments::input::is_standard;
use crate::arguments::motion_source::MotionSource;
use crate::directories::files::{OutputFile, cannot_write, ends_in, file_ending, require_free};
use crate::terminal::output;
use lnn::analysis::MotionTube;
use lnn::lagrangian::EulerLagrange;
use lnn::report::{EventTable, MotionRecord, MotionTexts};
use lnn::storage::write_atomically;
use lnn::symmetry::Invariant;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct FileArgs {
    /// CSV of the trajectory: t, the columns of a state, energy, measured quantities of the system; - for standard output. An existing file is
    /// replaced only with --overwrite, the file of the model never.
    #[arg(long, value_name = "FILE.csv")]
    pub out: PathBuf,
    /// Plot of the coordinates against time, a panel for each unit, with the path in the plane of polar ones, or a page that
    /// also shows velocities and energy.
    #[arg(long, value_name = "FILE.svg|FILE.html", value_parser = file_ending(&EXTENSIONS))]
    plot: Option<PathBuf>,
    /// CSV of the events of the system: name, t, state, and the energies of impacts.
    #[arg(long, value_name = "FILE.csv")]
    pub events: Option<PathBuf>,
    /// Replace the files.
    #[arg(long)]
    overwrite: bool,
}

/// Extensions of picture files; all but the first belong to HTML pages.
const EXTENSIONS: [&str; 3] = ["svg", "html", "htm"];

impl FileArgs {
    /// Rejects overwriting existing files or inputs.
    ///
    /// # Errors
    /// A usage error for two options with the same file, a data error naming the file.
    pub fn require_room(&self, inputs: &[&Path]) -> Result<(), CliError> {
        if !is_standard(&self.out) {
            require_free(&self.out, inputs, self.overwrite)?;
        }
        let beside = [("--plot", &self.plot), ("--events", &self.events)];
        for (option, file) in beside.iter().filter_map(|(option, file)| Some((option, file.as_ref()?))) {
            if *file == self.out || (self.plot == self.events && *option == "--events") {
                return Err(CliError::usage(format_args!("{option}: another option already writes to this file")));
            }
            OutputFile::claim(file, inputs, self.overwrite)?;
        }
        Ok(())
    }

    /// Writes the events, if that is requested.
    ///
    /// # Errors
    /// A data error naming the file.
    pub fn write_events(&self, events: Option<&EventTable>) -> Result<(), CliError> {
        let (Some(file), Some(events)) = (&self.events, events) else { return Ok(()) };
        OutputFile::claim(file, &[], self.overwrite)?.write(events.table.to_csv().as_bytes())
    }

    /// Draws the motion, if that is requested.
    ///
    /// # Errors
    /// A data error for a motion that has no finite sample, or a file that cannot be written.
    pub fn draw(
        &self,
        record: &MotionRecord,
        (source, model): (&MotionSource, &dyn EulerLagrange<f64>),
        tube: Option<&MotionTube>,
    ) -> Result<(), CliError> {
        let Some(file) = &self.plot else { return Ok(()) };
        let (title, parameter) = (format!("{}: roll-out", source.name), source.parameter());
        let energy = record.invariant(model).map_or("energy", Invariant::charge);
        let texts = &MotionTexts { title: &title, parameter: &parameter, energy, units: &source.units };
        let is_page = ends_in(file, &EXTENSIONS[1..]);
        let drawn = if is_page { record.to_html(texts, tube) } else { record.to_svg(texts, tube) };
        write_atomically(file, drawn.map_err(CliError::data)?.as_bytes()).map_err(|e| cannot_write(file, e))
    }

    /// Prints a text: on standard error if the samples go to standard output.
    ///
    /// # Errors
    /// A closed pipe.
    pub fn print(&self, text: &str) -> Result<(), CliError> {
        if is_standard(&self.out) {
            text.lines().for_each(output::note);
            return Ok(());
        }
        output::print(text)
    }
}
