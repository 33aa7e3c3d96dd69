//! Results of `lnn fit`: `summary.json`, tables for a terminal, report.

use crate::configuration::Config;
use crate::findings::Findings;
use crate::formula::{FormulaSummary, FoundFormula, Verdict};
use crate::names::{number, percentage, pluralize};
use crate::network::NetworkLagrangian;
use crate::network::file::Header;
use crate::pipeline::determination::Determined;
use crate::pipeline::hold_out::HoldOut;
use crate::pipeline::members::Members;
use crate::pipeline::physics::Physics;
use crate::pipeline::prepared_fit::PreparedFit;
use crate::pipeline::report_files::{ended, training_pictures, write_page, write_report_and_figures};
use crate::pipeline::time_steps::TimeSteps;
use crate::pipeline::{Output, PipelineError, SUMMARY, headline};
use crate::recording::{HeldOut, Recording, Targets};
use crate::report::Report;
use crate::scalar::Scalar;
use crate::shooting::Fitted;
use crate::training::Trained;
use serde::Serialize;
use std::collections::BTreeMap;

/// One coordinate of `summary.json`: properties of the data and of their smoothing, in SI units.
#[derive(Serialize)]
struct Coordinate {
    name: String,
    noise: f64,
    window_samples: usize,
    window_seconds: f64,
    acceleration_error: f64,
    acceleration_error_relative: f64,
}

/// Contents of `summary.json`.
#[derive(Serialize)]
struct Summary<'a> {
    system: &'a str,
    crate_version: &'static str,
    seed: u64,
    precision: &'static str,
    threads: usize,
    targets: Targets,
    trajectories: [usize; 3],
    samples: [usize; 3],
    time_steps: TimeSteps,
    held_out: &'a HeldOut,
    coordinates: Vec<Coordinate>,
    epochs: usize,
    weights: usize,
    /// Loss in the paper's convention, relative to the accelerations of the training targets, on the validation set; `test_loss` is that on
    /// the held-out set.
    validation_loss: f64,
    /// `None` if nothing was held out.
    test_loss: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    shooting: Option<ShootingSummary>,
    /// Constraints on the motion, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    constraints: Option<ConstraintsSummary<'a>>,
    /// Constants of the known part of a grey box.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    constants: BTreeMap<String, f64>,
    ended: String,
    training_seconds: f64,
    wall_seconds: f64,
    #[serde(flatten)]
    judgement: &'a HoldOut,
    #[serde(flatten)]
    determined: &'a Determined,
    #[serde(skip_serializing_if = "Option::is_none")]
    formula: Option<FormulaSummary<'a>>,
    /// The networks of a fit with several members.
    #[serde(skip_serializing_if = "Option::is_none")]
    members: Option<&'a Members>,
    physics: &'a Physics,
}

/// Constraints in `summary.json`.
#[derive(Serialize)]
struct ConstraintsSummary<'a> {
    /// `true` if they were found in the motion, `false` if they were given.
    found: bool,
    /// The formulas that vanish, by name.
    formulas: &'a BTreeMap<String, String>,
    /// Root mean square distance by which the smoothed training positions were moved onto the constraints.
    distance: f64,
}

/// Multiple shooting in `summary.json`; losses are mean squared residuals in units of noise.
#[derive(Serialize)]
struct ShootingSummary {
    epochs: usize,
    segments: usize,
    steps_per_segment: usize,
    start_loss: f64,
    validation_loss: f64,
    integration_error: f64,
}

/// Header of the table of smoothing errors.
const SMOOTHING: [&str; 6] =
    ["coordinate", "noise [SI]", "window [s]", "window [samples]", "error of a [SI]", "error of a over its rms [%]"];

/// A learned model with its data.
pub(crate) struct Found<'a, S> {
    /// Recorded motion: original, smoothed and split.
    pub prepared: &'a PreparedFit<'a>,
    /// The supervised training.
    pub config: &'a Config,
    /// Threads.
    pub threads: usize,
    /// Result of the supervised training.
    pub trained: &'a Trained<S>,
    /// Constants of the known part of a grey box, by name.
    pub constants: BTreeMap<String, f64>,
    /// Result of multiple shooting, if it was performed.
    pub shot: Option<&'a Fitted<S>>,
    /// Predictions of held-out motion.
    pub hold_out: &'a HoldOut,
    /// Ranges in which the data determine the model.
    pub determined: &'a Determined,
    /// A formula of the Lagrangian, if one was sought.
    pub formula: Option<&'a FoundFormula>,
    /// The networks of a fit with several members.
    pub members: Option<&'a Members>,
    /// Curvature, symmetries and signature.
    pub physics: &'a Physics,
    /// Header and network of the model.
    pub model: (&'a Header, &'a NetworkLagrangian<f64>),
}

