//! `lnn geometry`: metric, connection and curvature of points, full digits.

use crate::cli::shown::{CHUNK, explain, report_failures};
use crate::cli::source::{Source, parameter};
use crate::cli::states::parse_table;
use crate::cli::{CliError, input, json, output, states};
use crate::geometry::{Geometry, GeometryError};
use crate::lagrangian::{EulerLagrange, MetricJet, Request, Terms};
use crate::linalg::{Inertia, inertia};
use crate::scalar::{Dd, Real, Scalar};
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name (`lnn systems` lists them), or by the file that describes it.
    #[arg(long, value_name = "NAME|FILE.toml", required_unless_present = "model", conflicts_with = "model")]
    system: Option<String>,
    /// A trained model, a file or the directory of a run.
    #[arg(long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// A parameter of the system, decimal text read in the working precision; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1.., value_parser = parameter, conflicts_with = "model")]
    param: Vec<(String, String)>,
    /// CSV of points, or - for standard input: the coordinates as header, in any order; other columns are left out.
    #[arg(long, value_name = "FILE.csv")]
    points: PathBuf,
    /// The velocity at which the mass matrix is taken, in the order of the coordinates; it matters to Lagrangians that are not
    /// quadratic in the velocities alone [default: zeros].
    #[arg(long, value_name = "V1,V2,..", allow_hyphen_values = true)]
    velocity: Option<String>,
    /// Precision of everything, the reading of the points included.
    #[arg(long, value_enum, value_name = "TYPE", default_value = "f64")]
    precision: Precision,
    /// One JSON object per line, or text: the components that are not zero, each of those that are equal by symmetry once.
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "json")]
    format: Format,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Precision {
    /// Single, 9 digits.
    F32,
    /// Double, 17 digits.
    F64,
    /// Double-double, about 32 digits.
    Dd,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// One object per line.
    Json,
    /// Text.
    Table,
}

/// Numbers of the jets that are held at a time, about.
const NUMBERS: usize = 1 << 20;

/// Prints one object per point.
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
    let source = match &args.model {
        Some(path) => Source::<S>::model(path)?,
        None => Source::<S>::system(args.system.as_deref().unwrap_or_default(), &args.param)?,
    };
    let n = source.columns.len() / 2;
    let names = &source.columns[..n];
    let velocity = velocity(args.velocity.as_deref(), names)?;
    let place = input::name(&args.points);
    let told = |e: &dyn std::fmt::Display| CliError::data(format_args!("{place}: {e}"));
    let bytes = input::read(&args.points, states::MAX_BYTES).map_err(|e| told(&e))?;
    let table = parse_table::<S>(&bytes, names).map_err(|e| told(&e))?;
    drop(bytes);
    if varies(&*source.model, &table.values[..n], &velocity) {
        output::note(
            "the mass matrix depends on the velocity; --velocity chooses where it is taken, here at rest or as given",
        );
    }

    let chunk = (NUMBERS / n.pow(4)).clamp(1, CHUNK);
    let mut failures: Vec<(usize, String)> = Vec::new();
    for (points, rows) in table.values.chunks(chunk * n).zip(table.rows.chunks(chunk)) {
        let velocities = velocity.repeat(rows.len());
        let jets = source.model.metric_jets(points, &velocities).map_err(|e| CliError::data(explain(e)))?;
        let mut text = String::new();
        for (jet, &row) in jets.iter().zip(rows) {
            let found = Geometry::new(jet);
            let problem = found.as_ref().err().map(GeometryError::to_string);
            let fields = fields(jet, found.ok().as_ref());
            text += &match args.format {
                Format::Json => object(n, &fields, problem.as_deref()),
                Format::Table => block(names, row, &fields, problem.as_deref()),
            };
            failures.extend(problem.map(|problem| (row, problem)));
        }
        output::print(&text)?;
    }
    report_failures(&place, &failures)
}

