//! `lnn geometry`: metric, connection and curvature of points.

use crate::CliError;
use crate::arguments::input;
use crate::arguments::number::{Precision, list, named, whole};
use crate::arguments::source::{Source, SystemOrModel, require_at_most};
use crate::arguments::states::{Table, parse_table};
use crate::terminal::format::report_failures;
use crate::terminal::output;
use crate::thresholds::{MAX_STATES_BYTES, MOST_METRIC_COORDINATES, MOST_PIECES, ROWS_AT_ONCE};
use lnn::geometry::{GeometryError, MOST_COORDINATES, PointReport, at_once, depends_on_velocity, point_reports};
use lnn::lagrangian::EulerLagrange;
use lnn::names::trimmed;
use lnn::scalar::{Dd, Real, Scalar};
use std::path::{Path, PathBuf};
use surfaces::Line;

mod surfaces;
mod tensors;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: SystemOrModel,
    /// A point, by a number or a formula of numbers for every coordinate, in any order: t=0,r=4,theta=pi/2,phi=0.
    #[arg(long, value_name = "NAME=VALUE,..", allow_hyphen_values = true, conflicts_with_all = ["surface", "points"])]
    at: Option<String>,
    /// CSV of points, or - for standard input. Its header has the coordinates, in any order; other columns are ignored.
    #[arg(long, value_name = "FILE.csv", required_unless_present_any = ["surface", "at"], conflicts_with = "surface")]
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
    #[arg(long, value_name = "N", default_value = "200", requires = "surface", value_parser = whole(1, MOST_PIECES))]
    steps: usize,
    /// Velocity at which the mass matrix is taken, in the order of the coordinates. It matters only to Lagrangians that are not
    /// quadratic in the velocities [default: zeros].
    #[arg(long, value_name = "V1,V2,..", allow_hyphen_values = true)]
    velocity: Option<String>,
    /// Precision of all arithmetic, including the reading of the points.
    #[arg(long, value_enum, value_name = "TYPE", default_value = "f64")]
    precision: Precision,
    /// One JSON object per line with every component and digit; or the nonzero components, without those that follow by symmetry, as a
    /// table or as LaTeX [default: json with --points, otherwise table].
    #[arg(long, value_enum, value_name = "FORMAT")]
    format: Option<Format>,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

/// Form of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// One object per line.
    Json,
    /// Text.
    Table,
    /// An align* environment.
    Latex,
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

fn geometry<S: Scalar>(args: &Args) -> Result<(), CliError> {
    let source = args.subject.read(Source::<S>::model, Source::<S>::system)?;
    let n = source.columns.len() / 2;
    require_at_most(MOST_METRIC_COORDINATES, n)?;
    let names = &source.columns[..n];
    let velocity = match &args.velocity {
        Some(text) => list("--velocity", text, names)?,
        None => vec![<S as Real>::zero(); n],
    };
    let usual = if args.points.is_some() { Format::Json } else { Format::Table };
    let format = if args.json { Format::Json } else { args.format.unwrap_or(usual) };
    if let (Some(from), Some(to)) = (&args.from, &args.to) {
        if format == Format::Latex {
            return Err(CliError::usage("--format latex: expected json or table with --surface"));
        }
        let ends: [Vec<S>; 2] = [list("--from", from, names)?, list("--to", to, names)?];
        note_velocity(&*source.model, &ends[0], &velocity);
        let line = Line { block: &args.surface, ends: (&ends[0], &ends[1]), velocity: &velocity, steps: args.steps };
        return line.print(&source, format == Format::Table);
    }
    if n > MOST_COORDINATES {
        return Err(CliError::usage(GeometryError::TooMany { found: n, most: MOST_COORDINATES }));
    }
    if let Some(text) = &args.at {
        let point = named("--at", text, names)?;
        note_velocity(&*source.model, &point, &velocity);
        let report = point_reports(&*source.model, names, &point, &velocity).map_err(CliError::data)?.remove(0);
        output::print(&written(format, &report, &heading(names, &point)))?;
        return report.problem.map_or(Ok(()), |problem| Err(CliError::data(format_args!("--at: {problem}"))));
    }
    let Some(points) = &args.points else { return Err(CliError::usage("--points: expected a file")) };
    print_points(points, &*source.model, (names, &velocity), format)
}

/// Prints the geometry of the points of a file.
fn print_points<S: Scalar>(
    file: &Path,
    model: &dyn EulerLagrange<S>,
    (names, velocity): (&[String], &[S]),
    format: Format,
) -> Result<(), CliError> {
    let n = names.len();
    let bytes = input::read(file, MAX_STATES_BYTES)?;
    let Table { values, rows } = parse_table::<S>(&bytes, names).map_err(|e| CliError::input(file, e))?;
    drop(bytes);
    note_velocity(model, &values[..n], velocity);
    let chunk = at_once(n).min(ROWS_AT_ONCE);
    let mut failures: Vec<(usize, String)> = Vec::new();
    for (points, rows) in values.chunks(chunk * n).zip(rows.chunks(chunk)) {
        let reports = point_reports(model, names, points, velocity).map_err(CliError::data)?;
        let mut text = String::new();
        for ((report, q), &row) in reports.into_iter().zip(points.chunks(n)).zip(rows) {
            text += &written(format, &report, &format!("row {row}: {}", heading(names, q)));
            failures.extend(report.problem.map(|problem| (row, problem)));
        }
        output::print(&text)?;
    }
    report_failures(file, &failures)
}

/// Describes a point in words.
fn heading<S: Scalar>(names: &[String], q: &[S]) -> String {
    let parts = names.iter().zip(q).map(|(name, x)| format!("{name} = {}", trimmed(x.to_f64(), 7)));
    parts.collect::<Vec<_>>().join(", ")
}

fn written<S: Scalar>(format: Format, report: &PointReport<S>, heading: &str) -> String {
    match format {
        Format::Json => tensors::object(report),
        Format::Table => report.findings(heading).to_string(),
        Format::Latex => report.latex(heading),
    }
}

/// Prints a note if the metric depends on the velocity.
fn note_velocity<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) {
    if depends_on_velocity(model, q, v) {
        output::note("the mass matrix depends on the velocity; it is taken at --velocity, by default at rest");
    }
}
