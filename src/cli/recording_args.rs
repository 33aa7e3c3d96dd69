//! stub
use crate::cli::CliError;
use crate::recording::Reading;
#[derive(Debug, clap::Args)]
pub struct RecordingArgs {
    #[arg(required = true)]
    data: Vec<std::path::PathBuf>,
}
impl RecordingArgs {
    pub fn read(&self) -> Result<Reading, CliError> {
        Err(CliError::data("stub"))
    }
}
