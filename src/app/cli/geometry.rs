//! `lnn geometry`: metric, connection and curvature of points, full digits.

use crate::cli::format::{CHUNK, TableOrJson, report_failures};
use crate::cli::number::{Precision, count, list};
use crate::cli::source::{Source, SystemOrModel, require_at_most};
use crate::cli::states::parse_table;
use crate::cli::surfaces::Line;
use crate::cli::{CliError, input, output, states, tensors};
use crate::geometry::{GeometryError, MOST_COORDINATES, at_once, geometries};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::scalar::{Dd, Real, Scalar};
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: SystemOrModel,
    /// CSV of points, or - for standard input. Its header has the coordinates, in any order; other columns are ignored.
    #[arg(long, value_name = "FILE.csv", required_unless_present = "surface", conflicts_with = "surface")]
    points: Option<PathBuf>,
    /// Instead of the geometry at points, print the points of a line where the determinant of a block of the metric changes its sign, by
    /// the coordinates of the block. The time finds ergosurfaces and static horizons, the time with the angle about the axis the horizons
    /// of rotating black holes, all coordinates changes of signature.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', requires_all = ["from", "to"])]
    surface: Vec<String>,
    /// Start of the line, in the order of the coordinates.
    #[arg(long, value_name = "Q1,Q2,..", requires = "surface", allow_hyphen_values = true)]
    from: Option<String>,
    /// End of the line.
    #[arg(long, value_name = "Q1,Q2,..", requires = "surface", allow_hyphen_values = true)]
    to: Option<String>,
    /// Pieces of the line, at most 1000000; two changes of sign in one piece are missed.
    #[arg(long, value_name = "N", default_value = "200", requires = "surface", value_parser = pieces)]
    steps: usize,
    /// Velocity at which the mass matrix is taken, in the order of the coordinates. It matters only to Lagrangians that are not
    /// quadratic in the velocities [default: zeros].
    #[arg(long, value_name = "V1,V2,..", allow_hyphen_values = true)]
    velocity: Option<String>,
    /// Precision of everything, the reading of the points included.
    #[arg(long, value_enum, value_name = "TYPE", default_value = "f64")]
    precision: Precision,
    /// One JSON object per line, or text: the nonzero components, without repeating those equal by symmetry.
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "json")]
    format: TableOrJson,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

/// Pieces of a line, at most: seconds of a metric that is written down.
const PIECES: usize = 1_000_000;

/// Reads a number of pieces.
fn pieces(text: &str) -> Result<usize, String> {
    let pieces = count(text).ok().filter(|pieces| *pieces <= PIECES);
    pieces.ok_or_else(|| format!("expected a whole number from 1 to {PIECES}"))
}

/// Prints one object per point, or the surfaces on a line.
///
/// # Errors
/// A usage or data error; after the last point, a data error if the metric of any point is degenerate or not finite.
pub fn run(args: &Args) -> Result<(), CliError> {
    match args.precision {
        Precision::F32 => geometry::<f32>(args),
        Precision::F64 => geometry::<f64>(args),
        Precision::Dd => geometry::<Dd>(args),
    }
}

/// Most coordinates: curvature has `n^4` components.
const MOST: usize = 64;

fn geometry<S: Scalar>(args: &Args) -> Result<(), CliError> {
    let source = args.subject.read(Source::<S>::model, Source::<S>::system)?;
    let n = source.columns.len() / 2;
    require_at_most(MOST, n)?;
    let names = &source.columns[..n];
    let velocity = match &args.velocity {
        Some(text) => list("--velocity", text, names)?,
        None => vec![<S as Real>::zero(); n],
    };
    if let (Some(from), Some(to)) = (&args.from, &args.to) {
        let ends: [Vec<S>; 2] = [list("--from", from, names)?, list("--to", to, names)?];
        note_velocity(&*source.model, &ends[0], &velocity);
        let line = Line { block: &args.surface, ends: (&ends[0], &ends[1]), velocity: &velocity, steps: args.steps };
        return line.print(&source, !args.json && args.format == TableOrJson::Table);
    }
    if n > MOST_COORDINATES {
        return Err(CliError::usage(GeometryError::TooMany { found: n, most: MOST_COORDINATES }));
    }
    let Some(points) = &args.points else { return Err(CliError::usage("--points: expected a file")) };
    let place = input::name(points);
    let refused = |e: &dyn std::fmt::Display| CliError::data(format_args!("{place}: {e}"));
    let bytes = input::read(points, states::MAX_BYTES).map_err(|e| refused(&e))?;
    let table = parse_table::<S>(&bytes, names).map_err(|e| refused(&e))?;
    drop(bytes);
    note_velocity(&*source.model, &table.values[..n], &velocity);

    let chunk = at_once(n).min(CHUNK);
    let mut failures: Vec<(usize, String)> = Vec::new();
    for (points, rows) in table.values.chunks(chunk * n).zip(table.rows.chunks(chunk)) {
        let found = geometries(&*source.model, points, &velocity).map_err(CliError::data)?;
        let mut text = String::new();
        for ((found, q), &row) in found.into_iter().zip(points.chunks(n)).zip(rows) {
            let problem = found.as_ref().err().map(GeometryError::to_string);
            let fields = match &found {
                Ok(found) => tensors::fields(&found.metric.components, Some(found)),
                Err(_) => tensors::fields(&metric(&*source.model, q, &velocity), None),
            };
            text += &match args.format {
                TableOrJson::Json => tensors::object(n, &fields, problem.as_deref()),
                TableOrJson::Table => tensors::block(names, row, &fields, problem.as_deref()),
            };
            failures.extend(problem.map(|problem| (row, problem)));
        }
        output::print(&text)?;
    }
    report_failures(&place, &failures)
}

/// The metric of a point, whatever it is like.
fn metric<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Vec<S> {
    let mut terms = Terms::default();
    // It is filled where it is not finite too.
    let _ = model.terms(q, v, Request::MASS_MATRIX, &mut terms);
    terms.mass_matrix
}

/// Says so if the velocity matters to the metric.
fn note_velocity<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) {
    if varies(model, q, v) {
        output::note("the mass matrix depends on the velocity; it is taken at --velocity, by default at rest");
    }
}

/// `true` if the mass matrix of a point is another one at another velocity, beyond rounding.
fn varies<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> bool {
    let n = q.len();
    let moved = v.iter().enumerate().map(|(i, &v)| v + S::of_f64(0.25 / (i + 1) as f64));
    let both: Vec<S> = v.iter().copied().chain(moved).collect();
    let mut terms = Terms::default();
    if model.terms(&q.repeat(2), &both, Request::MASS_MATRIX, &mut terms).is_err() {
        return false;
    }
    let (first, second) = terms.mass_matrix.split_at(n * n);
    let most = first.iter().map(|x| x.abs().to_f64()).fold(0.0, f64::max);
    let tolerance = most * S::epsilon().to_f64() * 1e4;
    first.iter().zip(second).any(|(&a, &b)| (a - b).abs().to_f64() > tolerance)
}
