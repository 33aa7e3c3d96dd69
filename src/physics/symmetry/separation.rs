//! Number of singular values that count as zero.

use super::{Basis, Chart, Degrees, EXACT, Symmetries, SymmetryError, symmetries};
use crate::lagrangian::EulerLagrange;
use serde::Serialize;

/// Singular values cut into those that count as zero and the others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Separation {
    /// Number of values that count as zero; `None` if there is no gap.
    pub count: Option<usize>,
    /// Ratio of the first value that does not count as zero to the last that does, or to the tolerance if none does; `None` if
    /// all values are zero.
    pub gap: Option<f64>,
}

/// Values below which a function may be meant to be zero, when nothing is known of the noise: a part in ten of what it would
/// be without a symmetry.
const SMALL: f64 = 0.1;
/// Least gap by which values are told apart when nothing is known of the noise.
const APART: f64 = 10.0;
/// Noise that a model has at the least: smaller values are not told apart.
const NOISE: f64 = 1e-3;
/// Least gap above a known noise.
const ABOVE: f64 = 30.0;
/// Tolerances by which values can be judged: from the rounding of a number near 1 to the part below which a function may be
/// meant to be zero.
pub(crate) const TOLERANCES: [f64; 2] = [f64::EPSILON, SMALL];

/// Refuses a tolerance that is none of [`TOLERANCES`].
///
/// # Errors
/// [`SymmetryError::Tolerance`].
pub(crate) fn check(tolerance: Option<f64>) -> Result<(), SymmetryError> {
    let [least, most] = TOLERANCES;
    match tolerance {
        Some(found) if !(least..=most).contains(&found) => Err(SymmetryError::Tolerance { found, least, most }),
        _ => Ok(()),
    }
}

impl Separation {
    /// Cuts ascending values at a tolerance, the noise of exact terms, or, without one, at the largest gap.
    ///
    /// With a tolerance the first value above it must exceed the last below it 30 times, and the tolerance itself three
    /// times. Without one, values above 0.1 are not zero, and the cut is where the ratio of neighbours is largest, 10 at
    /// least, values below 1e-3 taken as that. Otherwise there is no gap and no count.
    pub(crate) fn new(values: &[f64], tolerance: Option<f64>) -> Self {
        // Nothing is smaller than the rounding of a number near 1.
        let floor = f64::EPSILON;
        let ratio = |k: usize, below: f64| values.get(k).map(|above| above / below.max(floor));
        match tolerance {
            Some(tolerance) => {
                let count = values.iter().take_while(|value| **value <= tolerance).count();
                let gap = ratio(count, if count == 0 { tolerance } else { values[count - 1] });
                let least = if count == 0 { 3.0 } else { ABOVE };
                let clear = gap.is_none_or(|gap| gap >= least) && ratio(count, tolerance).is_none_or(|r| r >= 3.0);
                Self { count: clear.then_some(count), gap }
            }
            None => {
                let small = values.iter().take_while(|value| **value < SMALL).count();
                let cuts = (1..=small).filter_map(|k| Some((k, ratio(k, values[k - 1].max(NOISE))?)));
                match cuts.max_by(|a, b| a.1.total_cmp(&b.1)) {
                    None => Self { count: Some(small), gap: ratio(0, SMALL) },
                    Some((k, apart)) => Self { count: (apart >= APART).then_some(k), gap: ratio(k, values[k - 1]) },
                }
            }
        }
    }
}

/// The bases in which symmetries are sought: the one of these degrees, or the usual one; of a model, whose errors hide symmetries
/// among many functions, also those of lower powers.
pub fn bases(names: &[String], charts: &[Chart], degrees: Option<Degrees>, exact: bool) -> Vec<(Basis, Degrees)> {
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
pub fn enough(unknowns: usize, exact: bool) -> usize {
    (2 * unknowns).max(if exact { 400 } else { 1000 })
}

/// Point symmetries: in the basis that shows the most of them, of such in the one with the widest gap; `tolerance` as in
/// [`symmetries`], [`EXACT`] of exact terms if there is none.
///
/// # Errors
/// [`SymmetryError`].
pub fn most_symmetries(
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_told_by_the_gap() {
        let at = |values: &[f64], tolerance| Separation::new(values, tolerance);
        let exact = Some(1e-8);
        assert_eq!(at(&[1e-13, 1e-12, 0.01, 0.3], exact), Separation { count: Some(2), gap: Some(1e10) });
        assert_eq!(at(&[0.02, 0.3], exact), Separation { count: Some(0), gap: Some(0.02 / 1e-8) });
        assert_eq!(at(&[1e-14, 5e-9, 6e-9, 2e-8], exact).count, None);
        assert_eq!(at(&[1e-16, 1e-17], exact), Separation { count: Some(2), gap: None });
        assert_eq!(at(&[1e-4, 2e-3, 3e-3, 0.2], None).count, Some(3));
        // Imposed symmetries beside learned ones.
        assert_eq!(at(&[0.0, 1e-9, 2e-3, 0.05], None).count, Some(3));
        // What two exact ones beside stand out from may still be noise.
        assert_eq!(at(&[1e-6, 2e-6, 4e-3, 0.02], None).count, None);
        assert_eq!(at(&[1e-3, 5e-3, 2e-2, 0.09], None).count, None);
        assert_eq!(at(&[0.2, 0.3], None), Separation { count: Some(0), gap: Some(2.0) });
        assert_eq!(at(&[], None).count, Some(0));
    }
}
