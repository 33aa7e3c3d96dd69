//! Constraints of a fit: found in the training motion, or given.

use crate::constraints::{ConstraintKind, ConstraintSearch, FoundConstraints, MotionSamples, OBEDIENCE};
use crate::data::{Dataset, RecordingSplit};
use crate::lagrangian::FormulaConstraints;
use crate::names::{pluralize, rounded};
use crate::pipeline::PipelineError;
use crate::pipeline::fit_config::{FitConstraints, FitOptions};
use crate::pipeline::thresholds::CONSTRAINT_STATES;
use crate::recording::smooth::Smoothed;

/// Constraints on recorded motion.
#[derive(Debug)]
pub(crate) struct FitHeld {
    pub constraints: FormulaConstraints,
    /// `true` if they were found in the motion.
    pub found: bool,
    /// Root mean square distance of the smoothed training positions from the constraints.
    pub distance: f64,
}

impl FitHeld {
    /// Determines the independent constraints that the options request, if any, and remarks on them.
    ///
    /// # Errors
    /// [`PipelineError::Constraints`].
    pub fn new(options: &FitOptions, measured: &RecordingSplit) -> Result<(Option<Self>, Vec<String>), PipelineError> {
        let recording = &measured.training.recording;
        let mut remarks = Vec::new();
        let (formulas, found) = match &options.constraints {
            FitConstraints::None => return Ok((None, remarks)),
            FitConstraints::Formulas(formulas) => (formulas.clone(), false),
            FitConstraints::Find => {
                let samples = MotionSamples::of(recording, &options.preparation().smoothing)?;
                let found =
                    FoundConstraints::of(&samples, ConstraintSearch::default()).map_err(PipelineError::constraints)?;
                let on = pluralize(found.trajectories, "trajectory", "trajectories");
                let formulas = found.formulas();
                remarks.push(match formulas.len() {
                    0 => format!("no constraints were found on {on}: every coordinate is learned as free"),
                    count => {
                        let all: Vec<String> = formulas.values().map(|formula| format!("{formula} = 0")).collect();
                        format!("{} found on {on}: {}", pluralize(count, "constraint", "constraints"), all.join("; "))
                    }
                });
                let left_out = found.constraints.iter().filter_map(|found| match found.kind {
                    ConstraintKind::Nearly => {
                        Some(format!("{} nearly vanishes, by more than the noise explains", found.formula))
                    }
                    ConstraintKind::Branching => {
                        Some(format!("{} vanishes, and its gradient with it along the motion", found.formula))
                    }
                    _ => None,
                });
                remarks.extend(left_out.map(|why| format!("{why}: it is not taken for a constraint")));
                if found.trajectories == 1 && !formulas.is_empty() {
                    remarks.push(
                        "one trajectory does not tell what is imposed from what its motion conserves".to_string(),
                    );
                }
                if formulas.is_empty() {
                    return Ok((None, remarks));
                }
                (formulas, true)
            }
        };
        let constraints =
            FormulaConstraints::new(&recording.coordinates, formulas).map_err(PipelineError::constraints)?;
        let every = measured
            .training
            .states
            .iter()
            .map(|states| states.times.len())
            .sum::<usize>()
            .div_ceil(CONSTRAINT_STATES)
            .max(1);
        let n = recording.n();
        let some = |of: fn(&Smoothed) -> &Vec<f64>| -> Vec<f64> {
            let rows = measured.training.states.iter().flat_map(|states| of(states).chunks_exact(n));
            rows.step_by(every).flatten().copied().collect()
        };
        let (q, v) = (some(|states| &states.q), some(|states| &states.v));
        let (constraints, redundant) = constraints.independent(&q, &v).map_err(PipelineError::constraints)?;
        remarks.extend(
            redundant.iter().map(|name| format!("the constraint `{name}` follows from the others and is left out")),
        );
        Ok((Some(Self { constraints, found, distance: f64::NAN }), remarks))
    }

    /// Projects states onto the constraints; also returns the root mean square distance of their positions.
    ///
    /// # Errors
    /// [`PipelineError::Constraints`] for a state that cannot be projected.
    pub fn bring(&self, set: Dataset<f64>) -> Result<(Dataset<f64>, f64), PipelineError> {
        let manifold = self.constraints.manifold().map_err(PipelineError::constraints)?;
        set.brought_to(&manifold).map_err(PipelineError::constraints)
    }

    /// Stores the distance of recorded states, and rejects constraints if it exceeds the noise, `(n)`.
    ///
    /// # Errors
    /// [`PipelineError::Constraints`].
    pub fn require_obedience(&mut self, set: Dataset<f64>, noise: &[f64]) -> Result<(), PipelineError> {
        let square = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
        let size = (square(set.q()) / set.len() as f64).sqrt();
        let (_, distance) = self.bring(set)?;
        self.distance = distance;
        let allowed = f64::max(OBEDIENCE.0 * square(noise).sqrt(), OBEDIENCE.1 * size);
        if distance <= allowed {
            return Ok(());
        }
        let [distance, size] = [distance, size].map(|x| rounded(x, 3));
        let problem = "the recorded motion does not obey them: its positions are";
        Err(PipelineError::constraints(format_args!(
            "constraints: {problem} {distance} away, root mean square, at a size of {size}"
        )))
    }
}
