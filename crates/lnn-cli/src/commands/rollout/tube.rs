//! `--tube` of `lnn rollout`: a tube around the predicted motion that contains a given share of whole motions.

use crate::CliError;
use crate::arguments::config::parse;
use crate::arguments::input;
use crate::arguments::learned::model_file;
use crate::arguments::number::{number, threads};
use crate::arguments::recording_args::read;
use lnn::analysis::{MotionTube, Tube, TubeError, Window, predict_by_motion};
use lnn::lagrangian::EulerLagrange;
use lnn::pipeline::{FitConfig, FitOptions, MAX_RESULT_BYTES, PreparedFit};
use lnn::storage::read_regular;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct TubeArgs {
    /// A tube around the coordinates that holds this share of whole motions, estimated from the errors on motion that the model has not
    /// seen: what `lnn fit` held out, or --tube-data. The CSV has two more columns per coordinate, NAME_low and
    /// NAME_high.
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true, requires = "model", value_parser = number(0.01, 0.999))]
    tube: Option<f64>,
    /// Recordings of other motions from which the tube is estimated, with the columns of the data that the model was fitted to.
    #[arg(long, value_name = "DATA,..", value_delimiter = ',', requires = "tube")]
    tube_data: Vec<PathBuf>,
}

impl TubeArgs {
    /// Files that are read.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.tube_data.iter().map(PathBuf::as_path)
    }

    /// The tube of a model for motions from one time to another; none if none was requested.
    ///
    /// # Errors
    /// A usage error for a system or a motion that runs backwards, a data error for a model without the configuration of a fit beside it, for
    /// recordings that cannot be read, and for too few whole motions.
    pub fn tube(
        &self,
        (model, path): (&dyn EulerLagrange<f64>, Option<&Path>),
        coordinates: &[String],
        (start, end): (f64, f64),
    ) -> Result<Option<MotionTube>, CliError> {
        let Some(share) = self.tube else { return Ok(None) };
        let Some(path) = path else {
            let problem =
                "the motion of a system is exact; expected a model that lnn fit learned, whose errors are known";
            return Err(CliError::usage(format_args!("--tube: {problem}")));
        };
        if end <= start {
            return Err(CliError::usage("--tube: the motion runs backwards; expected a later --t-end"));
        }
        let windows = self.windows(path, coordinates, end - start)?;
        let predictions = predict_by_motion(model, &windows, threads(None));
        let tube = Tube::new(&windows, &predictions, coordinates.len(), share).map_err(|error| match error {
            TubeError::TooFewWindows { found, needed } => CliError::data(format_args!(
                "--tube {share}: expected at least {needed} whole motions of {} s that the model has not learned from, found {found}; \
                 give more with --tube-data",
                end - start
            )),
            error => CliError::data(format_args!("--tube {share}: {error}")),
        })?;
        Ok(Some(MotionTube::new(tube, start, coordinates.to_vec())))
    }

    /// Beginnings of all motions that were not used for training and last at least `seconds`.
    fn windows(&self, path: &Path, coordinates: &[String], seconds: f64) -> Result<Vec<Window>, CliError> {
        let place = model_file(path)?.with_file_name("config.toml");
        let text = read_regular(&place, MAX_RESULT_BYTES).map_err(|e| {
            CliError::file(&place, format_args!("--tube needs the configuration of the fit beside the model: {e}"))
        })?;
        let config: FitConfig = parse(&String::from_utf8_lossy(&text))
            .map_err(|(line, problem)| CliError::file(&place, format_args!("line {line}: {problem}")))?;
        if config.recording.coords != coordinates {
            let (expected, found) = (coordinates.join(","), config.recording.coords.join(","));
            return Err(CliError::file(&place, format_args!("coords: expected {expected}, found {found}")));
        }
        let files: Vec<PathBuf> = match self.tube_data.is_empty() {
            true => config.recording.files.iter().map(PathBuf::from).collect(),
            false => self.tube_data.clone(),
        };
        if files.iter().any(|file| input::is_standard(file)) {
            return Err(CliError::usage("--tube-data: expected files, not standard input"));
        }
        let reading = read(&files, &config.recording.meaning())?;
        let mut options = FitOptions::from(&config);
        if !self.tube_data.is_empty() {
            options.held_out = 0.0;
        }
        let measured = PreparedFit::new(&reading, &options).map_err(CliError::data)?.measured;
        Ok(Window::beginnings(if self.tube_data.is_empty() { &measured.test } else { &measured.training }, seconds))
    }
}
