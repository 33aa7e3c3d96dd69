//! A first look at recorded motion: what it is, whether a simple law explains it, and what to do next.

use crate::cancellation::{Cancellation, Cancelled};
use crate::configuration::Precision;
use crate::constraints::{ConstraintSearch, ConstraintSearchError, FoundConstraints, MotionSamples};
use crate::findings::Findings;
use crate::formula::{FormulaError, FormulaOptions, FoundFormula, Verdict};
use crate::pipeline::thresholds::{FIRST_LOOK_COORDINATES, FIRST_LOOK_LEAST, FIRST_LOOK_SAMPLES, FIRST_LOOK_TIME};
use crate::pipeline::{FitOptions, PipelineError, PreparedFit};
use crate::recording::smooth::SmoothOptions;
use crate::recording::survey::{Survey, SurveyOptions, survey};
use crate::recording::{ColumnGuess, LoadedRecording, RecordedTrajectory, Recording};
use serde::{Serialize, Serializer};

/// The recommended next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NextStep {
    /// Correct the data, because no model can learn from them.
    Mend,
    /// Record other motion, because nothing accelerates.
    Record,
    /// Fit equations of first order by another tool, or record motion under other forces: the velocities follow from the positions.
    FirstOrder,
    /// Use the formula that explains the motion; if the search reached its time limit, search for longer.
    Formula,
    /// Learn a network under the constraints that were found.
    FitConstrained,
    /// Learn a network.
    Fit,
}

/// The survey of a recording, the laws that were sought, and the resulting advice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirstLook {
    /// The guessed roles of the columns; empty if all were named.
    pub guessed: Vec<ColumnGuess>,
    /// The survey.
    #[serde(flatten)]
    pub survey: Survey,
    /// Why a fit cannot learn from the data; `None` if it can.
    pub obstacle: Option<String>,
    /// Number of samples in which constraints and a formula were sought.
    pub searched: usize,
    /// Constraints that the motion obeys; none if they were not sought.
    pub constraints: Option<FoundConstraints>,
    /// The formula that explains the motion, if one of the small ones does.
    #[serde(serialize_with = "text_of")]
    pub formula: Option<FoundFormula>,
    /// `true` if the search for a formula reached its time limit.
    pub unfinished: bool,
    /// The recommended next step.
    pub next: NextStep,
}

/// A formula as its text.
fn text_of<S: Serializer>(formula: &Option<FoundFormula>, to: S) -> Result<S::Ok, S::Error> {
    formula.as_ref().map(|found| found.text(false)).serialize(to)
}

impl FirstLook {
    /// Surveys a recording; `guessed` are the guessed roles of its columns. Constraints and formulas are sought in parts of the
    /// trajectories, of at most 2000 samples together, and formulas for at most 2 s.
    ///
    /// # Errors
    /// [`PipelineError::Smooth`] for trajectories too short for any window, [`PipelineError::Interrupted`].
    pub fn new(
        reading: &LoadedRecording,
        guessed: Vec<ColumnGuess>,
        cancellation: &Cancellation,
    ) -> Result<Self, PipelineError> {
        let survey = survey(reading, &SurveyOptions::default())?;
        // A fit is possible if its preparation succeeds.
        let prepared = PreparedFit::new(reading, &FitOptions::default());
        let obstacle = prepared.and_then(|prepared| prepared.suggest("", Precision::F64)).err();
        let obstacle = obstacle.map(|error| error.to_string());
        let some = part(&reading.recording);
        let searched = some.samples();
        // Equations of first order are relations of positions and velocities, but no constraints.
        let moves = survey.accelerates && survey.motionless.is_empty() && survey.first_order.is_none();
        let search = obstacle.is_none() && moves;
        let constraints = if search { constraints(&some, cancellation)? } else { None };
        let held = constraints.as_ref().is_some_and(|found| found.count > 0);
        let (formula, unfinished) = if search && !held { formula(&some, cancellation)? } else { (None, false) };
        let next = match (&obstacle, &formula) {
            _ if !survey.accelerates => NextStep::Record,
            _ if survey.first_order.is_some() => NextStep::FirstOrder,
            (Some(_), _) => NextStep::Mend,
            _ if held => NextStep::FitConstrained,
            (None, Some(_)) => NextStep::Formula,
            _ if unfinished => NextStep::Formula,
            _ => NextStep::Fit,
        };
        Ok(Self { guessed, survey, obstacle, searched, constraints, formula, unfinished, next })
    }

