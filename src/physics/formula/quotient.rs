//! Terms that follow from others.

use super::library::Library;
use super::thresholds::{COMBINATION_REMAINDER, DEPENDENT_REMAINDER, VANISHING_TERM};
use crate::linalg::dot;

/// Removed terms as combinations of the kept ones.
#[derive(Clone, Debug)]
pub(super) struct Quotient {
    /// Kept terms, in the order of the library.
    pub kept: Vec<usize>,
    /// For every term of the library, its coefficients over the kept terms; none if it is not a combination of them.
    pub over_kept: Vec<Option<Vec<f64>>>,
    /// Total derivatives and identities among the terms that are searched.
    pub removed: usize,
}

impl Quotient {
    pub fn new(library: &Library, columns: &[Vec<f64>]) -> (Vec<usize>, Self) {
        let mut order: Vec<usize> = (0..library.searched).collect();
        order.sort_by(|&a, &b| library.complexity(a).total_cmp(&library.complexity(b)));
        // Orthonormal directions, and each as a combination of the kept terms.
        let mut directions: Vec<Vec<f64>> = Vec::new();
        let mut kept: Vec<usize> = Vec::new();
        let mut combinations: Vec<Vec<f64>> = Vec::new();
        let reduce = |column: &[f64], directions: &[Vec<f64>], combinations: &[Vec<f64>]| {
            let length = dot(column, column).sqrt();
            let mut rest = column.to_vec();
            let mut over = vec![0.0; directions.len()];
            for _ in 0..2 {
                for (direction, combination) in directions.iter().zip(combinations) {
                    let part = dot(direction, &rest);
                    rest.iter_mut().zip(direction).for_each(|(r, d)| *r -= part * d);
                    over.iter_mut().zip(combination).for_each(|(o, c)| *o += part * c);
                }
            }
            let left = dot(&rest, &rest).sqrt();
            (rest, over, length, left)
        };
        for k in order {
            let (mut rest, over, length, left) = reduce(&columns[k], &directions, &combinations);
            if length > VANISHING_TERM && left > DEPENDENT_REMAINDER * length {
                rest.iter_mut().for_each(|r| *r /= left);
                let mut combination: Vec<f64> = over.iter().map(|o| -o / left).collect();
                combination.push(1.0 / left);
                directions.push(rest);
                combinations.push(combination);
                kept.push(k);
            }
        }
        let mut sorted: Vec<(usize, usize)> = kept.iter().copied().enumerate().map(|(at, k)| (k, at)).collect();
        sorted.sort_unstable();
        let over_kept = columns.iter().map(|column| {
            let (_, over, length, left) = reduce(column, &directions, &combinations);
            let full = |at: usize| over.get(at).copied().unwrap_or(0.0);
            (left <= COMBINATION_REMAINDER * length).then(|| sorted.iter().map(|&(_, at)| full(at)).collect())
        });
        let over_kept = over_kept.collect();
        let kept: Vec<usize> = sorted.into_iter().map(|(k, _)| k).collect();
        let removed = library.searched - kept.len();
        (kept.clone(), Self { kept, over_kept, removed })
    }
}