impl<'a, S: Scalar> Found<'a, S> {
    /// Writes `summary.json`, `report.html` and pictures; returns the summary as JSON, and the results in words.
    ///
    /// # Errors
    /// [`PipelineError::Output`].
    pub fn write(&self, output: &dyn Output, toml: &str) -> Result<(String, Findings), PipelineError> {
        let (recording, name) = (&self.prepared.reading.recording, self.config.system.as_str());
        let summary = self.summary();
        let json = serde_json::to_string_pretty(&summary).map_err(PipelineError::format)? + "\n";
        output.write(SUMMARY, json.as_bytes())?;
        let formula = self.formula.filter(|formula| formula.verdict == Verdict::Found);
        let formula = formula.map_or_else(Findings::default, |formula| {
            let mut findings = Findings::default();
            findings.heading("The Lagrangian as a formula").append(formula.findings());
            findings
        });
        let headline = headline::of_hold_out(name, self.hold_out, self.determined, self.formula).findings();
        let opening = summary.opening(recording);
        let (judged, determined) = (self.hold_out.findings(), self.determined.findings());
        let members = self.members.map(Members::findings).unwrap_or_default();
        let mut figures = training_pictures(&self.trained.history);
        if let Some(shot) = self.shot {
            let mut later = training_pictures(&shot.history);
            later.iter_mut().for_each(|figure| figure.file.insert_str(0, "shooting_"));
            figures.extend(later);
        }
        let report = Report::new(&format!("{name}: learned from recorded motion"));
        let report = report.findings(&headline).findings(&formula);
        let report = write_page(output, report, self.model, None)?;
        let report = report.section("Predictions of motion that the model has not seen", &self.hold_out.figures);
        let report = report.section("The functions that were learned", &self.physics.figures);
        let report = self.physics.report(report.findings(&judged).findings(&determined).findings(&members));
        let report = report.findings(&opening).section("Training", &figures);
        let report = report.heading("Configuration").preformatted(toml);
        write_report_and_figures(
            output,
            &report,
            figures.iter().chain(&self.hold_out.figures).chain(&self.physics.figures),
        )?;
        let mut whole = headline;
        [formula, opening, judged, determined, members].into_iter().for_each(|part| _ = whole.append(part));
        Ok((json, whole))
    }

    fn summary(&self) -> Summary<'a> {
        let Self { prepared, trained, shot, .. } = self;
        let measured = &prepared.measured;
        let parts = [&measured.training, &measured.validation, &measured.test];
        Summary {
            system: &self.config.system,
            crate_version: env!("CARGO_PKG_VERSION"),
            seed: self.config.seed,
            precision: S::NAME,
            threads: self.threads,
            targets: prepared.targets,
            trajectories: parts.map(|part| part.recording.tracks.len()),
            samples: parts.map(|part| part.recording.samples()),
            time_steps: TimeSteps::new(prepared.reading, &measured.training, prepared.targets),
            held_out: &measured.held_out,
            coordinates: self.coordinates(),
            epochs: trained.history.len(),
            weights: trained.weights.len(),
            validation_loss: trained.validation_loss,
            test_loss: (measured.held_out != HeldOut::Nothing).then(|| trained.test.loss.to_f64()),
            shooting: shot.map(|fitted| ShootingSummary {
                epochs: fitted.history.len(),
                segments: fitted.segments.0,
                steps_per_segment: fitted.steps,
                start_loss: fitted.start_loss,
                validation_loss: fitted.validation_loss,
                integration_error: fitted.integration_error,
            }),
            constraints: prepared.held.as_ref().map(|held| ConstraintsSummary {
                found: held.found,
                formulas: held.constraints.formulas(),
                distance: held.distance,
            }),
            constants: self.constants.clone(),
            ended: ended(&trained.stop),
            training_seconds: trained.seconds + shot.map_or(0.0, |fitted| fitted.seconds),
            wall_seconds: prepared.started.elapsed().as_secs_f64(),
            judgement: self.hold_out,
            determined: self.determined,
            formula: self.formula.map(|formula| formula.summary(&self.config.system)),
            members: self.members,
            physics: self.physics,
        }
    }

    fn coordinates(&self) -> Vec<Coordinate> {
        let PreparedFit { reading, measured, .. } = self.prepared;
        let pairs = reading.recording.coordinates.iter().zip(&measured.smoothing.coordinates);
        pairs
            .map(|(name, chosen)| Coordinate {
                name: name.clone(),
                noise: chosen.noise.sigma,
                window_samples: chosen.quality.window,
                window_seconds: chosen.seconds,
                acceleration_error: chosen.quality.total(2),
                acceleration_error_relative: chosen.quality.relative(),
            })
            .collect()
    }
}

