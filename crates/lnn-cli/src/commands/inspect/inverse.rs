//! `lnn inspect --inverse`: computes the forces that cause known accelerations.

use crate::CliError;
use crate::arguments::input;
use crate::arguments::number::indices_of;
use crate::arguments::source::Source;
use crate::terminal::format::{Format, chunk, print_rows};
use crate::terminal::output;
use crate::thresholds::MAX_STATES_BYTES;
use lnn::analysis::StateReporter;
use lnn::lagrangian::MechanicsError;
use lnn::recording::NumberTable;
use lnn::scalar::Scalar;
use std::path::Path;

/// Prints the forces of every state.
///
/// # Errors
/// A usage or data error; after the last state, a data error if the forces of any state are not finite.
pub fn inverse<S: Scalar>(file: &Path, format: Format, source: &Source<S>, drives: &[String]) -> Result<(), CliError> {
    let n = source.columns.len() / 2;
    let drives = indices_of("--drives", "coordinate", drives, &source.columns[..n])?;
    let accelerations = source.columns[..n].iter().map(|name| format!("{name}_ddot"));
    let mut columns: Vec<String> = source.columns.iter().cloned().chain(accelerations).collect();
    let bytes = input::read(file, MAX_STATES_BYTES)?;
    let header = NumberTable::<S>::names(&bytes).map_err(|e| CliError::input(file, e))?;
    let is_csv = format == Format::Csv;
    // The time of a row is printed with its forces, unless t is a coordinate; a system may depend on it.
    let has_time = !columns.iter().any(|name| name == "t") && header.iter().any(|name| name == "t");
    let is_timed = source.model.is_timed() || (is_csv && has_time);
    if is_timed {
        columns.push("t".to_string());
    }
    let table = NumberTable::<S>::read(&bytes, &columns).map_err(|e| CliError::input(file, e))?;
    drop(bytes);
    if is_csv {
        let time = if is_timed { "t," } else { "" };
        output::print(&format!("{time}{}\n", source.forces.join(",")))?;
    }
    let reporter = StateReporter::new(source.model.as_ref(), false, None);
    print_rows(file, &table.rows, chunk(n), |places| {
        let part = |columns| table.part(places.clone(), columns);
        let (q, v, a, times) = (part(0..n), part(n..2 * n), part(2 * n..3 * n), part(3 * n..columns.len()));
        let reports = reporter.forces(&drives, [&q, &v, &a], &times, !is_csv).map_err(|error| match error {
            MechanicsError::Drives { .. } => CliError::usage(format_args!("--{error}")),
            error => CliError::input(file, error),
        })?;
        let rows = reports.into_iter().zip(&table.rows[places.clone()]).enumerate();
        let text = rows.map(|(k, (report, row))| match is_csv {
            true => (report.external_forces(times.get(k).copied()), report.problem),
            false => (format.state(*row, &report), report.problem),
        });
        Ok(text.collect())
    })
}
