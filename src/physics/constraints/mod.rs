//! Constraints found in recorded motion: functions of the coordinates that vanish, and rows linear in the velocities.
//!
//! Combinations `c` of monomials of the coordinates are judged by a pencil of two forms: their mean square `G = mean D D^T`, and the
//! contribution of noise `N = mean sum_i sigma_i^2 dD/dq_i dD/dq_i^T`; `c.G c / c.N c` is near 1 for a combination that vanishes within the
//! noise. The minima of this ratio are an errors-in-variables fit (Taubin 1991). The search goes degree by degree and excludes multiples of the
//! leading terms of combinations that already vanish (Heldt et al. 2009). It takes the simplest combinations with independent gradients, each
//! reduced to the terms it needs. The same search over `monomials(q) v_i`, beyond the consequences of the former, gives the rows that are linear
//! in the velocities; Frobenius' condition identifies those that are derivatives of a function of the coordinates.

mod colour;
mod examine;
mod features;
mod generators;
mod independence;
mod integrable;
mod pencil;
mod regular;
mod report;
mod samples;
#[cfg(test)]
mod tests;
mod thresholds;

#[doc(hidden)]
pub use examine::{ExaminedLagrangian, examine};
pub use samples::MotionSamples;
#[doc(hidden)]
pub use thresholds::EXAMINED_STATES;
pub(crate) use thresholds::OBEDIENCE;

use crate::cancellation::Cancelled;
use features::Features;
use generators::{Generator, Limits, Vanishing};
use independence::{RowsTaken, independent_everywhere};
use integrable::integrable;
use regular::{branching, phases};
use serde::Serialize;
use std::collections::BTreeMap;
use thresholds::{FURTHER_CANDIDATE, GRADIENT_STATES, INDEPENDENCE_STATES, MOST_TERMS, NEW_FUNCTION, SAMPLES_PER_TERM};

/// Options of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConstraintSearch {
    /// Largest total degree of functions of the coordinates.
    pub degree: usize,
    /// Largest total degree of the coefficients of velocities.
    pub velocity_degree: usize,
}

impl ConstraintSearch {
    /// Largest degree of terms.
    pub const MOST_DEGREE: usize = 8;
}

impl Default for ConstraintSearch {
    fn default() -> Self {
        Self { degree: 2, velocity_degree: 1 }
    }
}

/// Kind of a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ConstraintKind {
    /// A function of the coordinates that vanishes.
    Holonomic,
    /// Linear in the velocities, and not the derivative of a function of the coordinates.
    Nonholonomic,
    /// A function of the coordinates that is constant along each trajectory, with a different constant for each: conserved, not imposed.
    PerTrajectory,
    /// A function or a row that nearly vanishes, but not within the noise: a stiff spring, an arc that looks straight. It is not a constraint.
    Nearly,
    /// A function whose gradient vanishes somewhere along the motion, or depends on the gradients of others there: a second branch begins,
    /// and the function does not determine which branch the motion takes. It cannot serve as a constraint.
    Branching,
}

impl ConstraintKind {
    /// `true` for a constraint of the system.
    pub fn is_imposed(self) -> bool {
        matches!(self, Self::Holonomic | Self::Nonholonomic)
    }
}

/// A constraint that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundConstraint {
    /// Its kind.
    pub kind: ConstraintKind,
    /// The formula that vanishes or is constant.
    pub formula: String,
    /// Factors of its terms; the leading term has the factor 1.
    pub coefficients: BTreeMap<String, f64>,
    /// 95 % confidence intervals of the factors.
    pub range: BTreeMap<String, [f64; 2]>,
    /// Root mean square of the residual, relative to that of the noise.
    pub defect: f64,
}

/// Result of a search for constraints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundConstraints {
    /// Number of constraints of the system, holonomic and nonholonomic.
    pub count: usize,
    /// Constraints and other functions that were found, by kind.
    pub constraints: Vec<FoundConstraint>,
    /// Ratio of the smallest combination that does not vanish to the largest that does, both relative to noise: the smallest over the degrees of
    /// the constraints. Relative to the noise itself if none vanishes.
    pub gap: Option<f64>,
    /// Number of trajectories.
    pub trajectories: usize,
    /// Candidates that failed on held-out trajectories.
    pub refuted: usize,
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// Noise of each coordinate relative to its size: smaller deviations are not visible.
    pub noise: Vec<f64>,
    /// Columns that do not move and were left out, with the reason.
    pub still: BTreeMap<String, String>,
    /// Limits of the search, in words.
    pub limits: Vec<String>,
}

impl FoundConstraints {
    /// Formulas of the constraints of the system by name, as in a table `[constraints]`; quantities that single trajectories conserve are not
    /// included.
    pub fn formulas(&self) -> BTreeMap<String, String> {
        let of_system = self.constraints.iter().filter(|found| found.kind.is_imposed());
        of_system.enumerate().map(|(k, found)| (format!("found {}", k + 1), found.formula.clone())).collect()
    }
}

/// Why a search for constraints is not possible.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConstraintSearchError {
    /// The search was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Too many terms.
    #[error("{what} gives {found} terms, at most {MOST_TERMS} can be searched together")]
    Terms {
        /// Kind of the terms.
        what: &'static str,
        /// Number of terms.
        found: usize,
    },
    /// Fewer samples than terms need.
    #[error("{found} samples are too few for {terms} terms, expected {needed} at least")]
    Samples {
        /// Number of terms.
        terms: usize,
        /// Samples found.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
}

