//! Times, integrator and accuracy of a motion, as arguments, and its errors by their names.

use crate::CliError;
use crate::arguments::motion_source::MotionSource;
use crate::arguments::number::{choice, finite, positive, tolerance};
use crate::terminal::output;
use lnn::names::pluralize;
use lnn::report::Leaving;
use lnn::rollout::{Integrator, RolloutError, RolloutOptions};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct IntegrationArgs {
    /// Time of the last sample, in the time unit of the system; for geodesics of a space-time an affine parameter, the proper time of
    /// matter. For a time before the start the motion runs backwards.
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = finite)]
    pub t_end: f64,
    /// Time of the start, in the same unit; it matters only where forces or the system depend on the time.
    #[arg(long, value_name = "T", default_value = "0", allow_hyphen_values = true, value_parser = finite)]
    pub t_start: f64,
    /// Time between samples, in the same unit.
    #[arg(long, value_name = "DT", allow_hyphen_values = true, value_parser = positive)]
    dt: f64,
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
    pub beyond_range: bool,
}

impl IntegrationArgs {
    /// The options of the motion of a source.
    ///
    /// # Errors
    /// A usage error for a step of an integrator that chooses its own, and for what the integrator rejects.
    pub fn options(&self, source: &MotionSource) -> Result<RolloutOptions<f64>, CliError> {
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

    /// The error of a motion that ended early, after samples in a place, with the option that helps.
    pub fn ended(
        &self,
        stop: &RolloutError,
        names: (&[String], &[String]),
        (samples, place): (usize, &str),
    ) -> CliError {
        let kept = pluralize(samples, "sample is", "samples are");
        let problem = format!("{} ({kept} in {place})", self.explained(stop, names));
        match stop {
            RolloutError::Stopped { .. } => CliError::interrupted(problem),
            _ => CliError::data(problem),
        }
    }

    fn explained(&self, stop: &RolloutError, (columns, constraints): (&[String], &[String])) -> String {
        let fixed = self.method.is_structure_preserving();
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
}

/// Converts the rejection of a motion before it starts to an error that names the option.
pub fn refused(error: &RolloutError) -> CliError {
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
