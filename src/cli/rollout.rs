//! `lnn rollout`: the motion of a model from one state.

use crate::cli::learned::Learned;
use crate::cli::number::{finite, positive};
use crate::cli::{CliError, memory, output};
use crate::lagrangian::{EulerLagrange, find};
use crate::rollout::{Method, Options, RolloutError, rollout};
use crate::storage::{check_target, write_atomically};
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Model file.
    model: PathBuf,
    /// Start: coordinates, then velocities, separated by commas; taken as it is, on a mass shell or off it.
    #[arg(long, value_name = "q1,..,v1,..", required = true, value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    state: Vec<f64>,
    /// Time of the last sample, in seconds (relativistic systems: proper time in metres); the motion starts at 0, negative
    /// times run backwards.
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = finite)]
    t_end: f64,
    /// Time between samples, in the same unit.
    #[arg(long, value_name = "DT", allow_hyphen_values = true, value_parser = positive)]
    dt: f64,
    /// Integrator: two with error control, four symplectic ones of fixed step for long times; variational refuses models
    /// with friction.
    #[arg(long, value_enum, default_value = "dopri5")]
    method: MethodName,
    /// Relative tolerance of a step.
    #[arg(long, value_name = "R", default_value = "1e-6", allow_hyphen_values = true, value_parser = positive)]
    rtol: f64,
    /// Absolute tolerance of a step.
    #[arg(long, value_name = "A", default_value = "1e-8", allow_hyphen_values = true, value_parser = positive)]
    atol: f64,
    /// Longest step of midpoint, gauss4, gauss6 and variational, one per sample if not given.
    #[arg(long, value_name = "H", allow_hyphen_values = true, value_parser = positive)]
    step: Option<f64>,
    /// CSV of the trajectory: t, the columns of a state, energy.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum MethodName {
    Dopri5,
    Dop853,
    Midpoint,
    Gauss4,
    Gauss6,
    Variational,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::Dopri5 => Self::Dopri5,
            MethodName::Dop853 => Self::Dop853,
            MethodName::Midpoint => Self::Midpoint,
            MethodName::Gauss4 => Self::Gauss4,
            MethodName::Gauss6 => Self::Gauss6,
            MethodName::Variational => Self::Variational,
        }
    }
}

/// Integrates in double precision and writes the valid part of the trajectory.
///
/// # Errors
/// A usage error for a state of the wrong length; a data error for a bad model, a file that cannot be written, or a
/// motion that ends before its time, the samples up to there being written.
pub fn run(args: &Args) -> Result<(), CliError> {
    let learned = Learned::<f64>::load(&args.model)?;
    let columns = &learned.header.columns;
    if args.state.len() != columns.len() {
        let (expected, found) = (columns.len(), args.state.len());
        let names = columns.join(",");
        return Err(CliError::usage(format_args!("--state: expected {expected} numbers ({names}), found {found}")));
    }
    let (q, v) = args.state.split_at(columns.len() / 2);
    let method = Method::from(args.method);
    if args.step.is_some() && !method.is_structure_preserving() {
        return Err(CliError::usage("--step: dopri5 and dop853 choose their own steps; see --rtol"));
    }
    let options = Options {
        method,
        rtol: args.rtol,
        atol: args.atol,
        step: args.step,
        domain: Some(learned.domain()),
        ..Options::new(args.t_end, args.dt)
    };
    if options.check(q.len()).is_ok() {
        // A number and its comma in the CSV.
        const TEXT: u64 = 2 * 25;
        memory::require("the motion", memory::motions(1, args.t_end / args.dt, q.len(), TEXT))?;
    }
    let cannot_write = |e| CliError::file(&args.out, format_args!("cannot write: {e}"));
    check_target(&args.out).map_err(cannot_write)?;
    let result = rollout(&learned.network, q, v, &options);
    if let Some(error @ RolloutError::Invalid { .. }) = &result.stop {
        return Err(CliError::usage(error));
    }
    let csv = result.trajectory.to_csv(columns).map_err(CliError::data)?;
    write_atomically(&args.out, csv.as_bytes()).map_err(cannot_write)?;
    if let Some(stop) = result.stop {
        let problem = match &stop {
            RolloutError::LeftDomain { t, component, value, lower, upper, .. } => format!(
                "left the training range at t = {t}: {} reached {value:.6e}, trained on [{lower}, {upper}]",
                columns.get(*component).map_or("a component", String::as_str)
            ),
            other => other.to_string(),
        };
        let kept = result.trajectory.len();
        return Err(CliError::data(format_args!("{problem} ({kept} samples are in {})", args.out.display())));
    }
    let statistics = result.statistics;
    // A system that was only recorded has no unit here, nor has one of another version.
    let unit = find(&learned.header.system).map_or(String::new(), |system| format!(" {}", system.time_unit));
    let balance = if learned.network.conserves_energy() {
        String::new()
    } else {
        let balance = result.trajectory.energy_balance(&learned.network).map_err(CliError::data)?;
        let (change, dissipated, defect) = (balance.change, balance.dissipated, balance.defect());
        format!("energy changed by {change:.9e}, friction took {dissipated:.9e}, not accounted for {defect:.1e}\n")
    };
    let iterations = if method.is_structure_preserving() {
        format!(" in {} iterations", statistics.iterations)
    } else {
        String::new()
    };
    output::print(&format!(
        "{} samples to t = {}{unit}, {} steps, {} evaluations{iterations}, in {}\n{balance}",
        result.trajectory.len(),
        args.t_end,
        statistics.accepted,
        statistics.evaluations,
        args.out.display()
    ))
}
