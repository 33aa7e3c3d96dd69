//! Thresholds, limits and settings of the search for a formula.
//!
//! `lnn-studies rates --part formula` checks the verdicts, `lnn-studies rates --part drives` those of periodic drives; see `docs/verdicts.md`.

// # Verdicts on recorded motion
//
// The sum of squares is in units of the noise variance throughout.

/// Reduction of the sum of squares that a term must bring: about 5.5 standard errors of its coefficient, so that the largest of the several
/// hundred terms of a library rarely reaches it by chance.
pub(super) const TERM_COST: f64 = 30.0;
/// Largest ratio of held-out residuals to noise at which a formula counts as found: the noise is known to a few per cent.
pub(super) const MOST_HELD_OUT_RESIDUAL: f64 = 1.1;
/// Smallest such ratio, below which the initial states overfit the noise; it applies to estimated noise alone, since a given value or that of
/// exact numbers may be too large.
pub(super) const LEAST_HELD_OUT_RESIDUAL: f64 = 0.8;
/// Standard deviations of that ratio that the limits allow beyond; they matter for few residuals.
pub(super) const RESIDUAL_DEVIATIONS: f64 = 3.0;
/// Smallest ratio of a coordinate's motion to its residual at which it can confirm a law: the noise is below half of the spread.
pub(super) const LEAST_MOTION_RATIO: f64 = 2.0;
/// Largest condition number of a mass matrix in units of its diagonal: systems in textbooks stay below 100 except near singular positions.
pub(super) const MOST_MASS_CONDITION: f64 = 1e4;
/// Smallest determinant of a mass matrix, over that of the previous model: a term may be removed only while the matrix stays regular.
pub(super) const LEAST_DETERMINANT_RATIO: f64 = 0.05;

// # Verdicts on models

/// Largest relative error of accelerations at which a formula still describes a model.
pub(super) const MOST_MODEL_RESIDUAL: f64 = 0.02;
/// Largest mean squared error, over the smallest one, at which a choice of terms may be the formula: ten times the smallest error.
pub(super) const MOST_MODEL_ERROR_RATIO: f64 = 100.0;
/// A direction is not determined if the squared error of the motion stays below this multiple of the smallest one: twice the error.
pub(super) const UNDETERMINED_ERROR: f64 = 4.0;
/// Smallest number of states at which a model must be finite.
pub(super) const LEAST_MODEL_STATES: usize = 20;

// # Verdicts on periodic drives

/// Smallest number of periods in the longest trajectory: fewer do not show that a force is periodic.
pub(super) const LEAST_DRIVE_PERIODS: f64 = 3.0;
/// Largest expected number of false alarms in one spectrum, over all its frequencies together.
pub(super) const MOST_FALSE_ALARMS: f64 = 1e-3;
/// Independent frequencies per unit of the resolution, over which a maximum is taken: neighbours within a third of a unit are correlated.
pub(super) const INDEPENDENT_FREQUENCIES: f64 = 3.0;
/// Distances from a line, in units of the resolution, of the frequencies that show the background: beyond the line's own width, and close
/// enough that the spectrum hardly changes.
pub(super) const BACKGROUND_RANGE: [f64; 2] = [2.0, 14.0];
/// Smallest number of background frequencies, in the same units; a median of fewer is too uncertain.
pub(super) const LEAST_BACKGROUND: f64 = 6.0;
/// Largest difference between the motion and that a period later, over the root of two times its spread, at which it repeats.
pub(super) const MOST_PERIOD_DIFFERENCE: f64 = 0.02;
/// Largest number of periods of the drive after which a repetition is looked for.
pub(super) const MOST_REPEATED_PERIODS: usize = 4;
/// Smallest number of samples that a comparison with a later period needs.
pub(super) const LEAST_COMPARED_SAMPLES: f64 = 10.0;
/// Largest number of terms of a law with a drive, whose frequency is fitted too: with many more, a formula follows the motion of another law as
/// well. The laws of the study have up to 7.
pub(super) const MOST_DRIVEN_TERMS: usize = 12;

