//! `lnn inspect`: prints the Euler-Lagrange terms of states with all digits.

use crate::arguments::input;
use crate::arguments::number::{Precision, list};
use crate::arguments::source::{Source, SystemOrModel};
use crate::arguments::states::parse_states_at;
use crate::commands::constraints::constrained;
use crate::commands::inverse::inverse;
use crate::terminal::format::{Field, Format, Shape, chunk, explain, report_failures, show};
use crate::terminal::output;
use crate::thresholds::{EXAMINED_MOTION_STATES, MAX_STATES_BYTES, MOST_SHOWN_PARAMETERS, ROUNDINGS_OF_ZERO};
use crate::{CliError, States};
use lnn::lagrangian::{
    EulerLagrange, LeastNorm, Linearizer, ManifoldRows, MechanicsError, ReducedMass, Request, Terms,
};
use lnn::linalg::{Workspace, eigenvalues};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::symmetry::{Canonical, CanonicalForm, SymmetryError};
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    subject: SystemOrModel,
    /// CSV of states, or - for standard input. Its header has the columns of the system, in any order; other columns, such as t
    /// and energy of a roll-out, are ignored.
    #[arg(long, value_name = "FILE.csv", required_unless_present = "structure")]
    states: Option<PathBuf>,
    /// Print which second derivatives of L are zero, constant or vary with the state, and which coordinates do not couple. No states are
    /// needed.
    #[arg(long, conflicts_with_all = ["states", "inverse", "canonical", "constraints", "least_norm", "linearize"])]
    structure: bool,
    /// Print the forces that cause given accelerations; the CSV also has the accelerations (COORDINATE_ddot).
    /// generalized_force is M a + c - g, the total force besides that of L, including friction. friction is that of the model,
    /// -dD/dv. external_force is the difference of the two, the force that must be applied from outside. Other columns are
    /// ignored.
    #[arg(long)]
    inverse: bool,
    /// Coordinates on which the external force of --inverse acts, such as that of a motor, for systems under constraints: at least as many as
    /// degrees of freedom. With more, the external force is the shortest. [default: all, with the shortest external force]
    #[arg(long, value_name = "COORD,..", value_delimiter = ',', requires = "inverse")]
    drives: Vec<String>,
    /// Fix factor and gauge of L, which motion does not determine, at a base state, coordinates before velocities [default: the first state
    /// of the file]. The terms are those of s (L - L0 - p0.(v - v0)) with |det M0| |s|^n = 1, for which L = 0 and p = 0 there.
    #[arg(
        long,
        value_name = "Q1,..,V1,..",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "",
        conflicts_with = "inverse"
    )]
    canonical: Option<String>,
    /// Constraints that hold the motion, a file with a table [constraints] as `lnn constraints --out` writes it.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "inverse")]
    constraints: Option<PathBuf>,
    /// Take the acceleration of least norm where the mass matrix is singular; null_directions are the free directions.
    #[arg(long, conflicts_with = "inverse")]
    least_norm: bool,
    /// Add the derivatives of the accelerations: acceleration_by_q, acceleration_by_v and acceleration_by_force have a row for each
    /// acceleration; acceleration_by_parameters, of a system, has a row for each parameter.
    #[arg(long, conflicts_with = "inverse")]
    linearize: bool,
    /// Precision of all arithmetic, including the reading of the states.
    #[arg(long, value_enum, value_name = "TYPE", default_value = "f64")]
    precision: Precision,
    /// One JSON object per line, or text. csv is for --inverse: the external forces, after the time if there is a column t.
    /// [default: json, and text for --structure]
    #[arg(long, value_enum, value_name = "FORMAT")]
    format: Option<Format>,
    /// The same as --format json.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

/// Prints one object per state.
///
/// # Errors
/// A usage or data error; after the last state, a data error if any state had a singular mass matrix or a term that is
/// not finite.
pub fn run(args: &Args) -> Result<(), CliError> {
    match args.precision {
        Precision::F32 => inspect::<f32>(args),
        Precision::F64 => inspect::<f64>(args),
        Precision::Dd => inspect::<Dd>(args),
    }
}

