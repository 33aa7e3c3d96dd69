//! Chooses functions and rows that are independent of each other where the motion was.

use super::MotionSamples;
use super::features::Features;
use super::generators::Generator;
use super::thresholds::{
    IMPROVED_VOLUME, INDEPENDENCE_STATES, LEAST_NEW_PART, LEAST_SQUARED_PART, NEARLY_DEPENDENT, SIMPLER_PART,
};
use crate::lagrangian::take_out;
use crate::linalg::{Workspace, dot, eigh};

/// The constraints found so far, at some samples.
pub(super) struct RowsTaken {
    pub(super) places: Vec<usize>,
    /// Orthonormal rows at each place.
    pub(super) bases: Vec<Vec<f64>>,
    /// Number of candidates that do not hold on held-out data.
    pub(super) refuted: usize,
}

impl RowsTaken {
    /// Starts without constraints.
    pub(super) fn at(samples: &MotionSamples, places: usize) -> Self {
        let places = samples.places(places);
        Self { bases: vec![Vec::new(); places.len()], places, refuted: 0 }
    }

    /// Takes generators while one has a part outside the span of those already taken. Each time it takes the simplest one, which comes
    /// first, whose part is at least half of the largest part.
    pub(super) fn take(
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
pub(super) fn independent_everywhere(
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
pub(super) fn least_part<'a>(rows: impl Iterator<Item = &'a [f64]>) -> f64 {
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

/// Adds the orthogonal part of a vector to orthonormal rows.
pub(super) fn extend(basis: &mut Vec<f64>, vector: &[f64]) {
    let rest = beside(basis, vector);
    let size = dot(&rest, &rest).sqrt();
    if size > 0.0 {
        basis.extend(rest.iter().map(|x| x / size));
    }
}
