//! Numerical settings and limits of multiple shooting.

// ---- Accuracy ----

/// Largest root mean square error of the integrator, in units of noise.
pub(super) const INTEGRATION_ERROR: f64 = 0.05;
/// Number of segments on which this error is measured.
pub(super) const MEASURED_SEGMENTS: usize = 64;
/// Largest number of samples of a segment, and of its integration steps.
pub(super) const MOST_STEPS: usize = 1 << 16;

// ---- Segments that are left out ----

/// Multiple of the data's range that a state may reach before its segment is left out.
pub(super) const STATE_RANGE: f64 = 10.0;
/// The same limit in units of the noise, if nothing moves.
pub(super) const NOISE_RANGE: f64 = 100.0 * STATE_RANGE;
/// A loss counts only if at most one in this many validation segments is left out.
pub(super) const SEGMENTS_PER_LEFT_OUT: usize = 20;

// ---- Corrections of the starts ----

/// Gauss-Newton steps of all starts before the first epoch.
pub(super) const FIRST_STEPS: usize = 3;
/// Weight, relative to the observations, of keeping an initial state unchanged: it keeps the curvature regular where the data do not
/// determine the state.
pub(super) const START_DAMPING: f64 = 1e-2;
/// Largest correction over the range of a state.
pub(super) const LONGEST_CORRECTION: f64 = 1e-2;
/// Step of a difference, in units of the root of the precision times the range of a state, which is ten times the largest excursion.
pub(super) const START_DIFFERENCE: f64 = 0.1;
