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
use crate::lagrangian::{ReducedMass, take_out};
use crate::linalg::{Workspace, dot, eigh};
use features::Features;
use generators::{Generator, Limits, Vanishing};
use regular::{branching, phases};
use serde::Serialize;
use std::collections::BTreeMap;
use thresholds::{
    FURTHER_CANDIDATE, GRADIENT_STATES, IMPROVED_VOLUME, INDEPENDENCE_STATES, LEAST_NEW_PART, LEAST_SQUARED_PART,
    MOST_CURL, MOST_TERMS, NEARLY_DEPENDENT, NEW_FUNCTION, SAMPLES_PER_TERM, SIMPLER_PART,
};

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

/// The constraints found so far, at some samples.
struct RowsTaken {
    places: Vec<usize>,
    /// Orthonormal rows at each place.
    bases: Vec<Vec<f64>>,
    /// Number of candidates that do not hold on held-out data.
    refuted: usize,
}

impl RowsTaken {
    /// Starts without constraints.
    fn at(samples: &MotionSamples, places: usize) -> Self {
        let places = samples.places(places);
        Self { bases: vec![Vec::new(); places.len()], places, refuted: 0 }
    }

    /// Takes generators while one has a part outside the span of those already taken. Each time it takes the simplest one, which comes
    /// first, whose part is at least half of the largest part.
    fn take(
        &mut self,
        samples: &MotionSamples,
        features: &Features,
        generators: Vec<Generator>,
        velocities: bool,
        imposed: (f64, f64),
    ) -> Vec<Generator> {
        let row = |generator: &Generator, at: usize| match velocities {
            true => features.velocity_row(samples, at, &generator.weights),
            false => features.gradient(samples, at, &generator.weights),
        };
        let rows = |generator: Generator| {
            let rows: Vec<Vec<f64>> = self.places.iter().map(|&at| row(&generator, at)).collect();
            (generator, rows)
        };
        let mut left: Vec<(Generator, Vec<Vec<f64>>)> = generators.into_iter().map(rows).collect();
        let (rank, mut taken) = (self.rank(samples.n(), &left, imposed), Vec::new());
        while taken.len() < rank {
            let parts: Vec<f64> = left.iter().map(|(_, rows)| self.outside(rows)).collect();
            let most = parts.iter().fold(0.0, |most: f64, part| most.max(*part));
            let Some(next) =
                parts.iter().position(|part| *part >= SIMPLER_PART * most).filter(|_| most >= LEAST_NEW_PART)
            else {
                break;
            };
            let (generator, rows) = left.remove(next);
            if !generator.holds {
                self.refuted += 1;
                continue;
            }
            self.bases.iter_mut().zip(&rows).for_each(|(basis, row)| extend(basis, row));
            taken.push(generator);
        }
        taken
    }

    /// How many directions all valid generators add to the span of those already taken, at a share of the states. Generators taken one after the
    /// other may nearly depend on each other somewhere, and noise would then count as another direction.
    fn rank(&self, n: usize, generators: &[(Generator, Vec<Vec<f64>>)], (share, part): (f64, f64)) -> usize {
        let holding: Vec<_> = generators.iter().filter(|(generator, _)| generator.holds).collect();
        let at = |place: usize| {
            let mut sum = vec![0.0; n * n];
            for (_, rows) in &holding {
                let (rest, size) = (beside(&self.bases[place], &rows[place]), dot(&rows[place], &rows[place]));
                for (k, x) in sum.iter_mut().enumerate().filter(|_| size > 0.0) {
                    *x += rest[k / n] * rest[k % n] / size;
                }
            }
            let (mut squares, mut directions) = (vec![0.0; n], vec![0.0; n * n]);
            let solved = eigh(n, &sum, &mut squares, &mut directions, &mut Workspace::new());
            solved.map_or(0, |()| squares.iter().filter(|square| **square >= part * part).count())
        };
        let mut ranks: Vec<usize> = (0..self.places.len()).map(at).collect();
        ranks.sort_unstable();
        ranks.get(((1.0 - share) * ranks.len() as f64) as usize).copied().unwrap_or(0)
    }

