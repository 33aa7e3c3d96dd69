//! `lnn rollout`: predicts the motion of a model from one state.

use crate::CliError;
use crate::arguments::forces::{ForceArgs, KnownForce};
use crate::arguments::input;
use crate::arguments::motion_source::MotionSource;
use crate::arguments::number::{choice, finite, positive, tolerance};
use crate::arguments::probe::Probe;
use crate::arguments::source::parameter;
use crate::commands::charges::Charges;
use crate::commands::constraints::constrained;
use crate::commands::motion::pictures::{EXTENSIONS, Texts};
use crate::commands::motion::readings::ReadingColumns;
use crate::commands::motion::samples::{MoreColumns, Samples};
use crate::commands::motion::{Conserved, Facts, Leaving, MotionRecord, events, place};
use crate::commands::tube::{MotionTube, TubeArgs};
use crate::directories::files::{OutputFile, file_ending, require_free};
use crate::terminal::{interrupt, output};
use crate::thresholds::ROUNDINGS_OF_ZERO;
use lnn::lagrangian::{EulerLagrange, Interruptible, LeastNorm, ReducedMass, Request, Terms};
use lnn::names::pluralize;
use lnn::report::DataTable;
use lnn::rollout::{
    Driven, Ending, EnergyBalance, Event, Integrator, RolloutError, RolloutOptions, Trajectory, rollout_in_pieces,
};
use lnn::symmetry::Invariant;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Model, a file or the directory of a run.
    #[arg(required_unless_present = "system")]
    model: Option<PathBuf>,
    /// Predict the exact motion of a system instead of a model, by name (`lnn systems` lists them) or by its file.
    #[arg(long, value_name = "NAME|FILE", conflicts_with = "model")]
    system: Option<String>,
    /// A parameter of the system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", conflicts_with = "model", value_parser = parameter)]
    param: Vec<(String, String)>,
    /// Initial state: coordinates, then velocities, separated by commas. It is used as given, on a mass shell or off it. Under
    /// constraints, a state that misses them by less than a thousandth of its size is projected onto them, and any other is refused.
    #[arg(long, value_name = "q1,..,v1,..", required = true, value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    state: Vec<f64>,
    /// Time of the last sample, in the time unit of the system; for geodesics of a space-time an affine parameter, the proper time of
    /// matter. For a time before the start the motion runs backwards.
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = finite)]
    t_end: f64,
    /// Time of the start, in the same unit; it matters only where forces or the system depend on the time.
    #[arg(long, value_name = "T", default_value = "0", allow_hyphen_values = true, value_parser = finite)]
    t_start: f64,
    /// Time between samples, in the same unit.
    #[arg(long, value_name = "DT", allow_hyphen_values = true, value_parser = positive)]
    dt: f64,
    #[command(flatten)]
    forces: ForceArgs,
    /// Integrator. If unsure, keep the default; take gauss6 for long times. variational refuses models with friction.
    #[arg(long, value_parser = choice(&Integrator::ALL, Integrator::name, Integrator::about), value_name = "NAME", default_value = "dopri5")]
    method: Integrator,
    /// Relative tolerance of a step, at least 2e-15.
    #[arg(long, value_name = "R", default_value = "1e-6", allow_hyphen_values = true, value_parser = tolerance)]
    rtol: f64,
    /// Absolute tolerance of a step.
    #[arg(long, value_name = "A", default_value = "1e-8", allow_hyphen_values = true, value_parser = positive)]
    atol: f64,
    /// Longest step of midpoint, gauss4, gauss6 and variational, at most the time between samples [default: one step per
    /// sample].
    #[arg(long, value_name = "H", allow_hyphen_values = true, value_parser = positive)]
    step: Option<f64>,
    /// Continue where the motion leaves the training range of the model, and report the place. Angles may always turn
    /// freely.
    #[arg(long)]
    beyond_range: bool,
    /// Constraints that hold the motion, a file with a table [constraints] as `lnn constraints --out` writes it.
    #[arg(long, value_name = "FILE.toml")]
    constraints: Option<PathBuf>,
    /// Take the acceleration of least norm where the mass matrix is singular, and report the number of free directions.
    #[arg(long)]
    least_norm: bool,
    /// CSV of the trajectory: t, the columns of a state, energy, measured quantities of the system; - for standard output. An existing file is
    /// replaced only with --overwrite, the file of the model never.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// Plot of the coordinates against time, a panel for each unit, with the path in the plane of polar ones, or a page that
    /// also shows velocities and energy.
    #[arg(long, value_name = "FILE.svg|FILE.html", value_parser = file_ending(&EXTENSIONS))]
    plot: Option<PathBuf>,
    /// CSV of the events of the system: name, t, state, and the energies of impacts.
    #[arg(long, value_name = "FILE.csv")]
    events: Option<PathBuf>,
    /// Report the charges of the model's symmetries along the motion, with the parts of their drift due to the model and to
    /// the integrator.
    #[arg(long)]
    charges: bool,
    #[command(flatten)]
    tube: TubeArgs,
    /// Replace the files.
    #[arg(long)]
    overwrite: bool,
    /// Print a JSON object instead of text.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The source of the motion, under the given constraints.
    fn source(&self) -> Result<MotionSource, CliError> {
        let mut source = match &self.model {
            Some(path) => MotionSource::model(path)?,
            None => MotionSource::system(self.system.as_deref().unwrap_or_default(), &self.param)?,
        };
        let (expected, found) = (source.columns.len(), self.state.len());
        if found != expected {
            let names = source.columns.join(",");
            return Err(CliError::usage(format_args!("--state: expected {expected} numbers ({names}), found {found}")));
        }
        if let Some(file) = &self.constraints {
            source.model = constrained(source.model, &source.columns, file, self.state.split_at(expected / 2))?;
        }
        Ok(source)
    }

    fn options(&self, source: &MotionSource) -> Result<RolloutOptions<f64>, CliError> {
        if self.step.is_some() && !self.method.is_structure_preserving() {
            return Err(CliError::usage("--step: dopri5 and dop853 choose their own steps; see --rtol"));
        }
        let options = RolloutOptions::new(self.t_end, self.dt)
            .t0(self.t_start)
            .method(self.method)
            .tolerances(self.rtol, self.atol)
            .step(self.step)
            .domain(source.domain.clone().filter(|_| !self.beyond_range))
            .events(source.events.clone());
        options.check(source.columns.len() / 2).map_err(|e| refused(&e))?;
        if let Some(step) = self.step.filter(|step| *step > self.dt) {
            output::note(&format!("--step {step} is longer than --dt {}: one step per sample", self.dt));
        }
        Ok(options)
    }

    /// Rejects overwriting existing files or inputs.
    fn require_room(&self, source: &MotionSource) -> Result<(), CliError> {
        let files = self.forces.files().chain(self.tube.files());
        let inputs: Vec<_> = files.chain(source.file.as_deref()).chain(self.constraints.as_deref()).collect();
        if !input::is_standard(&self.out) {
            require_free(&self.out, &inputs, self.overwrite)?;
        }
        let beside = [("--plot", &self.plot), ("--events", &self.events)];
        for (option, file) in beside.iter().filter_map(|(option, file)| Some((option, file.as_ref()?))) {
            if *file == self.out || (self.plot == self.events && *option == "--events") {
                return Err(CliError::usage(format_args!("{option}: another option already writes to this file")));
            }
            OutputFile::claim(file, &inputs, self.overwrite)?;
        }
        Ok(())
    }

    /// Rejects options that exclude each other.
    fn check(&self, source: &MotionSource, is_driven: bool) -> Result<(), CliError> {
        if self.json && input::is_standard(&self.out) {
            return Err(CliError::usage("--json: the trajectory takes standard output (--out -)"));
        }
        events::check(self.events.as_deref(), self.charges, &source.events)?;
        if self.charges && (is_driven || source.model.is_timed()) {
            return Err(CliError::usage(
                "--charges: only for motion without external forces, of a system that does not depend on time",
            ));
        }
        Ok(())
    }

    /// Charges of the symmetries along a motion.
    fn charges(&self, motion: &Trajectory<f64>) -> Result<Charges, CliError> {
        let probe = match &self.model {
            Some(path) => Probe::model(path)?,
            None => Probe::system(self.system.as_deref().unwrap_or_default(), &self.param)?,
        };
        Charges::new(&probe, motion)
    }
}