    /// Reports the verdict, the roles of the columns, the survey, the laws and the warnings.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        findings.line(match &self.obstacle {
            _ if self.next == NextStep::Record => {
                "Nothing accelerates here beyond the noise: this motion does not determine a Lagrangian.".to_string()
            }
            _ if self.next == NextStep::FirstOrder => {
                "The velocities follow from the positions and other columns, as in motion of first order, which no Lagrangian describes.".to_string()
            }
            Some(obstacle) => format!("A fit cannot learn from these data: {obstacle}."),
            None => self.survey.headline(),
        });
        if !self.guessed.is_empty() {
            let rows = self.guessed.iter().map(|g| [g.column.as_str(), g.meaning.as_str(), g.because.as_str()]);
            findings.gap().table(&["column", "taken as", "because"], rows);
        }
        findings.gap().append(self.survey.findings());
        if self.obstacle.is_none() && self.next != NextStep::FirstOrder {
            findings.gap().append(self.survey.advice());
        }
        findings.lines(self.laws()).lines(self.survey.warnings.iter().map(|warning| format!("warning: {warning}")));
        findings
    }

    /// Describes each law in a sentence, with the advice to use it instead of a network without prior knowledge.
    pub fn laws(&self) -> Vec<String> {
        let mut laws = Vec::new();
        if let Some(found) = &self.constraints {
            // A single trajectory cannot distinguish a constraint from an orbit.
            let limit = match found.trajectories {
                1 => " (a single trajectory may conserve it instead)",
                _ => "",
            };
            let stays = |formula: String| format!("the motion stays on {formula} = 0{limit}: add --constraints find");
            laws.extend(found.formulas().into_values().map(stays));
        }
        if let Some(found) = &self.formula {
            laws.push(format!("a formula explains this motion: L = {}", found.text(false)));
            if self.has_friction() {
                laws.push(format!("its friction is D = {}", found.text(true)));
            }
        }
        if self.unfinished {
            laws.push(format!(
                "no formula was found within {} s; a longer search may find one",
                FIRST_LOOK_TIME.as_secs()
            ));
        }
        if !laws.is_empty() && self.searched < self.survey.samples {
            laws.push(format!("laws were looked for in {} of the {} samples", self.searched, self.survey.samples));
        }
        laws
    }

    /// `true` if the formula should be sought with friction: it contains friction, or the search reached its time limit.
    pub fn has_friction(&self) -> bool {
        self.unfinished || self.formula.iter().flat_map(|found| &found.terms).any(|term| term.dissipation)
    }
}

/// Takes the beginnings of the trajectories, with a limited number of samples in total.
fn part(recording: &Recording) -> Recording {
    let most = (FIRST_LOOK_SAMPLES / recording.tracks.len().max(1)).max(FIRST_LOOK_LEAST);
    let n = recording.n();
    let cut = |track: &RecordedTrajectory| {
        let samples = track.len().min(most);
        let of = |values: &Vec<f64>| values[..values.len().min(samples * n)].to_vec();
        RecordedTrajectory {
            name: track.name.clone(),
            times: track.times[..samples].to_vec(),
            q: of(&track.q),
            v: of(&track.v),
            a: of(&track.a),
            force: of(&track.force),
        }
    };
    let tracks = recording.tracks.iter().take(FIRST_LOOK_SAMPLES / FIRST_LOOK_LEAST).map(cut).collect();
    Recording { tracks, ..recording.clone() }
}

