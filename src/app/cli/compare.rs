//! `lnn compare`: what two Lagrangians have in common beyond factor and gauge.

use crate::cli::format::TableOrJson;
use crate::cli::probe::{Bound, Probe, bound};
use crate::cli::source::parameter;
use crate::cli::symmetries::degrees;
use crate::cli::{CliError, number, output};
use crate::findings::text_table;
use crate::names::{WIDTH, number as digits, rounded, wrap_text};
use crate::symmetry::{Comparison, Degrees, compare, unknowns};
use serde::Serialize;

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
    /// Functions that the gauge function is made of, by family and total degree: polynomial, trigonometric, hyperbolic; chosen
    /// by the coordinates if not given.
    #[arg(long, value_name = "FAMILY:DEGREE,..", value_parser = degrees)]
    basis: Option<Degrees>,
    /// Bounds of the states that are examined, such as r=4:12 or r_dot=-0.3:0.3; what both have in common if not given.
    #[arg(long, value_name = "NAME=LOW:HIGH,..", value_delimiter = ',', value_parser = bound)]
    region: Vec<Bound>,
    /// States that are examined; two for every unknown coefficient if not given.
    #[arg(long, value_name = "N", value_parser = number::count)]
    points: Option<usize>,
    /// Seed of the states.
    #[arg(long, value_name = "N", default_value = "0", value_parser = number::seed)]
    seed: u64,
    /// Text, or one JSON object.
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "table")]
    format: TableOrJson,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Compared<'a> {
    first: &'a str,
    second: &'a str,
    #[serde(flatten)]
    comparison: &'a Comparison,
    points: usize,
    seed: u64,
}

/// Compares and prints.
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
    // On the mass shell of a system, rather than where a model says nothing.
    let (q, v) = first.states_beside(&second, points, args.seed)?;
    let found = compare(first.model.as_ref(), second.model.as_ref(), &basis, (&q, &v)).map_err(CliError::data)?;
    let compared = Compared { first: &args.first, second: &args.second, comparison: &found, points, seed: args.seed };
    if args.json || args.format == TableOrJson::Json {
        return output::print(&(serde_json::to_string(&compared).map_err(CliError::data)? + "\n"));
    }
    output::print(&compared.text())
}

impl Compared<'_> {
    fn text(&self) -> String {
        let found = self.comparison;
        let powers = found.factors.iter().enumerate().map(|(k, factor)| {
            let power = if k == 0 { "B".to_string() } else { format!("B^{}", k + 1) };
            format!("{} {power}", rounded(*factor, 6))
        });
        let (gauge, function) = match found.gauge_formula.as_str() {
            "0" => ("", String::new()),
            formula => (" + dF/dt", format!(", F = {formula}")),
        };
        let sign = if found.constant < 0.0 { "-" } else { "+" };
        let text = format!(
            "A = {}{gauge} {sign} {}{function}, the best fit at {} states\n",
            powers.collect::<Vec<_>>().join(" + "),
            rounded(found.constant.abs(), 6),
            self.points
        );
        let shell =
            "B is the same at all states: f is determined at this one value, mass matrices up to a part h p p^T\n";
        let mut text = text + if found.on_shell { shell } else { "" };
        if !found.group_factors.is_empty() {
            let factors = found.group_factors.iter().map(|factor| rounded(*factor, 6)).collect::<Vec<_>>().join(", ");
            text += &format!(
                "decoupled coordinates have factors of their own, which no motion determines: B was first multiplied by {factors}\n"
            );
        }
        if found.motionless_states > 0 {
            text += &format!(
                "one of the two is degenerate: at {} states its mass matrix is singular and does not determine the accelerations\n",
                found.motionless_states
            );
        }
        let rows = [
            ("Lagrangian, after the fit", found.lagrangian),
            ("motion, accelerations", found.motion),
            ("mass matrix, after the fit", found.mass_matrix),
            ("energy, after the fit", found.energy),
        ];
        let distance = |x: f64| if x.is_nan() { "unknown".to_string() } else { digits(x) };
        let rows: Vec<Vec<String>> = rows.iter().map(|(name, x)| vec![name.to_string(), distance(*x)]).collect();
        format!("{}{}", wrap_text(&text, WIDTH), text_table(&["quantity", "relative distance"], &rows))
    }
}
