//! How much a report shows; sizes and widths of drawings stand with their plots.

// Limits, which keep pages small enough to open. `cargo test --test suite -- program` checks pages.

/// Largest page, in bytes.
pub(super) const MOST_PAGE_BYTES: usize = 500_000;
/// Largest number of constraints in a picture, as many as it has colours.
pub(super) const SHOWN_CONSTRAINTS: usize = 7;
/// Largest number of samples in the picture of a constraint.
pub(super) const SHOWN_SAMPLES: usize = 2000;
/// Largest number of starts that are drawn as separate lines in pictures of errors.
pub(super) const DRAWN_STARTS: usize = 7;
/// Largest number of coordinates with their own pictures.
pub(super) const DRAWN_COORDINATES: usize = 8;
/// Largest number of points of a line.
pub(super) const LINE_POINTS: usize = 4000;
/// Number of points above which every second point of a motion is left out: more than the pixels across a picture.
pub(super) const MOST_CURVE_POINTS: usize = 4000;
/// Largest number of events in a table for people; a file contains all of them.
pub(super) const SHOWN_EVENTS: usize = 20;
/// Largest lag of an autocorrelation, in samples.
pub(super) const DRAWN_LAGS: usize = 40;

// Settings.

/// Time span of the picture divided by the median time of valid prediction.
pub(super) const BEYOND_VALID: f64 = 4.0;
/// Seconds in which a motion crosses the known region on screen, if the system has no unit of time.
pub(super) const CROSSING_SECONDS: f64 = 20.0;
/// Number of states at which a start on the constraints is sought.
pub(super) const EXAMINED_STARTS: usize = 24;
/// Largest number of states of a motion at which its invariant is sought: a quantity that is not conserved changes at almost every state.
pub(super) const INVARIANT_STATES: usize = 24;
/// Number of states at which mass matrices are compared.
pub(super) const COMPARED_STATES: usize = 200;
