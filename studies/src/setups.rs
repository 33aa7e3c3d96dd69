//! What several studies set up.

use crate::Outcome;
use lnn::lagrangian::SystemInstance;
use lnn::pipeline::parse_system;
use lnn_cli::CliError;
use std::borrow::Cow;
use std::path::Path;

/// The system of a file's text, TOML, with these values of its parameters and the usual ones of the others.
pub fn configured(text: &str, given: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
    let system = parse_system(text).map_err(|(line, problem)| format!("{line}: {problem}"))?;
    let given: Vec<(String, String)> = given.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
    Ok(SystemInstance::new(Cow::Owned(system), &given)?)
}

/// The system of the catalogue of a name, or that of a file whose name ends in `.toml`, with these values of its parameters.
///
/// # Errors
/// A usage error for an unknown name, a wrong parameter and a mistake in a file, a data error for a file that cannot be read.
pub fn named(system: &str, given: &[(String, String)]) -> Result<SystemInstance<f64>, CliError> {
    let path = Path::new(system);
    if path.extension().is_none_or(|end| !end.eq_ignore_ascii_case("toml")) {
        return SystemInstance::named(system, given).map_err(CliError::usage);
    }
    let text = std::fs::read_to_string(path).map_err(|error| CliError::file(path, error))?;
    let refused = |(line, problem)| CliError::usage(format_args!("{system}:{line}: {problem}"));
    SystemInstance::new(Cow::Owned(parse_system(&text).map_err(refused)?), given).map_err(CliError::usage)
}
