//! `lnn inspect --inverse`: computes the forces that cause known accelerations.

use crate::CliError;
use crate::arguments::input;
use crate::arguments::number::index_of;
use crate::arguments::source::Source;
use crate::arguments::states::{column_names, parse_table};
use crate::terminal::format::{Field, Format, Shape, chunk, explain, report_failures, show};
use crate::terminal::{json, output};
use crate::thresholds::MAX_STATES_BYTES;
use lnn::lagrangian::{ForceParts, InverseDynamics, MechanicsError, force_parts_by_rows, inverse_dynamics_by_rows};
use lnn::scalar::Scalar;
use std::path::Path;

/// Prints the forces of every state.
///
/// # Errors
/// A usage or data error; after the last state, a data error if the forces of any state are not finite.
pub fn inverse<S: Scalar>(path: &Path, format: Format, source: &Source<S>, drives: &[String]) -> Result<(), CliError> {
    let n = source.columns.len() / 2;
    let drives = drives.iter().map(|name| index_of("--drives", "coordinate", name, &source.columns[..n]));
    let drives = drives.collect::<Result<Vec<usize>, CliError>>()?;
    let accelerations = source.columns[..n].iter().map(|name| format!("{name}_ddot"));
    let mut columns: Vec<String> = source.columns.iter().cloned().chain(accelerations).collect();
    let refused = |e: &dyn std::fmt::Display| CliError::input(path, e);
    let bytes = input::read(path, MAX_STATES_BYTES)?;
    let header = column_names(&bytes).map_err(|e| refused(&e))?;
    // The time of a row is printed with its forces, unless t is a coordinate; a system may depend on it.
    let has_time = !columns.iter().any(|name| name == "t") && header.iter().any(|c| c == "t");
    let timed = source.model.is_timed() || (format == Format::Csv && has_time);
    if timed {
        columns.push("t".to_string());
    }
    let table = parse_table::<S>(&bytes, &columns).map_err(|e| refused(&e))?;
    drop(bytes);
    if format == Format::Csv {
        let time = if timed { "t," } else { "" };
        output::print(&format!("{time}{}\n", source.forces.join(",")))?;
    }
    let width = columns.len();
    let mut failures: Vec<(usize, String)> = Vec::new();
    let size = chunk(n);
    for (values, rows) in table.values.chunks(size * width).zip(table.rows.chunks(size)) {
        let part = |range: std::ops::Range<usize>| -> Vec<S> {
            values.chunks_exact(width).flat_map(|row| row[range.clone()].iter().copied()).collect()
        };
        let (q, v, a) = (part(0..n), part(n..2 * n), part(2 * n..3 * n));
        let times: Vec<S> = if timed { part(3 * n..3 * n + 1) } else { Vec::new() };
        let (forces, failed) =
            inverse_dynamics_by_rows(source.model.as_ref(), &drives, [&q, &v, &a], &times).map_err(|e| match e {
                MechanicsError::Drives { .. } => CliError::usage(format_args!("--{e}")),
                e => refused(&e),
            })?;
        let parts = match format {
            Format::Csv => None,
            _ => Some(force_parts_by_rows(source.model.as_ref(), [&q, &v, &a], &times).map_err(|e| refused(&e))?.0),
        };
        let mut failed = failed.into_iter().peekable();
        let mut text = String::new();
        for (k, &row) in rows.iter().enumerate() {
            let problem = failed.next_if(|failure| failure.row() == Some(k)).map(|failure| match failure {
                MechanicsError::OffConstraints { constraint, distance, .. } => {
                    let names = source.model.manifold().map_or(&[][..], |manifold| manifold.names());
                    let name = names.get(constraint).map_or("?", String::as_str);
                    format!("the acceleration is {distance:.3e} away from what the constraints allow, most by `{name}`")
                }
                other => explain(other),
            });
            text += &line(format, row, n, k, (&forces, parts.as_ref()), times.get(k), problem.as_deref());
            failures.extend(problem.map(|problem| (row, problem)));
        }
        output::print(&text)?;
    }
    report_failures(path, &failures)
}

/// Formats the forces on state `k` of a batch.
fn line<S: Scalar>(
    format: Format,
    row: usize,
    n: usize,
    k: usize,
    (forces, parts): (&InverseDynamics<S>, Option<&ForceParts<S>>),
    time: Option<&S>,
    problem: Option<&str>,
) -> String {
    let part = |values: &'_ [S]| -> Vec<S> { values.get(k * n..(k + 1) * n).unwrap_or(&[]).to_vec() };
    let (all, friction, external) = (part(&forces.generalized), part(&forces.friction), part(&forces.external));
    if format == Format::Csv {
        let numbers =
            time.into_iter().chain(&external).map(|x| if x.is_finite() { json::number(*x) } else { "nan".into() });
        return numbers.collect::<Vec<_>>().join(",") + "\n";
    }
    let vector = |name, values| Field { name, values, shape: Shape::Vector };
    let mut fields = vec![vector("generalized_force", &all[..]), vector("external_force", &external)];
    if !friction.is_empty() {
        fields.insert(1, vector("friction", &friction));
    }
    let (held, m) = (part(&forces.constraint), forces.multipliers.len() * n / forces.external.len().max(1));
    if m > 0 {
        let multipliers = &forces.multipliers[k * m..(k + 1) * m];
        fields.extend([vector("constraint_force", &held), vector("multipliers", multipliers)]);
    }
    let split = parts.map(|parts| [&parts.inertial, &parts.coriolis, &parts.gravity].map(|values| part(values)));
    if let Some([inertial, coriolis, gravity]) = &split {
        let split = [("inertial_force", inertial), ("coriolis_force", coriolis), ("gravity_force", gravity)];
        fields.extend(split.map(|(name, values)| vector(name, values)));
    }
    show(format, row, &fields, problem)
}