/// The velocity as given, zeros otherwise.
fn velocity<S: Scalar>(given: Option<&str>, names: &[String]) -> Result<Vec<S>, CliError> {
    let Some(text) = given else { return Ok(vec![<S as Real>::zero(); names.len()]) };
    let numbers: Option<Vec<S>> = text.split(',').map(|x| S::parse(x.trim()).filter(|x| x.is_finite())).collect();
    let expected = format!("expected {} finite numbers ({})", names.len(), names.join(","));
    let numbers = numbers.ok_or_else(|| CliError::usage(format_args!("--velocity: {expected}, found {text:?}")))?;
    match numbers.len() {
        found if found == names.len() => Ok(numbers),
        found => Err(CliError::usage(format_args!("--velocity: {expected}, found {found}"))),
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

/// A result, in the order in which results are printed.
struct Field<S> {
    name: &'static str,
    value: Value<S>,
}

enum Value<S> {
    /// What the point does not have.
    Missing,
    Number(S),
    Signature(Inertia),
    /// A tensor of some rank; the indices of its components that the others follow from.
    Tensor(Vec<S>, usize, fn(&[usize]) -> bool),
}

/// Everything there is to say about a point.
fn fields<S: Scalar>(jet: &MetricJet<S>, found: Option<&Geometry<S>>) -> Vec<Field<S>> {
    let n = jet.coordinates();
    let field = |name, value: Option<Value<S>>| Field { name, value: value.unwrap_or(Value::Missing) };
    let tensor = |rank, independent| move |values: Vec<S>| Value::Tensor(values, rank, independent);
    let finite = jet.metric.iter().all(|x| x.is_finite());
    let signature = inertia(n, &jet.metric, &mut vec![S::nan(); n * n]).ok();
    let singular = signature.filter(|signature| signature.zero > 0).map(|_| <S as Real>::zero());
    let (metric, curvature) = (found.map(|f| &f.metric), found.map(|f| &f.curvature));
    let of = |what: fn(&Geometry<S>) -> Vec<S>| found.map(what);
    vec![
        field("metric", finite.then(|| tensor(2, symmetric)(jet.metric.clone()))),
        field("inverse_metric", of(|f| f.metric.inverse.clone()).map(tensor(2, symmetric))),
        field("determinant", metric.map(|metric| metric.determinant).or(singular).map(Value::Number)),
        field("signature", signature.map(Value::Signature)),
        field("christoffel", of(|f| f.connection.symbols.clone()).map(tensor(3, symmetric))),
        field("riemann", of(|f| f.curvature.riemann.clone()).map(tensor(4, antisymmetric))),
        field("ricci", of(|f| f.curvature.ricci.clone()).map(tensor(2, symmetric))),
        field("ricci_scalar", curvature.map(|curvature| Value::Number(curvature.scalar))),
        field("einstein", of(|f| f.curvature.einstein(&f.metric)).map(tensor(2, symmetric))),
        field("weyl", of(|f| f.curvature.weyl(&f.metric)).map(tensor(4, two_pairs))),
        field("kretschmann", found.map(|f| Value::Number(f.curvature.kretschmann(&f.metric)))),
    ]
}

/// Symmetric in the last two indices.
fn symmetric(at: &[usize]) -> bool {
    at.iter().rev().nth(1) <= at.last()
}

/// Antisymmetric in the last two indices.
fn antisymmetric(at: &[usize]) -> bool {
    at.iter().rev().nth(1) < at.last()
}

/// Antisymmetric in the first and in the last two indices, symmetric in the pairs.
fn two_pairs(at: &[usize]) -> bool {
    at[0] < at[1] && at[2] < at[3] && at[..2] <= at[2..]
}

/// A point as a line of JSON.
fn object<S: Scalar>(n: usize, fields: &[Field<S>], problem: Option<&str>) -> String {
    let mut parts: Vec<String> = fields
        .iter()
        .map(|field| {
            let value = match &field.value {
                Value::Missing => "null".to_string(),
                Value::Number(x) => json::number(*x),
                Value::Signature(signature) => format!("[{},{}]", signature.negative, signature.positive),
                Value::Tensor(values, rank, _) => json::tensor(values, n, *rank),
            };
            format!("\"{}\":{value}", field.name)
        })
        .collect();
    parts.extend(problem.map(|text| format!("\"error\":{}", json::string(text))));
    format!("{{{}}}\n", parts.join(","))
}

/// A point as a block of text: components below rounding of the largest of their tensor are left out.
fn block<S: Scalar>(names: &[String], row: usize, fields: &[Field<S>], problem: Option<&str>) -> String {
    let n = names.len();
    let mut text = format!("row {row}\n");
    let mut line = |name: &str, at: &str, value: &str| text += &format!("  {name:<15} {at:<25} {value}\n");
    for Field { name, value } in fields {
        match value {
            Value::Missing => {}
            Value::Number(x) => line(name, "", &json::number(*x)),
            Value::Signature(signature) => {
                line(name, "", &format!("{} negative, {} positive", signature.negative, signature.positive));
            }
            Value::Tensor(values, rank, independent) => {
                let most = values.iter().map(|x| x.abs().to_f64()).fold(0.0, f64::max);
                let least = most * 64.0 * S::epsilon().to_f64();
                for (place, x) in values.iter().enumerate().filter(|(_, x)| x.abs().to_f64() > least) {
                    let at: Vec<usize> = (0..*rank as u32).rev().map(|k| place / n.pow(k) % n).collect();
                    if independent(&at) {
                        let at: Vec<&str> = at.iter().map(|&i| names[i].as_str()).collect();
                        line(name, &at.join(","), &json::number(*x));
                    }
                }
            }
        }
    }
    if let Some(problem) = problem {
        line("error", problem, "");
    }
    text.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}
