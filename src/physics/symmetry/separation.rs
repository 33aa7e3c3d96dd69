//! Number of singular values that count as zero.

use super::SymmetryError;
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
