//! Bounds of states.

/// Bounds in the form of a configuration.
pub(crate) fn boxes(bounds: &[(f64, f64)]) -> Vec<[f64; 2]> {
    bounds.iter().map(|&(low, high)| [low, high]).collect()
}
