//! What several studies set up.

use crate::Outcome;
use lnn::cli::parse_system;
use lnn::lagrangian::{SystemInstance, configure_system};
use std::borrow::Cow;

/// The system of a file's text, TOML, with these values of its parameters and the usual ones of the others.
pub fn configured(text: &str, given: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
    let system = parse_system(text).map_err(|(line, problem)| format!("{line}: {problem}"))?;
    let given: Vec<(String, String)> = given.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
    Ok(configure_system(Cow::Owned(system), &given)?)
}
