//! Constraints from the table `[constraints]` of a file, as an argument.

use crate::CliError;
use crate::arguments::config;
use lnn::lagrangian::{EulerLagrange, FormulaConstraints};
use lnn::scalar::Scalar;
use std::collections::BTreeMap;
use std::path::Path;

/// The table [constraints] of a file.
///
/// # Errors
/// A usage error for a file without such a table, a data error for one that cannot be read.
pub fn formulas(file: &Path) -> Result<BTreeMap<String, String>, CliError> {
    let (name, text) = config::read_text(file)?;
    config::constraints(&text).map_err(|(line, problem)| match line {
        Some(line) => CliError::usage(format_args!("{name}:{line}: {problem}")),
        None => CliError::usage(format_args!("{name}: {problem}")),
    })
}

/// Line numbers of the constraints of a file, by name.
fn lines(file: &Path) -> Result<impl Fn(&str) -> usize, CliError> {
    let lines = config::lines(&config::read_text(file)?.1);
    Ok(move |name: &str| lines.get(&format!("constraints.{name}")).copied().unwrap_or(usize::MAX))
}

/// Constrains the model by a file's table, as far as the constraints are independent at some states.
///
/// # Errors
/// A usage error for a file without such a table or a mistake in a formula, constraints that contradict each other, or a model that has
/// constraints of its own.
pub fn constrained<S: Scalar>(
    model: Box<dyn EulerLagrange<S>>,
    columns: &[String],
    file: &Path,
    (q, v): (&[S], &[S]),
) -> Result<Box<dyn EulerLagrange<S>>, CliError> {
    let wrong = |problem: &dyn std::fmt::Display| CliError::usage(format_args!("{}: {problem}", file.display()));
    let formulas = formulas(file)?;
    if model.manifold().is_some() {
        return Err(wrong(&"the motion has constraints of its own"));
    }
    let plain = |values: &[S]| values.iter().map(|x| x.to_f64()).collect::<Vec<f64>>();
    let constraints =
        FormulaConstraints::new(&columns[..columns.len() / 2], formulas).map_err(|error| wrong(&error))?;
    let constraints = constraints.in_order(lines(file)?);
    let (constraints, _) = constraints.independent(&plain(q), &plain(v)).map_err(|error| wrong(&error))?;
    constraints.constrain(model).map_err(|error| wrong(&error))
}
