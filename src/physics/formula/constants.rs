//! Names of constants, shared by equal coefficients, and fractions near them.

use super::found::{FoundFormula, NearFraction};
use super::thresholds::{CHANCE_FRACTION, CONSTANT_ERRORS, EQUAL_CONSTANTS_ERROR, MOST_DENOMINATOR, MOST_NUMERATOR};
use super::units::{Dimension, of_coefficient};
use crate::identification::linear::{inverse, part};
use crate::linalg::dot;

impl FoundFormula {
    /// Sets the units of coefficients, one name for equal coefficients, and fractions near them.
    pub(super) fn name_constants(&mut self) {
        let dimensions: Vec<Option<Dimension>> = self.terms.iter().map(|t| t.dimension.clone()).collect();
        for term in &mut self.terms {
            term.unit = match term.reference.map(|at| &dimensions[at]) {
                Some(None) => None,
                known => of_coefficient(term.dimension.as_ref(), known.and_then(Option::as_ref)),
            };
        }
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for k in 0..self.terms.len() {
            match groups.iter_mut().find(|group| self.equal(group[0], k)) {
                Some(group) => group.push(k),
                None => groups.push(vec![k]),
            }
        }
        // A letter that, followed by a number, is not the name of a coordinate.
        let letter =
            ['c', 'k', 'w'].into_iter().find(|letter| !self.coordinates.iter().any(|q| q.starts_with(*letter)));
        for (number, group) in groups.iter().enumerate() {
            let (value, error) = self.common(group);
            for &k in group {
                let term = &mut self.terms[k];
                term.constant = format!("{}{}", letter.unwrap_or('z'), number + 1);
                (term.coefficient, term.standard_error) = (value.copysign(term.coefficient), error);
                term.near = near(term.coefficient, error);
            }
        }
    }

    /// `true` if two coefficients are the same constant or its negative: in the same block, with the same unit, equal within their errors,
    /// and too close for chance.
    fn equal(&self, a: usize, b: usize) -> bool {
        let (m, [x, y]) = (self.terms.len(), [a, b].map(|k| &self.terms[k]));
        let sign = x.coefficient.signum() * y.coefficient.signum();
        let covariance = |i: usize, j: usize| self.covariance[i * m + j];
        let variance = covariance(a, a) + covariance(b, b) - 2.0 * sign * covariance(a, b);
        let (size, error) = (x.coefficient.abs(), variance.max(0.0).sqrt() + 1e-9 * x.coefficient.abs());
        let same = x.unit.is_some() && x.unit == y.unit && x.dissipation == y.dissipation && x.reference == y.reference;
        same && error < EQUAL_CONSTANTS_ERROR * size && (size - y.coefficient.abs()).abs() <= CONSTANT_ERRORS * error
    }

    /// The best estimate of a constant and its standard error, from the coefficients that equal it.
    fn common(&self, group: &[usize]) -> (f64, f64) {
        let own = |k: usize| (self.terms[k].coefficient.abs(), self.terms[k].standard_error);
        if let Some(&fixed) = group.iter().find(|k| group.len() == 1 || own(**k).1 == 0.0) {
            return own(fixed);
        }
        let (count, m) = (group.len(), self.terms.len());
        let sign = |at: usize| self.terms[group[at]].coefficient.signum();
        let mut block = part(m, &self.covariance, group);
        (0..count * count).for_each(|e| block[e] *= sign(e / count) * sign(e % count));
        let Some(weights) = inverse(count, &block) else { return own(group[0]) };
        let sums: Vec<f64> = weights.chunks_exact(count).map(|row| row.iter().sum()).collect();
        let (whole, sizes): (f64, Vec<f64>) = (sums.iter().sum(), group.iter().map(|&k| own(k).0).collect());
        (dot(&sums, &sizes) / whole, whole.recip().max(0.0).sqrt())
    }
}

/// A fraction of small integers within two standard errors, if the number is known well enough that this is not by chance.
fn near(x: f64, error: f64) -> Option<NearFraction> {
    if !(x.is_finite() && error.is_finite()) {
        return None;
    }
    let within = (CONSTANT_ERRORS * error).max(1e-9 * x.abs());
    for bottom in 1..=MOST_DENOMINATOR {
        let top = (x * f64::from(bottom)).round();
        // Fractions with this denominator are 1 / bottom apart: one within the error is rarely there by chance.
        let rare = within * f64::from(bottom * bottom) < CHANCE_FRACTION;
        if rare && top != 0.0 && top.abs() <= MOST_NUMERATOR && (x - top / f64::from(bottom)).abs() <= within {
            let fraction = if bottom == 1 { format!("{top}") } else { format!("{top}/{bottom}") };
            let off = x - top / f64::from(bottom);
            return Some(NearFraction { fraction, standard_errors: if error > 0.0 { off / error } else { 0.0 } });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_are_named_where_they_are_no_accident() {
        let found = near(0.2501, 1e-4).unwrap();
        assert!(found.fraction == "1/4" && (found.standard_errors - 1.0).abs() < 1e-9, "{found:?}");
        assert_eq!(near(-1.5, 0.0).map(|found| found.fraction).as_deref(), Some("-3/2"));
        assert_eq!([near(0.2531, 1e-4), near(0.26, 0.2)], [None, None]);
    }
}
