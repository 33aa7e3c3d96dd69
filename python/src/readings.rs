//! What is read off recorded motion: what it is, its constraints, its Lagrangian as a formula, the constants of a form that is known.

use crate::attend::whole;
use crate::errors::{pipeline, runtime, value};
use crate::recorded::{Motion, Source};
use crate::subject::Subject;
use lnn::constraints::{ConstraintSearch, FoundConstraints, MotionSamples};
use lnn::findings::Findings;
use lnn::formula::{Families, FormulaOptions, FoundFormula, MOST_BOOTSTRAPS};
use lnn::identification::{Between, IdentifyOptions, identify as identified};
use lnn::pipeline::{FirstLook, NextStep};
use lnn::recording::SmoothOptions;
use lnn::report::Report;
use pyo3::prelude::*;
use serde::Serialize;
use serde_json::json;

/// What recorded motion is, whether a simple law explains it, and what to do next, as JSON.
#[pyfunction]
pub fn check(py: Python<'_>, motion: Motion) -> PyResult<String> {
    let source = Source::of(motion)?;
    whole(py, None, |watch| {
        let (loaded, meaning, guessed) = source.look()?;
        let look = FirstLook::new(&loaded, guessed, &watch.cancellation()).map_err(pipeline)?;
        let mut findings = look.findings();
        let verb = match look.next {
            NextStep::Mend | NextStep::Record | NextStep::FirstOrder => None,
            NextStep::Formula => Some("formula"),
            NextStep::Fit | NextStep::FitConstrained => Some("fit"),
        };
        let more = match look.next {
            NextStep::FitConstrained => ", constraints=\"find\"",
            NextStep::Formula if look.has_friction() => ", friction=True",
            _ => "",
        };
        let call = verb.map(|verb| format!("lnn.{verb}({meaning}{more})"));
        if let Some(call) = &call {
            findings.heading("next:").code(format!("  {call}"));
        }
        let constraints = look.constraints.as_ref().map(|found| found.formulas()).unwrap_or_default();
        shown(&json!({ "facts": look, "call": call, "constraints": constraints }), &findings)
    })?
}

/// The constraints of recorded motion, as JSON; `degrees` are those of functions of the coordinates and of factors of velocities.
#[pyfunction(name = "find_constraints")]
pub fn constraints_of_motion(py: Python<'_>, motion: Motion, degrees: (usize, usize)) -> PyResult<String> {
    let (degree, velocity_degree) = degrees;
    for (what, least, given) in [("degree", 1, degree), ("velocity_degree", 0, velocity_degree)] {
        let most = ConstraintSearch::MOST_DEGREE;
        if !(least..=most).contains(&given) {
            return Err(value(format_args!("{what}: expected {least} to {most}, found {given}")));
        }
    }
    let source = Source::of(motion)?;
    whole(py, None, |watch| {
        let recording = source.read()?.recording;
        let samples = MotionSamples::of(&recording, &SmoothOptions::default()).map_err(value)?;
        let samples = samples.watched(&watch.cancellation());
        let found = FoundConstraints::of(&samples, ConstraintSearch { degree, velocity_degree }).map_err(value)?;
        shown(&found, &found.findings())
    })?
}

/// The Lagrangian of recorded motion as a formula, as JSON.
#[pyfunction]
pub fn formula(py: Python<'_>, motion: Motion, choices: &str) -> PyResult<String> {
    let (mut options, name) = FormulaChoices::read(choices)?;
    let source = Source::of(motion)?;
    whole(py, None, |watch| {
        options.cancellation = watch.cancellation();
        let recording = source.read()?.recording;
        formula_shown(&FoundFormula::of_motion(&recording, &options).map_err(value)?, &name)
    })?
}

/// The constants of a system whose form is known, as JSON; samples far from the motion by trajectory and row.
#[pyfunction]
pub fn identify(py: Python<'_>, motion: Motion, system: &Subject, choices: &str) -> PyResult<String> {
    // The other choices have their types from Python.
    let mut options: IdentifyOptions =
        serde_json::from_str(choices).map_err(|error| value(format_args!("targets, between: {error}")))?;
    let (source, instance) = (Source::whole(motion)?, system.system_instance()?);
    whole(py, None, |watch| {
        options.cancellation = watch.cancellation();
        let mut loaded = source.read()?;
        let options = options.of_recording(&loaded);
        // Data in memory may have names of their own.
        let columns = instance.readings().iter().map(|reading| &reading.column);
        if columns.eq(&loaded.recording.coordinates) {
            loaded = loaded.measured_by(&instance);
        }
        let found = identified(&instance, &loaded.recording, &options).map_err(value)?.with_rows_of(&loaded);
        shown(&found, &found.findings())
    })?
}

/// Choices of a search for a formula, as JSON.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaChoices {
    basis: Option<String>,
    functions: Vec<String>,
    gyroscopic: bool,
    friction: bool,
    drive: bool,
    noise: Option<Vec<f64>>,
    scale: Option<(String, f64)>,
    bootstraps: usize,
    seed: u64,
    threads: usize,
    name: String,
    between: Option<Between>,
}

impl FormulaChoices {
    /// The options, and the name of the system that the formula makes.
    ///
    /// # Errors
    /// `ValueError` for a choice that is none.
    pub fn read(choices: &str) -> PyResult<(FormulaOptions, String)> {
        let Self {
            basis,
            functions,
            gyroscopic,
            friction,
            drive,
            noise,
            scale,
            bootstraps,
            seed,
            threads,
            name,
            between,
        } = serde_json::from_str(choices).map_err(value)?;
        let families = basis.map(|text| text.parse::<Families>()).transpose();
        let families = families.map_err(|problem| value(format_args!("basis: {problem}")))?;
        if !(1..=MOST_BOOTSTRAPS).contains(&bootstraps) {
            return Err(value(format_args!("bootstraps: expected 1 to {MOST_BOOTSTRAPS}, found {bootstraps}")));
        }
        if noise.iter().flatten().any(|x| !(x.is_finite() && *x > 0.0)) {
            return Err(value("noise: expected positive numbers"));
        }
        if scale.iter().any(|(_, x)| !x.is_finite() || *x == 0.0) {
            return Err(value("scale: expected a term and a number that is not 0"));
        }
        let options = FormulaOptions {
            families,
            functions,
            gyroscopic,
            friction,
            drive,
            noise,
            scale,
            bootstraps,
            seed,
            threads,
            between,
            ..FormulaOptions::default()
        };
        Ok((options, name))
    }
}

/// A formula, and the system file of this name, as JSON.
pub fn formula_shown(found: &FoundFormula, name: &str) -> PyResult<String> {
    shown(&found.summary(name), &found.findings())
}

/// A result as JSON, with what it says for a terminal and for a notebook.
pub fn shown(result: &impl Serialize, findings: &Findings) -> PyResult<String> {
    let (text, html) = said(findings);
    serde_json::to_string(&json!({ "result": result, "text": text, "html": html })).map_err(runtime)
}

/// Findings for a terminal and for a notebook.
pub fn said(findings: &Findings) -> (String, String) {
    (findings.to_string(), Report::new("").findings(findings).fragment().to_string())
}