impl Summary<'_> {
    /// Describes data, losses and times of the run, with the table of smoothing errors.
    fn opening(&self, recording: &Recording) -> Findings {
        let mut findings = Findings::default();
        findings.heading("Data and training").line(self.learned_from());
        findings.lines(self.time_steps.lines()).line(self.judged_on(recording)).gap();
        let row = |c: &Coordinate| {
            let error = c.acceleration_error_relative;
            vec![
                c.name.clone(),
                number(c.noise),
                number(c.window_seconds),
                c.window_samples.to_string(),
                number(c.acceleration_error),
                if error.is_finite() { percentage(error) } else { "no larger than its error".to_string() },
            ]
        };
        findings.table(&SMOOTHING, self.coordinates.iter().map(row)).gap();
        findings.line(self.losses());
        if let Some(shooting) = &self.shooting {
            findings.line(format!(
                "mean squared residual of predictions, in units of the noise: {} before, {} after {} over {} (1 is noise alone)",
                number(shooting.start_loss),
                number(shooting.validation_loss),
                pluralize(shooting.epochs, "epoch", "epochs"),
                pluralize(shooting.segments, "segment", "segments")
            ));
        }
        if let Some(ConstraintsSummary { found, formulas, distance }) = &self.constraints {
            let how = if *found { "found in the motion" } else { "given" };
            let all: Vec<String> = formulas.values().map(|formula| format!("{formula} = 0")).collect();
            findings.line(format!(
                "under constraints, {how}: {}; smoothed positions were {} away from them, root mean square",
                all.join("; "),
                number(*distance)
            ));
        }
        if !self.constants.is_empty() {
            let one = |(name, &x): (&String, &f64)| match self.determined.constant(name) {
                Some(range) => format!("{name} {} ({} to {})", number(x), number(range.low), number(range.high)),
                None => format!("{name} {}", number(x)),
            };
            let constants: Vec<String> = self.constants.iter().map(one).collect();
            findings.line(format!("constants of the known part: {}", constants.join(", ")));
        }
        findings.line(format!("{:.1} s of training, {:.1} s in all", self.training_seconds, self.wall_seconds));
        findings
    }

    /// Describes what the network learned from.
    fn learned_from(&self) -> String {
        let source = match self.targets {
            Targets::Measured => "measured accelerations",
            Targets::Smoothed => "smoothed accelerations",
            Targets::Forces => "known forces",
            Targets::Motion => "the motion itself (multiple shooting)",
        };
        let samples = pluralize(self.samples[0], "sample", "samples");
        format!("learned from {source}: {samples} of {}", pluralize(self.trajectories[0], "trajectory", "trajectories"))
    }

    /// Describes which data chose the best epoch, and which tested the model.
    fn judged_on(&self, recording: &Recording) -> String {
        let [_, validation, test] = self.samples;
        match self.held_out {
            HeldOut::Nothing => "best epoch chosen on the same samples; nothing was held out for a test".to_string(),
            held => {
                let held = held.describe(recording);
                format!("best epoch chosen on {validation} samples, judged on {test} that were held out: {held}")
            }
        }
    }

    /// Describes losses, epochs and number of weights.
    fn losses(&self) -> String {
        let of = match self.targets {
            Targets::Forces => "forces, each divided by its expected error",
            _ => "accelerations",
        };
        let held_out = self.test_loss.map_or(String::new(), |loss| match loss {
            x if x.is_finite() => format!(", held out {}", number(x)),
            _ => ", held out not finite".to_string(),
        });
        format!(
            "loss (paper) against those {of}: validation {}{held_out}; {}, {}, seed {}",
            number(self.validation_loss),
            pluralize(self.epochs, "epoch", "epochs"),
            pluralize(self.weights, "weight", "weights"),
            self.seed
        )
    }
}
