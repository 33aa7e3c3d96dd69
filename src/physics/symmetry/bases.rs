//! Symmetries in the basis that shows the most of them.

use super::{Basis, Chart, Degrees, EXACT, Symmetries, SymmetryError, symmetries};
use crate::lagrangian::EulerLagrange;

/// The bases in which symmetries are sought: the one of these degrees, or the usual one; of a model, whose errors hide symmetries
/// among many functions, also those of lower powers.
pub(crate) fn bases(
    names: &[String],
    charts: &[Chart],
    degrees: Option<Degrees>,
    exact: bool,
) -> Vec<(Basis, Degrees)> {
    if let Some(degrees) = degrees {
        return vec![(Basis::new(names, charts, degrees), degrees)];
    }
    let (basis, highest) = Basis::usual(names, charts);
    let mut all = vec![(basis, highest)];
    if !exact {
        for polynomial in (0..highest.polynomial).rev() {
            let degrees = Degrees { polynomial, ..highest };
            let lower = Basis::new(names, charts, degrees);
            if lower.len() > 1 && all.last().is_some_and(|(last, _)| lower.len() < last.len()) {
                all.push((lower, degrees));
            }
        }
    }
    all
}

/// States that are looked at for so many unknown coefficients, of a Lagrangian that is written down or of a model.
pub(crate) fn enough(unknowns: usize, exact: bool) -> usize {
    (2 * unknowns).max(if exact { 400 } else { 1000 })
}

/// Point symmetries: in the basis that shows the most of them, of such in the one with the widest gap; `tolerance` as in
/// [`symmetries`], [`EXACT`] of exact terms if there is none.
///
/// # Errors
/// [`SymmetryError`].
pub(crate) fn most_symmetries(
    model: &dyn EulerLagrange<f64>,
    bases: Vec<(Basis, Degrees)>,
    (q, v): (&[f64], &[f64]),
    (tolerance, exact): (Option<f64>, bool),
) -> Result<(Symmetries, Degrees), SymmetryError> {
    let tolerance = tolerance.or(exact.then_some(EXACT));
    let mut best: Option<(Symmetries, Degrees)> = None;
    for (basis, degrees) in bases {
        let found = symmetries(model, &basis, (q, v), tolerance)?;
        let rank = |found: &Symmetries| (found.separation.count, found.separation.gap.unwrap_or(f64::INFINITY));
        if best.as_ref().is_none_or(|(best, _)| rank(&found) > rank(best)) {
            best = Some((found, degrees));
        }
    }
    best.ok_or(SymmetryError::Basis { expected: model.coordinates(), found: 0 })
}
