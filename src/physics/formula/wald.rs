//! Removes terms by the normal equations of a fit to the motion (Wald tests).

use super::thresholds::{MOST_RIDGE, RIDGE};
use crate::identification::linear::{inverse_with, times};

/// Normal equations at a model.
pub(super) struct Equations<'a> {
    /// `(m, m)`, with the common factor fixed.
    pub matrix: &'a [f64],
    /// Gradient at the coefficients.
    pub right: &'a [f64],
    /// Coefficients of the model over the same terms.
    pub coefficients: &'a [f64],
    pub complexity: &'a [f64],
}

/// The surviving terms.
#[derive(Clone, Debug)]
pub(super) struct Survivors {
    /// Indices of the terms.
    pub set: Vec<usize>,
    /// Coefficients of all terms, 0 outside the set.
    pub coefficients: Vec<f64>,
    /// Cost of removing the cheapest survivor.
    pub next: f64,
}

/// Removes terms while one costs less than `threshold` in the sum of squares; `allowed` says whether coefficients still form a mechanical
/// system.
///
/// Coefficients change from those of the model only as far as the motion requires: changes that are worth less than `threshold` are not made,
/// even if removing a term would require them.
pub(super) fn survivors(
    equations: &Equations<'_>,
    threshold: f64,
    allowed: &dyn Fn(&[f64]) -> bool,
) -> Option<Survivors> {
    let Equations { matrix, right, coefficients, complexity } = *equations;
    let m = right.len();
    let mut inverse = inverse_with(m, matrix, RIDGE)?;
    let size = (0..m).map(|k| matrix[k * m + k] * coefficients[k].powi(2)).fold(0.0, f64::max);
    let held = if size > 0.0 { (threshold / size).clamp(RIDGE, MOST_RIDGE) } else { RIDGE };
    let change = times(m, &inverse_with(m, matrix, held)?, right);
    let shifted = |share: f64| coefficients.iter().zip(&change).map(|(c, d)| c + share * d).collect::<Vec<_>>();
    let mut x = [1.0, 0.5, 0.25].into_iter().map(shifted).find(|x| allowed(x)).unwrap_or_else(|| coefficients.to_vec());
    let mut set: Vec<usize> = (0..m).collect();
    let mut refused: Vec<usize> = Vec::new();
    loop {
        let cost = |k: usize| x[k] * x[k] / inverse[k * m + k];
        let mut order: Vec<usize> = set.iter().copied().filter(|k| !refused.contains(k)).collect();
        order.sort_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        let Some(&least) = order.first() else {
            return Some(Survivors { set, coefficients: x, next: f64::INFINITY });
        };
        if cost(least) >= threshold || set.len() == 1 {
            return Some(Survivors { next: cost(least), set, coefficients: x });
        }
        // Among terms that cost almost nothing, the most complex one is removed first.
        let nothing = threshold / 10.0;
        let free = order.iter().copied().filter(|&k| cost(k) < nothing);
        let gone = free.max_by(|&a, &b| complexity[a].total_cmp(&complexity[b])).unwrap_or(least);
        let (factor, pivot) = (x[gone], inverse[gone * m + gone]);
        let column: Vec<f64> = set.iter().map(|&k| inverse[k * m + gone]).collect();
        let mut tried = x.clone();
        set.iter().zip(&column).for_each(|(&k, c)| tried[k] -= c * factor / pivot);
        tried[gone] = 0.0;
        if !allowed(&tried) {
            refused.push(gone);
            continue;
        }
        refused.clear();
        x = tried;
        for (a, &i) in set.iter().enumerate() {
            for (b, &j) in set.iter().enumerate() {
                inverse[i * m + j] -= column[a] * column[b] / pivot;
            }
        }
        set.retain(|k| *k != gone);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_without_weight_go_and_others_are_refitted() {
        // y = 2 a + 0 b + 3 c, with a and b correlated.
        let matrix = [100.0, 90.0, 0.0, 90.0, 100.0, 0.0, 0.0, 0.0, 50.0];
        let right = times(3, &matrix, &[2.0, 0.01, 3.0]);
        let equations = Equations { matrix: &matrix, right: &right, coefficients: &[0.0; 3], complexity: &[1.0; 3] };
        let found = survivors(&equations, 10.0, &|_| true).unwrap();
        assert_eq!(found.set, [0, 2]);
        assert!((found.coefficients[0] - 2.009).abs() < 1e-6 && found.next > 70.0, "{found:?}");
        let kept = survivors(&equations, 10.0, &|x| x[1] != 0.0).unwrap();
        assert_eq!(kept.set, [0, 1, 2]);
    }

    #[test]
    fn what_the_motion_leaves_open_stays_until_a_term_goes() {
        // y = a + b; the model has a = 2, b = 0, and the motion moves both by a little.
        let matrix = [1e6, 1e6, 1e6, 1e6 + 0.1];
        let equations =
            Equations { matrix: &matrix, right: &[0.1, -0.1], coefficients: &[2.0, 0.0], complexity: &[2.0, 1.0] };
        let all = survivors(&equations, 30.0, &|x| x[0] != 0.0 && x[1] != 0.0).unwrap();
        assert!(all.set == [0, 1] && (all.coefficients[0] - 2.0).abs() < 0.1, "{all:?}");
        // Among terms that cost nothing, the more complex one is removed.
        let one = survivors(&equations, 30.0, &|_| true).unwrap();
        assert!(one.set == [1] && (one.coefficients[1] - 2.0).abs() < 1e-2, "{one:?}");
    }
}