/// Integrates in double precision and writes the valid part of the trajectory.
///
/// # Errors
/// A usage error for a state of the wrong length; a data error for a bad model, a file that cannot be written, or a
/// motion that ends before its time, the samples up to there being written.
pub fn run(args: &Args) -> Result<(), CliError> {
    let mut source = args.source()?;
    let (q, v) = args.state.split_at(source.columns.len() / 2);
    let span = (args.t_start, args.t_end);
    let force = args.forces.force(&source.columns[..q.len()], &source.forces, span)?;
    let force = source.take_inputs(force)?;
    args.check(&source, force.is_some())?;
    let options = args.options(&source)?;
    args.require_room(&source)?;
    let tube = args.tube.tube((source.model.as_ref(), args.model.as_deref()), &source.columns[..q.len()], span)?;
    let more = MoreColumns { tube, readings: ReadingColumns::of(&source, force.is_some())? };
    let mut samples = Samples::create(&args.out, &source, more, args.charges)?;
    let least_norm = LeastNorm(source.model.as_ref());
    let model: &dyn EulerLagrange<f64> = if args.least_norm { &least_norm } else { source.model.as_ref() };
    if args.least_norm {
        note_open_directions(source.model.as_ref(), options.t0, q, v);
    }
    let result = integrate(model, force.as_ref(), (q, v), &options, &mut samples)?;
    if !input::is_standard(&args.out) {
        // Another program may have written the file in the meantime.
        args.require_room(&source)?;
    }
    let (watch, tube, kept) = samples.finish()?;
    let table = events::table(&source, &result.events);
    if let (Some(file), Some(table)) = (&args.events, &table) {
        OutputFile::claim(file, &[], args.overwrite)?.write(table.to_csv().as_bytes())?;
    }
    if let Some(plot) = &args.plot {
        let (title, parameter) = (format!("{}: roll-out", source.name), source.parameter());
        let energy = watch.invariant(model).map_or("energy", Invariant::charge);
        let texts = Texts { title: &title, parameter: &parameter, energy, units: &source.units };
        watch.plot(plot, &texts, tube.as_ref())?;
    }
    if let Some(leaving) = watch.leaving.as_ref().filter(|_| args.beyond_range) {
        output::note(&format!("{}; the motion after that is extrapolated", leaving.text()));
    }
    if let Some(stop) = &result.stop {
        if let Some(table) = table.filter(|table| !args.json && !table.rows.is_empty()) {
            args.print(&events::text(&table))?;
        }
        let names = model.manifold().map_or(&[][..], |manifold| manifold.names());
        return Err(args.ended_early(stop, result.samples, (&source.columns, names)));
    }
    let charges = kept.map(|motion| args.charges(&motion)).transpose()?;
    args.summarize((&source, &watch), &result, force.is_some(), (charges.as_ref(), tube.as_ref(), table.as_ref()))
}