fn inspect<S: Scalar>(args: &Args) -> Result<(), CliError> {
    let source = args.subject.read(Source::<S>::model, Source::<S>::system)?;
    let Some(file) = &args.states else { return structure(args, &source) };
    let format = args.format.unwrap_or(Format::Json);
    if source.model.is_timed() && (args.linearize || args.canonical.is_some()) {
        return Err(CliError::usage("--linearize and --canonical need a system that does not depend on the time"));
    }
    if args.inverse {
        return inverse(file, format, &source, &args.drives);
    }
    if format == Format::Csv {
        return Err(CliError::usage("--format csv needs --inverse; use json or table"));
    }
    let bytes = input::read(file, MAX_STATES_BYTES)?;
    let time: &[String] = if source.model.is_timed() { &["t".to_string()] } else { &[] };
    let found = parse_states_at(&bytes, &source.columns, time);
    let (states, times): (States<S>, Vec<S>) = found.map_err(|e| CliError::input(file, e))?;
    drop(bytes);

    let n = source.columns.len() / 2;
    let Source { model, columns, .. } = source;
    let (model, factor) = requested(args, model, &columns, (&states.q, &states.v))?;
    let mut failures: Vec<(usize, String)> = Vec::new();
    let mut terms = Terms::default();
    let mut linearizer = args.linearize.then(|| Linearizer::new(model.as_ref()));
    let size = chunk(n);
    let mut times = times.chunks(size);
    for ((q, v), rows) in states.q.chunks(size * n).zip(states.v.chunks(size * n)).zip(states.rows.chunks(size)) {
        let mut text = String::new();
        let outcome = match times.next() {
            Some(t) => model.terms_at(t, q, v, Request::ALL, &mut terms),
            None => model.terms(q, v, Request::ALL, &mut terms),
        };
        let failed = terms.drain_failures(outcome).map_err(|error| CliError::input(file, error))?;
        let spectrum = spectrum(n, &terms.mass_matrix);
        let held = ConstrainedState::of(model.as_ref(), q, v, &terms);
        let squares = squares((n, v), &terms, &spectrum);
        let slopes = linearizer.as_mut().map(|linearizer| Slopes::of(linearizer, n, (q, v)));
        let mut failed = failed.into_iter().peekable();
        for (k, &row) in rows.iter().enumerate() {
            let problem = failed.next_if(|failure| failure.row() == Some(k)).map(explain);
            let mut fields = fields(n, k, &terms, &spectrum, &held[k], factor.as_ref());
            fields.extend(squares.get(k..=k).map(|values| Field { name: "g(v, v)", values, shape: Shape::Number }));
            fields.extend(slopes.iter().flat_map(|slopes| slopes[k].fields()));
            text += &show(format, row, &fields, problem.as_deref());
            failures.extend(problem.map(|text| (row, text)));
        }
        output::print(&text)?;
    }
    report_failures(file, &failures)
}

/// Prints which second derivatives are zero, constant or state-dependent.
fn structure<S: Scalar>(args: &Args, source: &Source<S>) -> Result<(), CliError> {
    let pattern = source.model.pattern();
    let pattern = pattern.ok_or_else(|| CliError::data("--structure: the Lagrangian is too large to be recorded"))?;
    if args.format == Some(Format::Json) || args.json {
        let text = serde_json::to_string(&pattern).map_err(CliError::data)?;
        return output::print(&format!("{text}\n"));
    }
    output::print(&pattern.to_string())
}

/// A model with its Lagrangian.
type Model<S> = Box<dyn EulerLagrange<S>>;

/// Creates the model under the constraints, in the requested form and with the requested accelerations; also returns the factor of its
/// canonical form.
fn requested<S: Scalar>(
    args: &Args,
    model: Model<S>,
    columns: &[String],
    (q, v): (&[S], &[S]),
) -> Result<(Model<S>, Option<S>), CliError> {
    let few = (EXAMINED_MOTION_STATES * (columns.len() / 2)).min(q.len());
    let model = match &args.constraints {
        Some(file) => constrained(model, columns, file, (&q[..few], &v[..few]))?,
        None => model,
    };
    let (model, factor) = match &args.canonical {
        None => (model, None),
        Some(text) => {
            let (model, form) = canonical(model, text, columns, (q, v))?;
            (model, Some(form.factor))
        }
    };
    Ok((if args.least_norm { Box::new(LeastNorm(model)) } else { model }, factor))
}