impl FoundConstraints {
    /// Finds the constraints of recorded motion.
    ///
    /// # Errors
    /// [`ConstraintSearchError`] for too many terms or too few samples.
    pub fn of(samples: &MotionSamples, search: ConstraintSearch) -> Result<Self, ConstraintSearchError> {
        let (of_positions, of_velocities, mut cut_short) = searched_terms(samples, search)?;
        let mut held = RowsTaken::at(samples, GRADIENT_STATES);
        let stop = &samples.cancellation;
        stop.stage("functions that vanish");
        let limits = Limits::of(samples);
        let vanishing = Vanishing::of(samples, &of_positions, None, false, (1.0, limits));
        let (candidates, all_forms) = vanishing.generators();
        if !all_forms {
            cut_short
                .push("the search for formulas with few terms was stopped early: simpler ones may exist".to_string());
        }
        stop.check()?;
        let functions = held.take(samples, &of_positions, candidates.clone(), false, NEW_FUNCTION);
        let gap = vanishing.gap(&functions);
        let functions = independent_everywhere(samples, &of_positions, functions, candidates);
        stop.check()?;
        let mut constraints = described_functions(samples, &of_positions, limits, functions);
        stop.stage("functions that are constant");
        if samples.trajectories() > 1 {
            let constant = Vanishing::of(samples, &of_positions, Some(&vanishing), true, (1.0, limits));
            let conserved = held.take(samples, &of_positions, constant.generators().0, false, FURTHER_CANDIDATE);
            constraints
                .extend(conserved.iter().map(|found| found.described(&of_positions, ConstraintKind::PerTrajectory)));
        }
        stop.check()?;
        stop.stage("rows of velocities");
        constraints.extend(velocity_rows(samples, &of_velocities, (&vanishing, limits), &mut held));
        stop.check()?;
        let count = constraints.iter().filter(|found| found.kind.is_imposed()).count();
        Ok(FoundConstraints {
            count,
            constraints,
            gap,
            trajectories: samples.trajectories(),
            refuted: held.refuted,
            coordinates: samples.names().to_vec(),
            noise: samples.relative_noise(),
            still: samples.still(),
            limits: cut_short,
        })
    }
}

/// The terms of functions of the coordinates and of rows linear in the velocities, and what the search leaves out, in words.
fn searched_terms(
    samples: &MotionSamples,
    search: ConstraintSearch,
) -> Result<(Features, Features, Vec<String>), ConstraintSearchError> {
    let of_positions = Features::of_positions(samples, search.degree);
    // With many coordinates, the highest degree that is not too large.
    let (degree, of_velocities) = (0..=search.velocity_degree)
        .rev()
        .map(|degree| (degree, Features::of_velocities(samples, degree)))
        .find(|(_, features)| features.len() <= MOST_TERMS)
        .unwrap_or_else(|| (0, Features::of_velocities(samples, 0)));
    let mut cut_short = Vec::new();
    if degree < search.velocity_degree {
        let requested = search.velocity_degree;
        cut_short.push(format!(
            "coefficients of velocities were searched only up to degree {degree} instead of {requested}, which has more than {MOST_TERMS} terms"
        ));
    }
    if samples.stride() > 1 {
        cut_short.push(format!("only one sample in {} was used", samples.stride()));
    }
    for (what, features) in [("the degree", &of_positions), ("the degree of velocities", &of_velocities)] {
        let found = features.len();
        if found > MOST_TERMS {
            return Err(ConstraintSearchError::Terms { what, found });
        }
        let needed = SAMPLES_PER_TERM * found;
        if samples.len() < needed {
            return Err(ConstraintSearchError::Samples { terms: found, found: samples.len(), needed });
        }
    }
    Ok((of_positions, of_velocities, cut_short))
}

/// Functions that vanish as constraints, those of angles first.
fn described_functions(
    samples: &MotionSamples,
    features: &Features,
    limits: Limits,
    functions: Vec<Generator>,
) -> Vec<FoundConstraint> {
    let places = samples.places(INDEPENDENCE_STATES);
    let functions: Vec<Generator> =
        functions.into_iter().map(|found| found.sized(samples, features, &places)).collect();
    let (mut constraints, functions) = phases(samples, features, limits, &functions);
    let second_branch = branching(samples, features, &functions);
    for (generator, second_branch) in functions.iter().zip(second_branch) {
        let kind = match (generator.within, second_branch) {
            (false, _) => ConstraintKind::Nearly,
            (true, true) => ConstraintKind::Branching,
            (true, false) => ConstraintKind::Holonomic,
        };
        constraints.push(generator.described(features, kind));
    }
    constraints
}

/// Rows linear in the velocities that vanish beyond the consequences of functions that do.
fn velocity_rows(
    samples: &MotionSamples,
    features: &Features,
    (vanishing, limits): (&Vanishing<'_>, Limits),
    held: &mut RowsTaken,
) -> Vec<FoundConstraint> {
    let by_functions = held.bases.clone();
    let limits = if samples.measured() { limits } else { Limits::of_smoothed() };
    let found = Vanishing::of(samples, features, Some(vanishing), false, (samples.shared(), limits));
    let found = held.take(samples, features, found.generators().0, true, FURTHER_CANDIDATE);
    if samples.cancellation.is_cancelled() {
        return Vec::new();
    }
    let rows: Vec<&[f64]> = found.iter().map(|generator| generator.weights.as_slice()).collect();
    let integrable = integrable(features, samples, &rows, (held, by_functions));
    let described = found.iter().zip(integrable).map(|(generator, integrable)| {
        let kind = match (integrable, generator.within) {
            (true, _) => ConstraintKind::PerTrajectory,
            (false, true) => ConstraintKind::Nonholonomic,
            (false, false) => ConstraintKind::Nearly,
        };
        generator.described(features, kind)
    });
    described.collect()
}