/// Integrates the motion of a model from a state, under a force if there is one, and processes the samples as they arrive.
fn integrate(
    model: &dyn EulerLagrange<f64>,
    force: Option<&KnownForce>,
    (q, v): (&[f64], &[f64]),
    options: &RolloutOptions<f64>,
    samples: &mut Samples<'_>,
) -> Result<Ending<f64>, CliError> {
    let (stop, mut failed) = (interrupt::flag()?, None);
    let moving = Interruptible::new(model, &stop);
    let mut take = |piece: &Trajectory<f64>| {
        failed = samples.take(piece).err();
        let is_over = failed.is_some() || stop.load(Ordering::Relaxed);
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let result = match force {
        Some(force) => Driven::new(&moving, force).rollout_in_pieces(q, v, options, &mut take),
        None => rollout_in_pieces(&moving, q, v, options, &mut take),
    };
    match (failed, &result.stop) {
        (Some(error), _) => Err(error),
        (_, Some(error @ (RolloutError::Invalid { .. } | RolloutError::OffConstraints { .. }))) => Err(refused(error)),
        _ => Ok(result),
    }
}

impl Args {
    /// The error of a motion that ended before its time.
    fn ended_early(&self, stop: &RolloutError, samples: usize, names: (&[String], &[String])) -> CliError {
        let kept = pluralize(samples, "sample is", "samples are");
        let problem = format!("{} ({kept} in {})", ended(stop, names, self.method), place(&self.out));
        match stop {
            RolloutError::Stopped { .. } => CliError::interrupted(problem),
            _ => CliError::data(problem),
        }
    }

    /// Prints a summary of the motion.
    fn summarize(
        &self,
        (source, watch): (&MotionSource, &MotionRecord),
        result: &Ending<f64>,
        is_driven: bool,
        (charges, tube, table): (Option<&Charges>, Option<&MotionTube>, Option<&DataTable>),
    ) -> Result<(), CliError> {
        let (statistics, balance) = (&result.statistics, result.balance.as_ref());
        let model = source.model.as_ref();
        // A free motion conserves the energy; moving constraints and forces change it.
        let is_free = !is_driven && balance.is_none() && model.manifold().is_none();
        let invariant = if is_free { watch.invariant(model) } else { None };
        let facts = Facts {
            system: &source.name,
            samples: result.samples,
            t_end: watch.end,
            time_unit: source.time_unit.as_deref(),
            parameter: source.parameter_name(),
            steps: statistics.accepted,
            evaluations: statistics.evaluations,
            iterations: self.method.is_structure_preserving().then_some(statistics.iterations),
            energy_change: balance.map(|balance| balance.change),
            work: balance.filter(|_| is_driven).map(|balance| balance.work),
            dissipated: balance.map(|balance| balance.dissipated),
            taken_by: if model.is_timed() { "friction, own forces and time" } else { "friction" },
            impacts: balance.filter(|_| source.events.iter().any(Event::is_impact)).map(|balance| balance.impacts),
            energy_defect: balance.map(EnergyBalance::defect),
            events: table.map(DataTable::objects),
            conserved: invariant.map(|invariant| Conserved::new(invariant, watch.energy)),
            left_training_range: watch.leaving.as_ref(),
            charges,
            tube: tube.map(MotionTube::facts),
            out: place(&self.out),
        };
        if self.json {
            return output::print(&facts.json()?);
        }
        let events = table.map_or_else(String::new, events::text);
        self.print(&(facts.text() + &tube.map_or_else(String::new, MotionTube::text) + &events))
    }

    /// Prints a text: on standard error if the samples go to standard output.
    fn print(&self, text: &str) -> Result<(), CliError> {
        if input::is_standard(&self.out) {
            text.lines().for_each(output::note);
            return Ok(());
        }
        output::print(text)
    }
}

/// Reports the number of directions in which the motion is not determined.
fn note_open_directions(model: &dyn EulerLagrange<f64>, t: f64, q: &[f64], v: &[f64]) {
    let mut terms = Terms::default();
    // Failures are reported by the motion itself.
    let _ = model.terms_at(&[t], q, v, Request::MASS_MATRIX | Request::CONSTRAINTS, &mut terms);
    let open = ReducedMass::of(q.len(), &terms.mass_matrix, &terms.constraint_matrix);
    let open = open.map_or(0, |reduced| reduced.null_directions(ROUNDINGS_OF_ZERO).len());
    let directions = pluralize(open, "direction", "directions");
    output::note(&format!(
        "least norm: the mass matrix is singular along {directions} at the start, and the motion does not follow them"
    ));
}

/// Converts the rejection of a motion before it starts to an error that names the option.
fn refused(error: &RolloutError) -> CliError {
    if let RolloutError::OffConstraints { nearest, .. } = error {
        let nearest: Vec<String> = nearest.iter().map(f64::to_string).collect();
        let help =
            if nearest.is_empty() { String::new() } else { format!("; the nearest state is {}", nearest.join(",")) };
        return CliError::usage(format_args!("--state: {error}{help}"));
    }
    let RolloutError::Invalid { what, problem } = error else { return CliError::usage(error) };
    let option = match *what {
        "q" | "v" => "--state".to_string(),
        "t_end" | "dt" | "rtol" | "atol" | "step" | "method" => format!("--{}", what.replace('_', "-")),
        other => other.to_string(),
    };
    CliError::usage(format_args!("{option}: {problem}"))
}

/// Explains why a motion ended early, and names the option that helps.
fn ended(stop: &RolloutError, (columns, constraints): (&[String], &[String]), method: Integrator) -> String {
    let fixed = method.is_structure_preserving();
    match stop {
        RolloutError::LeftDomain { t, component, value, lower, upper, .. } => {
            let column = columns.get(*component).map_or("a component", String::as_str).to_string();
            let leaving = Leaving { t: *t, column, value: *value, trained_on: [*lower, *upper] };
            format!("{}; --beyond-range continues", leaving.text())
        }
        RolloutError::DependentConstraint { t, constraint, .. } => format!(
            "the constraint `{}` depends on the others at t = {t}: the load cannot be divided among them",
            constraints.get(*constraint).map_or("?", String::as_str)
        ),
        RolloutError::SecondBranch { t, constraint, at, .. } => format!(
            "the constraint `{}` has a second branch at t = {at}, where its gradient vanishes or follows from those of the others: the \
             equations do not say which one the motion takes after t = {t}; use a formula that is regular there",
            constraints.get(*constraint).map_or("?", String::as_str)
        ),
        RolloutError::Stopped { t } => format!("interrupted at t = {t}"),
        RolloutError::NotConverged { .. } => format!("{stop}: a shorter --step may help"),
        RolloutError::TooManySteps { .. } if fixed => format!("{stop}: a longer --step needs fewer"),
        RolloutError::TooManySteps { .. } => format!("{stop}: a larger --rtol and --atol need fewer"),
        RolloutError::StepUnderflow { .. } => format!("{stop}: a larger --rtol and --atol may help"),
        other => other.to_string(),
    }
}