// # Verdicts on recordings

/// Size of an outlier or a jump above which it does not belong to the motion, over the range of all but one sample in fifty.
pub(super) const WILD_DEVIATION: f64 = 0.25;
/// Ratio of the noise of a trajectory to that of all at which it gets its own: two to three standard errors of
/// [`LEAST_OWN_NOISE_SAMPLES`] samples.
pub(super) const OWN_NOISE_RATIO: f64 = 1.25;
/// Smallest number of samples at which a trajectory may have its own noise: it is then known to 8 to 11 %, depending
/// on the order of the differences it is estimated from.
pub(super) const LEAST_OWN_NOISE_SAMPLES: usize = 200;
/// Smallest number of consecutive samples.
pub(super) const LEAST_SAMPLES: usize = 20;
/// Smallest noise that is assumed, relative to the range of a coordinate: that of numbers with six digits.
pub(super) const LEAST_RELATIVE_NOISE: f64 = 1e-6;

// # Verdicts on constants

/// Largest relative error at which two coefficients may be the same constant: with a larger one they may agree by chance.
pub(super) const EQUAL_CONSTANTS_ERROR: f64 = 5e-3;
/// Standard errors within which coefficients are equal, or a fraction is near: a 95 % interval.
pub(super) const CONSTANT_ERRORS: f64 = 2.0;
/// Largest denominator and numerator of a fraction near a coefficient.
pub(super) const MOST_DENOMINATOR: i32 = 12;
pub(super) const MOST_NUMERATOR: f64 = 24.0;
/// Largest half-width of an interval times the square of a denominator at which a fraction in it is rarely there by chance: all fractions with
/// this denominator then cover 4 % of the line, divided by the denominator.
pub(super) const CHANCE_FRACTION: f64 = 0.02;

// # Held-out data and resampling

/// One in this number of blocks is held out.
pub(super) const BLOCKS_PER_HELD_OUT: usize = 5;
/// One in this number of model states is used only for validation.
pub(super) const STATES_PER_HELD_OUT: usize = 5;
/// Smallest number of trajectories at which whole trajectories are held out; fewer are cut into pieces.
pub(super) const LEAST_WHOLE_TRAJECTORIES: usize = 5;
/// Number of pieces of a trajectory otherwise.
pub(super) const PIECES_PER_TRAJECTORY: usize = 10;
/// Largest number of bootstrap samples.
pub const MOST_BOOTSTRAPS: usize = 10_000;
/// Smallest total weight of the blocks whose scatter shows how correlated the residuals are.
pub(super) const LEAST_SCORED_BLOCKS: f64 = 3.0;
/// Number of parts of a coordinate's range by which residuals are reported.
pub(super) const RESIDUAL_RANGES: usize = 8;

// # Choice of libraries and of terms by the weak form

/// Largest error of accelerations, over that of smaller libraries, at which a larger library is fitted to the motion.
pub(super) const LARGER_LIBRARY_ERROR: f64 = 0.8;
/// Largest error of accelerations, over the smallest of all choices, of a shorter choice with which the search through the motion may start.
pub(super) const STARTING_ERROR: f64 = 1.3;
/// The largest such error of a choice with a positive definite mass matrix if no closer choice has one, and of the other choices that are tried
/// if the first gives no formula.
pub(super) const DEFINITE_ERROR: f64 = 3.0;
/// Number of these other choices.
pub(super) const OTHER_STARTING_CHOICES: usize = 2;
/// Largest number of terms with which the search through the motion starts.
pub(super) const MOST_STARTING_TERMS: usize = 15;
/// Relative difference of errors below which two choices are equally good.
pub(super) const CHOICE_TIE: f64 = 1e-3;
/// Largest error of a window, over the median: a single window next to a pole of the accelerations must not decide.
pub(super) const MOST_ERROR_OVER_MEDIAN: f64 = 300.0;
/// Largest weight of a window, over the median: near a singular mass matrix an error would have unlimited weight.
pub(super) const MOST_WINDOW_WEIGHT: f64 = 5.0;
/// Factors of the speeds that weight unit masses, one for each start of the elimination; odd coordinates get their reciprocals.
pub(super) const STARTING_SPEEDS: [f64; 3] = [1.0, 3.0, 0.3];
/// Largest complexity of a function that multiplies a term of the dissipation function: that of a square, or of the sine of a double angle.
pub(super) const MOST_FRICTION_COMPLEXITY: f64 = 2.5;
/// Largest complexity of a function that multiplies a drive: that of a square, or of the sine of an angle.
pub(super) const MOST_DRIVEN_COMPLEXITY: f64 = 2.0;