/// Searches for constraints on several coordinates; `None` if the search is not possible.
fn constraints(recording: &Recording, stop: &Cancellation) -> Result<Option<FoundConstraints>, PipelineError> {
    if recording.n() < 2 {
        return Ok(None);
    }
    let Ok(samples) = MotionSamples::of(recording, &SmoothOptions::default()) else { return Ok(None) };
    match FoundConstraints::of(&samples.watched(stop), ConstraintSearch::default()) {
        Err(ConstraintSearchError::Cancelled(_)) => Err(PipelineError::Interrupted),
        found => Ok(found.ok()),
    }
}

/// Searches for a formula of few coordinates, with friction if it helps; also returns whether the search reached its time limit.
fn formula(recording: &Recording, stop: &Cancellation) -> Result<(Option<FoundFormula>, bool), PipelineError> {
    if recording.n() > FIRST_LOOK_COORDINATES {
        return Ok((None, false));
    }
    let cancellation = stop.within(FIRST_LOOK_TIME);
    let options = FormulaOptions {
        friction: true,
        friction_of_position: false,
        drive: false,
        bootstraps: 0,
        cancellation,
        ..FormulaOptions::default()
    };
    match FoundFormula::of_motion(recording, &options) {
        Err(FormulaError::Cancelled(Cancelled)) if stop.is_cancelled() => Err(PipelineError::Interrupted),
        Err(FormulaError::Cancelled(Cancelled)) => Ok((None, true)),
        found => Ok((found.ok().filter(|found| found.verdict == Verdict::Found && found.doubts.is_empty()), false)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Swings on circles of these radii, with noise of 1e-4.
    fn circles(radii: &[f64]) -> Recording {
        let track = |&r: &f64| {
            let times: Vec<f64> = (0..400).map(|k| 0.02 * f64::from(k)).collect();
            let noise = |k: usize| 1e-4 * (1.7 * ((k * k) as f64)).sin();
            let angle = |t: &f64| 1.5 * t.cos() + 0.4 * (1.7 * t).sin();
            let point = |(k, t)| [r * angle(t).cos() + noise(k), r * angle(t).sin() + noise(k + 1000)];
            let q = times.iter().enumerate().flat_map(point).collect();
            RecordedTrajectory { name: r.to_string(), times, q, v: vec![], a: vec![], force: vec![] }
        };
        let coordinates = ["x", "y"].map(String::from).to_vec();
        Recording { coordinates, periodic: vec![false; 2], tracks: radii.iter().map(track).collect() }
    }

    #[test]
    fn one_orbit_may_conserve_what_two_rods_hold() {
        let look = |radii: &[f64]| {
            let stop = Cancellation::default();
            FirstLook::new(&LoadedRecording::from(circles(radii)), Vec::new(), &stop).unwrap()
        };
        let stays =
            |look: &FirstLook| look.laws().iter().filter(|law| law.contains("stays on")).cloned().collect::<Vec<_>>();
        // Two runs on one rod; one run, which may be an orbit; two orbits, which are under no constraint.
        let (rod, orbit, orbits) = (look(&[1.0, 1.0]), look(&[1.0]), look(&[1.0, 1.5]));
        assert!(stays(&rod).len() == 1 && !stays(&rod)[0].contains("conserve"), "{:?}", rod.laws());
        assert!(stays(&orbit).len() == 1 && stays(&orbit)[0].contains("conserve"), "{:?}", orbit.laws());
        assert!(stays(&orbits).is_empty(), "{:?}", orbits.laws());
        assert_eq!((rod.next, rod.searched), (NextStep::FitConstrained, 800));
        assert!(orbits.next != NextStep::FitConstrained && orbits.next != NextStep::Record);
    }
}