/// Creates the canonical form of the model at the base state in `text` or, if that is empty, at the first of the states `(q, v)`.
fn canonical<S: Scalar>(
    model: Model<S>,
    text: &str,
    columns: &[String],
    (q, v): (&[S], &[S]),
) -> Result<(Model<S>, CanonicalForm<S>), CliError> {
    let n = columns.len() / 2;
    let base = match (text, q.get(..n), v.get(..n)) {
        ("", Some(q), Some(v)) => [q, v].concat(),
        _ => list("--canonical", text, columns)?,
    };
    let form = CanonicalForm::at(model.as_ref(), &base[..n], &base[n..]).map_err(|error| {
        let problem = match error {
            SymmetryError::Base(error) => explain(error),
            error => error.to_string(),
        };
        CliError::data(format_args!("--canonical: no canonical form at the base state: {problem}"))
    })?;
    Ok((Box::new(Canonical::new(model, form.clone())), form))
}

/// Eigenvalues of a batch of mass matrices, ascending; `NaN` for a matrix that is not finite.
fn spectrum<S: Scalar>(n: usize, matrices: &[S]) -> Vec<S> {
    let mut values = vec![S::nan(); matrices.len() / n];
    // A matrix that fails already has NaN eigenvalues, and its state is reported with its terms.
    let _ = eigenvalues(n, matrices, &mut values, &mut Workspace::new());
    values
}

/// `g(v, v)` of a batch of states, for geodesics of a metric with a time, whose `L` is the energy, `g(v, v)/2`; empty for other models.
fn squares<S: Scalar>((n, v): (usize, &[S]), terms: &Terms<S>, spectrum: &[S]) -> Vec<S> {
    let zero = <S as Real>::zero();
    let rounding = S::of_f64(ROUNDINGS_OF_ZERO) * S::epsilon();
    let values = terms.lagrangian.iter().zip(&terms.energy);
    let is_energy = |(k, (&l, &energy)): (usize, (&S, &S))| {
        let speed = v[k * n..(k + 1) * n].iter().fold(<S as Real>::one(), |sum, &v| sum + v * v);
        let size = terms.mass_matrix[k * n * n..(k + 1) * n * n].iter().fold(zero, |sum, g| sum + g.abs()) * speed;
        let signs = (spectrum[k * n] < zero, spectrum[(k + 1) * n - 1] > zero);
        // States that are not finite are ignored.
        !size.is_finite() || (signs == (true, true) && (l - energy).abs() <= rounding * size)
    };
    let all = terms.force.is_empty() && values.enumerate().all(is_energy);
    if all { terms.energy.iter().map(|&energy| energy + energy).collect() } else { Vec::new() }
}

/// The constraints at a state, and the degenerate directions of its Lagrangian there.
#[derive(Default)]
struct ConstrainedState<S> {
    /// Values of `phi(q)` and `A v - b`.
    values: Vec<S>,
    rates: Vec<S>,
    /// Eigenvalues of the mass matrix within the constraints.
    eigenvalues: Vec<S>,
    /// Directions within the constraints along which the mass matrix vanishes, row by row.
    open: Vec<S>,
}

impl<S: Scalar> ConstrainedState<S> {
    /// Computes the constraints for every state of a batch.
    fn of(model: &dyn EulerLagrange<S>, q: &[S], v: &[S], terms: &Terms<S>) -> Vec<Self> {
        let (n, m) = (model.coordinates(), terms.constraints);
        let states = q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate();
        states
            .map(|(k, (q, v))| {
                let mut rows = ManifoldRows::default();
                if let Some(manifold) = model.manifold() {
                    manifold.rows(q, v, &mut rows);
                }
                let (mass, matrix) = (&terms.mass_matrix[k * n * n..(k + 1) * n * n], &terms.constraint_matrix);
                let reduced = ReducedMass::of(n, mass, &matrix[k * m * n..(k + 1) * m * n]).ok();
                let open =
                    reduced.iter().flat_map(|reduced| reduced.null_directions(ROUNDINGS_OF_ZERO)).flatten().copied();
                let open = open.collect();
                Self {
                    values: rows.values,
                    rates: rows.rates,
                    open,
                    eigenvalues: reduced.map(|reduced| reduced.eigenvalues).unwrap_or_default(),
                }
            })
            .collect()
    }
}