// # Limits of work

/// Largest number of coordinates.
pub(super) const MOST_COORDINATES: usize = 8;
/// Highest degree of a family of functions.
pub(super) const MOST_FAMILY_DEGREE: usize = 6;
/// Largest number of functions, and of terms, of a library.
pub(super) const MOST_LIBRARY_TERMS: usize = 400;
/// Largest number of windows.
pub(super) const MOST_WINDOWS: f64 = 4000.0;
/// Approximate number of windows in which the condition of mass matrices is checked.
pub(super) const MASS_WINDOWS: usize = 200;
/// Approximate number of samples from which the range of a coordinate is computed.
pub(super) const RANGE_SAMPLES: usize = 1 << 16;
/// Usual number of states at which a model is evaluated.
pub const MODEL_STATES: usize = 1500;
/// Largest number of such states.
pub(super) const MOST_MODEL_STATES: usize = 3000;
/// Largest number of terms at which every removal is judged by the errors of accelerations and refitted; of more terms, many are removed at
/// once.
pub(super) const MOST_JUDGED_REMOVALS: usize = 40;
/// Largest number of terms at which a removal is refitted.
pub(super) const MOST_REFITTED_TERMS: usize = 12;
/// Largest number of terms at which terms are exchanged in the weak form, and the largest number of rounds.
pub(super) const MOST_EXCHANGED_TERMS: usize = 10;
pub(super) const WEAK_EXCHANGE_ROUNDS: usize = 3;
/// Number of removals, and of additions, that are tried in the weak form each time.
pub(super) const TRIED_CHANGES: usize = 6;
/// Largest number of terms that are fitted to the motion.
pub(super) const MOST_FITTED_TERMS: usize = 60;
/// Largest number of choices of terms that are fitted to the motion.
pub(super) const ROUNDS_OF_CHOICE: usize = 6;
/// About how many states show whether a mass matrix is regular in the search through the motion.
pub(super) const REGULAR_STATES: usize = 60;
/// Largest number of Gauss-Newton steps of a fit, and of such fits until the last one has converged.
pub(super) const FIT_STEPS: usize = 10;
pub(super) const MOST_FINAL_FITS: usize = 4;
/// Largest number of rounds of exchanges in the search through the motion.
pub(super) const EXCHANGE_ROUNDS: usize = 4;
/// Number of exchanges that are fitted to the motion in each round: the usual number, and the largest one if others promise more than the best
/// of them gains.
pub(super) const USUAL_EXCHANGES: usize = 3;
pub(super) const MOST_EXCHANGES: usize = 10;
/// Largest number of exchanges whose mass matrices are checked.
pub(super) const MOST_CHECKED_EXCHANGES: usize = 100;
/// Mean square of the residuals above which a formula is too far from the motion for exchanges.
pub(super) const MOST_EXCHANGE_SQUARE: f64 = 100.0;
/// Largest cost of an exchange that is considered: the linear estimate is not reliable beyond.
pub(super) const MOST_EXCHANGE_COST: f64 = 10.0 * TERM_COST;
/// Largest number of choices of terms after an exchange.
pub(super) const CHOICES_AFTER_EXCHANGE: usize = 2;
/// Largest number of terms that one candidate replaces.
pub(super) const MOST_REPLACED_TERMS: usize = 4;
/// Passes of a refit to a model: each uses the mass matrix of the previous one.
pub(super) const MODEL_REFITS: usize = 8;
/// Frequencies of a spectrum per unit of its resolution: a line between two of them loses at most 5 % of its power.
pub(super) const FREQUENCIES_PER_RESOLUTION: f64 = 4.0;
/// Largest number of frequencies of a spectrum.
pub(super) const MOST_FREQUENCIES: f64 = 50_000.0;
/// Highest peaks of a spectrum whose frequencies are refined before they are compared: those of the drive, of the own oscillation, and of a
/// multiple of each.
pub(super) const REFINED_PEAKS: usize = 4;
/// Smallest share of the squared residuals that a drive explains if it is tried although neighbouring frequencies explain the residuals as
/// well. That is so where the motion settles within a few periods, and a library explains all but the beginning. The
/// amplitude of the residuals then falls to less than a third.
pub(super) const EXPLAINING_SHARE: f64 = 0.9;
/// Largest error of accelerations of a library with a drive, over the smallest one before, at which it is fitted to the motion.
pub(super) const DRIVEN_LIBRARY_ERROR: f64 = 2.0;
/// Largest number of frequencies of a drive that are tried.
pub(super) const MOST_DRIVE_FREQUENCIES: usize = 3;
/// Largest number of terms whose effect is removed from the motion before a drive is searched.
pub(super) const MOST_REMOVED_EFFECTS: usize = 20;
/// Number of segments whose normal equations are kept at a time.
pub(super) const SEGMENTS_AT_A_TIME: usize = 256;

