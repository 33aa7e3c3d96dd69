//! `lnn symmetries`: symmetries and conserved quantities of a Lagrangian.

use crate::CliError;
use crate::arguments::number;
use crate::arguments::probe::{Bound, Probe, bound, tolerance};
use crate::arguments::source::SystemOrModel;
use crate::terminal::format::FormatArgs;
use crate::terminal::output;
use crate::thresholds::{LONG_SEARCH, MOST_QUADRATIC_UNKNOWNS};
use lnn::symmetry::{Degrees, MOST_UNKNOWNS, Quadratic, Symmetries, SymmetrySummary, quadratic_unknowns, unknowns};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: SystemOrModel,
    /// Functions that fields are made of, by family and total degree: polynomial, trigonometric, hyperbolic; by
    /// default they suit the coordinates.
    #[arg(long, value_name = "FAMILY:DEGREE,..")]
    basis: Option<Degrees>,
    /// Bounds of the states that are examined, such as r=4:12 or r_dot=-0.3:0.3 [default: those of the system, or the middle of the
    /// training range of the model].
    #[arg(long, value_name = "NAME=LOW:HIGH,..", value_delimiter = ',', value_parser = bound)]
    region: Vec<Bound>,
    /// Number of states that are examined [default: two for every unknown coefficient, at least 400 for a system and 1000 for a model].
    #[arg(long, value_name = "N", value_parser = number::count)]
    points: Option<usize>,
    /// Seed of the states.
    #[arg(long, value_name = "N", default_value = "0", value_parser = number::seed)]
    seed: u64,
    /// Singular values up to this one count as zero, at most 0.1 [default: 1e-8 for a system, up to the largest gap for a model].
    #[arg(long, value_name = "T", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Look for conserved quantities of second degree in the momenta as well.
    #[arg(long)]
    quadratic: bool,
    #[command(flatten)]
    format: FormatArgs,
}

/// Finds symmetries and prints them.
///
/// # Errors
/// A usage error for a wrong system or region, a data error for a bad model or terms that are not finite.
pub fn run(args: &Args) -> Result<(), CliError> {
    let mut probe = args.subject.read(Probe::model, Probe::system)?;
    probe.narrow(&args.region)?;
    let (basis, _) = probe.basis(args.basis)?;
    let n = probe.model.coordinates();
    let own = unknowns(n, basis.len());
    // For quadratic quantities this is an upper bound, because cyclic coordinates reduce the number of functions.
    let second = |most: usize| if args.quadratic { own.max(quadratic_unknowns(n, basis.len()).min(most)) } else { own };
    let points = probe.points(args.points, probe.enough(second(MOST_QUADRATIC_UNKNOWNS)), second(MOST_UNKNOWNS))?;
    announce(own, points, args.quadratic);
    let (q, v) = probe.states(points, args.seed)?;
    let tolerance = args.tolerance.or(probe.exact.then_some(Symmetries::EXACT));
    let model = probe.model.as_ref();
    let (found, families) = probe.symmetries(args.basis, (&q, &v), args.tolerance)?;
    let second = match args.quadratic {
        true => Some(Quadratic::find(model, &found.basis, &found.fields, (&q, &v), tolerance).map_err(CliError::data)?),
        false => None,
    };
    args.format.print(&found.summary(&probe.name, families, args.seed, second), SymmetrySummary::findings)
}

/// Announces a long search, which is otherwise silent.
fn announce(unknowns: usize, points: usize, quadratic: bool) {
    if (unknowns as f64).powi(2) * points as f64 > LONG_SEARCH {
        let more = if quadratic { ", and more for quadratic quantities" } else { "" };
        output::note(&format!(
            "{unknowns} unknown coefficients at {points} states{more}: this takes a while; a smaller --basis is faster"
        ));
    }
}
