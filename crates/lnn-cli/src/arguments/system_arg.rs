//! The system of a command: from the catalogue by name, or from a file.

use crate::CliError;
use crate::arguments::config;
use crate::directories::files::ends_in;
use crate::terminal::output;
use crate::thresholds::MAX_ROBOT_BYTES;
use lnn::lagrangian::system::System;
use lnn::lagrangian::{SystemInstance, resolve};
use lnn::network::file::Header;
use lnn::pipeline::{is_robot, parse_robot, parse_system};
use std::borrow::Cow;
use std::path::Path;

/// `true` if an argument is the file of a system, not a name of the catalogue.
pub fn is_file(system: &str) -> bool {
    is_robot(Path::new(system)) || ends_in(Path::new(system), &["toml"])
}

/// Finds a system by name, or reads it from a file that ends in `.toml`, or in `.urdf` or `.xml` for a robot.
///
/// # Errors
/// A usage error for an unknown name and for a mistake in a file, a data error for a file that cannot be read.
pub fn system(system: &str) -> Result<Cow<'static, System>, CliError> {
    let path = Path::new(system);
    if is_robot(path) {
        let (system, notes) = from_robot(path, parse_robot)?;
        notes.iter().for_each(|note| output::note(&format!("{}: {note}", path.display())));
        return Ok(Cow::Owned(system));
    }
    if is_file(system) {
        let (name, text) = config::read_text(path)?;
        let refused = |(line, problem)| CliError::usage(format_args!("{name}:{line}: {problem}"));
        return parse_system(&text).map(Cow::Owned).map_err(refused);
    }
    resolve(system).map_err(|error| {
        let file = if Path::new(system).is_file() {
            "; a file of a system ends in .toml, of a robot in .urdf or .xml"
        } else {
            ""
        };
        CliError::usage(format_args!("{error}{file}"))
    })
}

/// Applies `make` to the text of a robot file.
///
/// # Errors
/// A usage error with file and line, a data error for a file that cannot be read.
pub fn from_robot<T>(path: &Path, make: impl FnOnce(&str) -> Result<T, (usize, String)>) -> Result<T, CliError> {
    let (name, text) = config::read_text_within(path, MAX_ROBOT_BYTES)?;
    make(&text).map_err(|(line, problem)| CliError::usage(format_args!("{name}:{line}: {problem}")))
}

/// The system that a model learned, if it is known; a recorded system is not.
///
/// # Errors
/// A description that has no system, or a name that the catalogue does not have.
pub fn learned_system(header: &Header) -> Result<Cow<'static, System>, String> {
    match &header.description {
        Some(description) => description.system().map(Cow::Owned).map_err(|error| error.to_string()),
        None => System::named(&header.system).map(Cow::Borrowed).map_err(|error| error.to_string()),
    }
}

/// Prints a note that a model does not learn the impacts of a system.
pub fn note_impacts(system: &SystemInstance<f64>) {
    let events = system.events();
    let impacts = events.iter().filter(|given| given.event.is_impact()).map(|given| format!("`{}`", given.event.name));
    let names = impacts.collect::<Vec<_>>().join(", ");
    if !names.is_empty() {
        output::note(&format!(
            "impacts ({names}) are not learned, only the motion between them; cut recordings where one happens"
        ));
    }
}