    /// Root mean square part of unit vectors outside the span; 0 where a vector vanishes.
    fn outside(&self, vectors: &[Vec<f64>]) -> f64 {
        let parts = self.bases.iter().zip(vectors).map(|(basis, vector)| {
            let (rest, size) = (beside(basis, vector), dot(vector, vector));
            if size > 0.0 { dot(&rest, &rest) / size } else { 0.0 }
        });
        (parts.sum::<f64>() / self.bases.len().max(1) as f64).sqrt()
    }
}

/// Functions with the same zeros whose gradients are independent wherever the motion was: for a rotation matrix, three products of columns and
/// three of rows are independent at most states, but not for rotations about an axis.
///
/// If one of the functions nearly follows from the others, or its gradient vanishes, at some of the states, an equal number of others is
/// chosen from all simple functions with these zeros, one after the other, with the smallest mean of `1 / det G` over the states, where `G`
/// contains the products of the normalized gradients.
fn independent_everywhere(
    samples: &MotionSamples,
    features: &Features,
    taken: Vec<Generator>,
    candidates: Vec<Generator>,
) -> Vec<Generator> {
    let places = samples.places(INDEPENDENCE_STATES);
    // Normalized by their mean size, so that a gradient that vanishes somewhere stays visible.
    let sized = |generator: &Generator| -> Vec<Vec<f64>> {
        let mut rows: Vec<Vec<f64>> =
            places.iter().map(|&at| features.gradient(samples, at, &generator.weights)).collect();
        let square = rows.iter().map(|row| dot(row, row)).sum::<f64>() / rows.len().max(1) as f64;
        rows.iter_mut().flatten().for_each(|x| *x /= square.sqrt().max(f64::MIN_POSITIVE));
        rows
    };
    let rows: Vec<Vec<Vec<f64>>> = taken.iter().map(sized).collect();
    let nearly =
        (0..places.len()).any(|place| least_part(rows.iter().map(|row| row[place].as_slice())) < NEARLY_DEPENDENT);
    if !nearly {
        return taken;
    }
    let degree = |generator: &Generator| generator.degree(features);
    let (size, most) = (taken.len(), taken.iter().map(degree).max());
    let pool: Vec<Generator> =
        candidates.into_iter().filter(|other| other.holds && Some(degree(other)) <= most).collect();
    let rows: Vec<Vec<Vec<f64>>> = pool.iter().map(sized).collect();
    // Sums of `1 / det G` over the states, of some rows together with each candidate.
    let sums = |others: &[usize]| -> Vec<f64> {
        let mut sums = vec![0.0; rows.len()];
        for place in 0..places.len() {
            let (mut basis, mut volume) = (Vec::new(), 1.0);
            // A state at which they depend on each other counts, but does not outweigh all others.
            let part = |basis: &[f64], row: &[f64]| {
                let rest = beside(basis, row);
                dot(&rest, &rest).max(LEAST_SQUARED_PART)
            };
            for &k in others {
                volume *= part(&basis, &rows[k][place]);
                extend(&mut basis, &rows[k][place]);
            }
            sums.iter_mut().zip(&rows).for_each(|(sum, row)| *sum += (volume * part(&basis, &row[place])).recip());
        }
        sums
    };
    let best = |others: &[usize]| {
        sums(others).into_iter().enumerate().map(|(k, sum)| (sum, k)).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    // Adds one after the other, then exchanges one at a time.
    let (mut chosen, mut least) = (Vec::new(), f64::INFINITY);
    while chosen.len() < size
        && let Some((sum, next)) = best(&chosen)
    {
        least = sum;
        chosen.push(next);
    }
    loop {
        let without = |from: usize| [&chosen[..from], &chosen[from + 1..]].concat();
        let of = |from: usize| best(&without(from)).map(|(sum, to)| (sum, from, to));
        match (0..size).filter_map(of).min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((sum, from, to)) if sum < IMPROVED_VOLUME * least => (least, chosen[from]) = (sum, to),
            _ => break,
        }
    }
    chosen.sort_unstable();
    chosen.into_iter().map(|k| pool[k].clone()).collect()
}