// # Numerics

/// Width of a test function, in time scales of the motion.
pub(super) const WINDOW_PACES: f64 = 3.0;
/// Length of the first segments, in time scales of the motion.
pub(super) const SEGMENT_PACES: f64 = 2.5;
/// Largest residual of longer segments, over that of short ones, at which the longer ones are kept: beyond, the motion is too unstable to be
/// followed for so long.
pub(super) const LONG_SEGMENT_RESIDUAL: f64 = 1.1;
/// Largest gap, over the width of a test function, that the smoothing polynomials bridge; a single lost row does not count as a gap.
pub(super) const MOST_BRIDGED_GAP: f64 = 0.2;
/// Largest product of the frequency of a drive and the width of the test functions: they damp faster drives.
pub(super) const MOST_WINDOW_PHASE: f64 = 15.0;
/// Mean squared residual that is assumed for a segment that cannot be followed.
pub(super) const FAILED_SQUARE: f64 = 1e3;
/// Mean squared residual of a segment, over the median, above which its initial state is fitted again.
pub(super) const RESCUED_RESIDUAL: f64 = 3.0;
/// Newton decrement at which a fit has converged: a tenth of a standard error.
pub(super) const CONVERGED_DECREMENT: f64 = 1e-2;
/// Share of the diagonal that is added for directions that the motion does not determine: far above rounding, far below any information.
pub(super) const RIDGE: f64 = 1e-10;
/// Largest such share, which holds undetermined coefficients at those of the model.
pub(super) const MOST_RIDGE: f64 = 1e-2;
/// Length of a column of equations below which its term vanishes.
pub(super) const VANISHING_TERM: f64 = 1e-12;
/// Relative remainder below which a term is a combination of others: above the rounding of several hundred orthogonalized columns.
pub(super) const DEPENDENT_REMAINDER: f64 = 1e-7;
/// Relative remainder up to which the combination itself is known, and the smallest coefficient that belongs to it.
pub(super) const COMBINATION_REMAINDER: f64 = 1e-6;
