//! `lnn geometry`: metric, connection and curvature of points.

use crate::CliError;
use crate::arguments::input;
use crate::arguments::number::{Precision, in_precision, indices_of, list, named, whole};
use crate::arguments::source::{Source, SystemOrModel, require_at_most};
use crate::terminal::format::print_rows;
use crate::terminal::output;
use crate::thresholds::{MOST_METRIC_COORDINATES, MOST_PIECES, ROWS_AT_ONCE};
use lnn::geometry::{GeometryError, MOST_COORDINATES, PointReport, SurfaceReport, at_once, depends_on_velocity};
use lnn::lagrangian::EulerLagrange;
use lnn::scalar::{Real, Scalar};
use std::path::{Path, PathBuf};

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
    in_precision!(args.precision, geometry(args))
}

fn geometry<S: Scalar>(args: &Args) -> Result<(), CliError> {
    let source = args.subject.read(Source::<S>::model, Source::<S>::system)?;
    let n = source.columns.len() / 2;
    require_at_most(MOST_METRIC_COORDINATES, n)?;
    let velocity = match &args.velocity {
        Some(text) => list("--velocity", text, &source.columns[..n])?,
        None => vec![<S as Real>::zero(); n],
    };
    let usual = if args.points.is_some() { Format::Json } else { Format::Table };
    let format = if args.json { Format::Json } else { args.format.unwrap_or(usual) };
    let metric = Metric { model: source.model.as_ref(), names: &source.columns[..n], velocity, format };
    if let (Some(from), Some(to)) = (&args.from, &args.to) {
        return metric.print_surfaces(&args.surface, (from, to), args.steps);
    }
    if n > MOST_COORDINATES {
        return Err(CliError::usage(GeometryError::TooMany { found: n, most: MOST_COORDINATES }));
    }
    match (&args.at, &args.points) {
        (Some(text), _) => metric.print_point(text),
        (_, Some(file)) => metric.print_points(file),
        _ => Err(CliError::usage("--points: expected a file")),
    }
}

/// A metric at a velocity, and the form of what is printed.
struct Metric<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    names: &'a [String],
    velocity: Vec<S>,
    format: Format,
}

impl<S: Scalar> Metric<'_, S> {
    /// Prints the surfaces on a line.
    fn print_surfaces(&self, block: &[String], (from, to): (&str, &str), steps: usize) -> Result<(), CliError> {
        if self.format == Format::Latex {
            return Err(CliError::usage("--format latex: expected json or table with --surface"));
        }
        let ends: [Vec<S>; 2] = [list("--from", from, self.names)?, list("--to", to, self.names)?];
        self.note_velocity(&ends[0]);
        let block = indices_of("--surface", "coordinate", block, self.names)?;
        let (about, ends) = ((self.model, self.names), (&ends[0][..], &ends[1][..]));
        let found = SurfaceReport::of(about, block, ends, &self.velocity, steps).map_err(CliError::data)?;
        output::print(&if self.format == Format::Table { found.findings().to_string() } else { found.json() })
    }

    /// Prints the geometry of one point.
    fn print_point(&self, text: &str) -> Result<(), CliError> {
        let point = named("--at", text, self.names)?;
        self.note_velocity(&point);
        let report = PointReport::of(self.model, self.names, &point, &self.velocity).map_err(CliError::data)?.remove(0);
        output::print(&self.format.written(&report, &report.place))?;
        report.problem.map_or(Ok(()), |problem| Err(CliError::data(format_args!("--at: {problem}"))))
    }

    /// Prints the geometry of the points of a file.
    fn print_points(&self, file: &Path) -> Result<(), CliError> {
        let n = self.names.len();
        let table = input::table::<S>(file, self.names)?;
        self.note_velocity(&table.values[..n]);
        print_rows(file, &table.rows, at_once(n).min(ROWS_AT_ONCE), |places| {
            let points = table.part(places.clone(), 0..n);
            let reports = PointReport::of(self.model, self.names, &points, &self.velocity).map_err(CliError::data)?;
            let text = |(report, row): (PointReport<'_, S>, &usize)| {
                (self.format.written(&report, &format!("row {row}: {}", report.place)), report.problem)
            };
            Ok(reports.into_iter().zip(&table.rows[places]).map(text).collect())
        })
    }

    /// Prints a note if the metric depends on the velocity.
    fn note_velocity(&self, q: &[S]) {
        if depends_on_velocity(self.model, q, &self.velocity) {
            output::note("the mass matrix depends on the velocity; it is taken at --velocity, by default at rest");
        }
    }
}

impl Format {
    fn written<S: Scalar>(self, report: &PointReport<'_, S>, heading: &str) -> String {
        match self {
            Self::Json => report.json(),
            Self::Table => report.findings(heading).to_string(),
            Self::Latex => report.latex(heading),
        }
    }
}
