//! `lnn compare`: compares two Lagrangians up to factor and gauge.

use crate::CliError;
use crate::arguments::number;
use crate::arguments::probe::{Bound, Probe, bound};
use crate::arguments::source::parameter;
use crate::terminal::format::FormatArgs;
use lnn::symmetry::{Comparison, ComparisonSummary, Degrees, unknowns};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A system by name or by the file that describes it, or a model, a file or the directory of a run.
    #[arg(value_name = "A")]
    first: String,
    /// Another with the same coordinates.
    #[arg(value_name = "B")]
    second: String,
    /// A parameter of the system A; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1, value_parser = parameter)]
    param: Vec<(String, String)>,
    /// A parameter of the system B; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", num_args = 1, value_parser = parameter)]
    param_b: Vec<(String, String)>,
    /// Functions that the gauge function is made of, by family and total degree: polynomial, trigonometric, hyperbolic; by
    /// default they suit the coordinates.
    #[arg(long, value_name = "FAMILY:DEGREE,..")]
    basis: Option<Degrees>,
    /// Bounds of the states that are examined, such as r=4:12 or r_dot=-0.3:0.3 [default: the bounds that both have in common].
    #[arg(long, value_name = "NAME=LOW:HIGH,..", value_delimiter = ',', value_parser = bound)]
    region: Vec<Bound>,
    /// Number of states that are examined [default: two for every unknown coefficient].
    #[arg(long, value_name = "N", value_parser = number::count)]
    points: Option<usize>,
    /// Seed of the states.
    #[arg(long, value_name = "N", default_value = "0", value_parser = number::seed)]
    seed: u64,
    #[command(flatten)]
    format: FormatArgs,
}

/// Compares the Lagrangians and prints the result.
///
/// # Errors
/// A usage error for Lagrangians of other coordinates or a region without states, a data error for a bad model or terms that are
/// not finite.
pub fn run(args: &Args) -> Result<(), CliError> {
    let mut first = Probe::either(&args.first, &args.param)?;
    let mut second = Probe::either(&args.second, &args.param_b)?;
    if first.model.coordinates() != second.model.coordinates() {
        let [a, b] = [&first, &second].map(|probe| probe.coordinates().join(","));
        return Err(CliError::usage(format_args!("expected Lagrangians with the same coordinates, found {a} and {b}")));
    }
    first.meet(&mut second)?;
    first.narrow(&args.region)?;
    let (basis, _) = first.basis(args.basis)?;
    let unknowns = unknowns(first.model.coordinates(), basis.len());
    let points = first.points(args.points, first.enough(basis.len()), unknowns)?;
    // States lie on the mass shell of a system, because a model may be untrained off it.
    let (q, v) = first.states_beside(&second, points, args.seed)?;
    let found =
        Comparison::of(first.model.as_ref(), second.model.as_ref(), &basis, (&q, &v)).map_err(CliError::data)?;
    let [first, second] = [&args.first, &args.second].map(Clone::clone);
    let compared = ComparisonSummary { first, second, comparison: found, points, seed: args.seed };
    args.format.print(&compared, ComparisonSummary::findings)
}