/// The smallest part of any row outside the span of the rows before it.
fn least_part<'a>(rows: impl Iterator<Item = &'a [f64]>) -> f64 {
    let (mut basis, mut least): (Vec<f64>, f64) = (Vec::new(), f64::INFINITY);
    for row in rows {
        let rest = beside(&basis, row);
        least = least.min(dot(&rest, &rest).sqrt());
        extend(&mut basis, row);
    }
    least
}

/// The part of a vector orthogonal to orthonormal rows.
fn beside(basis: &[f64], vector: &[f64]) -> Vec<f64> {
    let mut rest = vector.to_vec();
    take_out(&mut rest, basis);
    rest
}

/// An orthonormal basis of the null space of the rows.
fn kernel(n: usize, rows: &[f64]) -> Vec<f64> {
    ReducedMass::of(n, &vec![0.0; n * n], rows).map(|reduced| reduced.basis).unwrap_or_default()
}

/// Which of the rows are derivatives of functions, in addition to the `by_functions` constraints: starting with the rows whose curl vanishes in
/// the null space of all rows, repeatedly keeps those whose curl vanishes in the null space of the kept rows. A rolling disk has a row of the
/// first kind, its path along its heading, and none that remains.
fn integrable(
    features: &Features,
    samples: &MotionSamples,
    rows: &[&[f64]],
    (held, by_functions): (&RowsTaken, Vec<Vec<f64>>),
) -> Vec<bool> {
    let (mut left, mut bases) = (vec![true; rows.len()], held.bases.clone());
    loop {
        let mut lost = false;
        for (weights, left) in rows.iter().zip(&mut left).filter(|(_, left)| **left) {
            let places = held.places.iter().zip(&bases);
            let turns: Vec<f64> = places.map(|(&at, rows)| curl(features, samples, at, weights, rows)).collect();
            let turn = (turns.iter().map(|x| x * x).sum::<f64>() / turns.len() as f64).sqrt();
            if turn >= MOST_CURL || features.has_rate(weights) {
                (*left, lost) = (false, true);
            }
        }
        if !lost {
            return left;
        }
        bases.clone_from(&by_functions);
        for (weights, _) in rows.iter().zip(&left).filter(|(_, left)| **left) {
            for (&at, basis) in held.places.iter().zip(&mut bases) {
                extend(basis, &features.velocity_row(samples, at, weights));
            }
        }
    }
}

/// Adds the orthogonal part of a vector to orthonormal rows.
fn extend(basis: &mut Vec<f64>, vector: &[f64]) {
    let rest = beside(basis, vector);
    let size = dot(&rest, &rest).sqrt();
    if size > 0.0 {
        basis.extend(rest.iter().map(|x| x / size));
    }
}

/// Size of the curl of a row within the null space of the rows, over that of its derivatives: 0 if it is the derivative of a function
/// (Frobenius).
fn curl(features: &Features, samples: &MotionSamples, at: usize, weights: &[f64], rows: &[f64]) -> f64 {
    let n = samples.n();
    let derivatives = features.row_derivatives(samples, at, weights);
    let size = derivatives.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    let basis = kernel(n, rows);
    let mut most: f64 = 0.0;
    for z in basis.chunks_exact(n) {
        for y in basis.chunks_exact(n) {
            let along =
                |z: &[f64], y: &[f64]| (0..n).map(|i| z[i] * dot(&derivatives[i * n..(i + 1) * n], y)).sum::<f64>();
            most = most.max((along(z, y) - along(y, z)).abs());
        }
    }
    if size > 0.0 { most / size } else { 0.0 }
}