/// The derivatives of the accelerations at a state; empty if it has none.
#[derive(Default)]
struct Slopes<S> {
    by_q: Vec<S>,
    by_v: Vec<S>,
    by_force: Vec<S>,
    /// Derivatives with respect to the parameters, `(parameters, n)`.
    by_parameters: Vec<S>,
}

impl<S: Scalar> Slopes<S> {
    /// Computes the derivatives for every state of a batch.
    fn of(linearizer: &mut Linearizer<'_, S>, n: usize, (q, v): (&[S], &[S])) -> Vec<Self> {
        let states = q.chunks_exact(n).zip(v.chunks_exact(n));
        states.map(|(q, v)| Self::at(linearizer, q, v).unwrap_or_default()).collect()
    }

    fn at(linearizer: &mut Linearizer<'_, S>, q: &[S], v: &[S]) -> Result<Self, MechanicsError> {
        let n = q.len();
        let found = linearizer.at(q, v)?;
        let (by_q, by_v, by_force) = (found.by_q.clone(), found.by_v.clone(), found.by_force.clone());
        let mut by_parameters = Vec::new();
        for i in 0..n {
            let unit: Vec<S> = (0..n).map(|j| S::of_f64(f64::from(u8::from(i == j)))).collect();
            let of_row = &linearizer.gradient(q, v, &unit)?.by_parameters;
            if of_row.len() > MOST_SHOWN_PARAMETERS {
                break;
            }
            by_parameters.resize(of_row.len() * n, S::nan());
            of_row.iter().enumerate().for_each(|(k, &x)| by_parameters[k * n + i] = x);
        }
        Ok(Self { by_q, by_v, by_force, by_parameters })
    }

    fn fields(&self) -> impl Iterator<Item = Field<'_, S>> {
        let named = [
            ("acceleration_by_q", &self.by_q),
            ("acceleration_by_v", &self.by_v),
            ("acceleration_by_force", &self.by_force),
            ("acceleration_by_parameters", &self.by_parameters),
        ];
        let known = |(name, values): &(&str, &Vec<S>)| *name != "acceleration_by_parameters" || !values.is_empty();
        named.into_iter().filter(known).map(|(name, values)| Field { name, values, shape: Shape::Matrix })
    }
}

/// Collects all results for state `k` of a batch; `factor` is that of a canonical form.
fn fields<'a, S>(
    n: usize,
    k: usize,
    terms: &'a Terms<S>,
    spectrum: &'a [S],
    held: &'a ConstrainedState<S>,
    factor: Option<&'a S>,
) -> Vec<Field<'a, S>> {
    let part = |values: &'a [S], size: usize| values.get(k * size..(k + 1) * size).unwrap_or(&[]);
    let number = |name, values| Field { name, values: part(values, 1), shape: Shape::Number };
    let vector = |name, values, size| Field { name, values: part(values, size), shape: Shape::Vector };
    let whole = |name, values, shape| Field { name, values, shape };
    let m = terms.constraints;
    let mut fields = vec![
        number("lagrangian", &terms.lagrangian),
        vector("momentum", &terms.momentum, n),
        vector("dl_dq", &terms.dl_dq, n),
        Field { name: "mass_matrix", values: part(&terms.mass_matrix, n * n), shape: Shape::Matrix },
        vector("eigenvalues", spectrum, n),
        vector("coriolis", &terms.coriolis, n),
        vector("acceleration", &terms.acceleration, n),
        number("energy", &terms.energy),
    ];
    if !terms.force.is_empty() {
        fields.extend([vector("force", &terms.force, n), number("dissipation", &terms.dissipation)]);
    }
    if m > 0 {
        fields.extend([
            vector("multipliers", &terms.multipliers, m),
            vector("constraint_force", &terms.constraint_force, n),
            whole("constraint_values", &held.values, Shape::Vector),
            whole("constraint_rates", &held.rates, Shape::Vector),
            whole("reduced_eigenvalues", &held.eigenvalues, Shape::Vector),
        ]);
    }
    if !held.open.is_empty() {
        fields.push(whole("null_directions", &held.open, Shape::Matrix));
    }
    let factor = factor.map(|factor| std::slice::from_ref(factor));
    fields.extend(factor.map(|values| Field { name: "canonical_factor", values, shape: Shape::Number }));
    fields
}
