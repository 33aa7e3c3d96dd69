//! Every number that decides a verdict, limits the work or sets a method of identification.
//!
//! The verdicts that these numbers lead to are counted on systems whose truth is known: `lnn-studies rates --part identify` checks the tests of a
//! model, the standard errors and the fits to forces, `--part machines` the fits to driven machines, the search of phases and the search of
//! initial states. The page `docs/verdicts.md` states the rates.

// ---- Whether a model fits (checked by `lnn-studies rates --part identify`) ----

/// Largest ratio of residuals to noise at which a model fits. The noise is itself only estimated, so that the ratio of a right model is not
/// exactly 1; a missing term of half the noise, added in squares, gives 1.1 and is left to the test of independence.
pub(super) const MOST_OVER_NOISE: f64 = 1.3;
/// Significance level of the test that residuals are independent, and of the test that trajectories share a constant. Together with the two
/// tests at [`SEGMENT_SIGNIFICANCE`], these levels reject 1.5 of 100 right models if the tests are independent.
pub(super) const SIGNIFICANCE: f64 = 0.01;
/// Significance level of the tests that segments share their constants and continue each other: a quarter of [`SIGNIFICANCE`] each.
pub(super) const SEGMENT_SIGNIFICANCE: f64 = SIGNIFICANCE / 4.0;
/// Residual over the spread of the fitted quantity above which the data cannot test a model: the noise then makes up a quarter of the variance.
pub(super) const MOST_NOISE_SHARE: f64 = 0.5;
/// Largest share of outliers. Noise alone makes one in 26 million samples an outlier, so that any share that can be seen has another cause.
pub(super) const MOST_OUTLIERS: f64 = 0.01;
/// Residual over the typical one from which a sample is an outlier: normal noise exceeds it once in 26 million samples.
pub(super) const OUTLIER: f64 = 5.5;
/// Smallest noise that is assumed, over the spread of a coordinate: the accuracy of the integration.
pub(super) const LEAST_NOISE: f64 = 1e-9;
/// Residual over the spread of a coordinate up to which it is due to the integration: a few times the accuracy that is assumed of it.
pub(super) const EXACT_RESIDUAL: f64 = 5.0 * LEAST_NOISE;
/// Factor by which [`EXACT_RESIDUAL`] grows for motion from another, coarser integrator: 2e-7 of the spread in all.
pub(super) const COARSE_INTEGRATION: f64 = 40.0;
/// Largest residual over the noise that a coarser integration explains. Its error is smooth, but no smoother than noise that is estimated from
/// differences of neighbouring samples.
pub(super) const COARSE_OVER_NOISE: f64 = 4.0;
/// Lags of the test of independence. A missing term is correlated over many samples, and a sum over as many lags detects it best; more lags
/// detect no more.
pub(super) const WHITENESS_LAGS: usize = 20;
/// Autocorrelation at a lag, in standard deviations of that of white noise, below which residuals count as uncorrelated from there on: two
/// standard deviations.
pub(super) const UNCORRELATED: f64 = 2.0;
/// Numbers of samples over which residuals of forces are summed to detect slow ones: a factor of four apart, as the sums change slowly with it.
pub(super) const DRIFT_BLOCKS: [usize; 3] = [4, 16, 64];
/// Smallest eigenvalue of a segment's correlation matrix from which the segment determines constants of its own.
pub(super) const LEAST_SEGMENT_EIGENVALUE: f64 = 1e-6;
/// Largest Newton decrement per number of the initial states at which the segments can be compared: a tenth of a standard error.
pub(super) const MOST_START_DECREMENT: f64 = 0.01;

// ---- Whether the search has converged (checked by the rows "not converged" of `lnn-studies rates --part identify`) ----

/// Newton decrement over the variance of the noise at which the search has converged: constants within a thousandth of their standard errors.
pub(super) const CONVERGED_DECREMENT: f64 = 1e-6;
/// The same up to which every constant is within a standard error of the minimum: farther away, errors and what is determined are not known.
pub(super) const NEAR_DECREMENT: f64 = 1.0;
/// The same if no step, however short, reduces the sum of squares: the effect of rounding and of the integrator's steps.
pub(super) const STALLED_DECREMENT: f64 = 1e-3;
/// The same for noisy forces: the derivatives neglect how the filter depends on the unknowns, which shifts the minimum by a tenth of a standard
/// error.
pub(super) const FILTERED_DECREMENT: f64 = 1e-2;
/// The same for a fit to moved constants: a tenth of a standard error.
pub(super) const MOVED_DECREMENT: f64 = 1e-2;
/// Decrease of the sum of squares, as a share of it, below which a round of fits of the initial states is the last.
pub(super) const LEAST_START_DECREASE: f64 = 1e-4;
/// Relative change of all weights of coordinates that ends their updates: half the error of a standard deviation from 1,000 samples.
pub(super) const WEIGHT_CHANGE: f64 = 0.01;

// ---- What the motion determines (checked by the rows "determined" of `lnn-studies rates --part identify`) ----

/// Relative error above which the motion does not depend on a direction: its effect is rounding.
pub(super) const NO_DEPENDENCE: f64 = 1e6;
/// Size of an unknown that starts at 0, in standard errors with the others held fixed.
pub(super) const SIZE_FROM_ERROR: f64 = 10.0;
/// Share of the squared effect of an unknown that is rounding after the elimination of initial states, a thousand times [`RIDGE`]: sums over
/// many samples lose digits.
pub(super) const ELIMINATED_ROUNDING: f64 = 1e-8;
/// Factor by which a squared effect must exceed its rounding to count as one.
pub(super) const OVER_ROUNDING: f64 = 10.0;
/// Share of the largest effect along a direction that is rounding of the eigenvectors; unknowns are scaled to effects of at most 1e4.
pub(super) const EIGENVECTOR_ROUNDING: f64 = 1e-6;
/// Share of the largest change above which another change counts as equally large, so that rounding does not choose the pivot.
pub(super) const EQUAL_CHANGE: f64 = 0.99;
/// Squared share of the effect of an unknown that other initial states cannot reproduce; the accuracy of integrators.
pub(super) const LIKE_STARTS: f64 = 1e-8;
/// Squared effect of an unknown on the motion, over the motion itself, that is only rounding: an effect of 1e-11.
pub(super) const NO_EFFECT: f64 = 1e-22;
/// The same during the search, where a constant may be far smaller than its final value.
pub(super) const NO_EFFECT_IN_SEARCH: f64 = 1e-26;
/// Increase of the sum of squares, in units of the noise variance, up to which another fit is equally good, with moved constants or with another
/// interpolation of the forces: three standard deviations.
pub(super) const EQUAL_FIT_INCREASE: f64 = 9.0;
/// Factor by which constants are moved, up and down, to confirm a combination.
pub(super) const CONFIRMING_FACTOR: f64 = 2.0;
/// Factor in a sum, relative to the effect of the first constant, below which a constant does not take part in it: rounding.
pub(super) const SUM_ROUNDING: f64 = 1e-5;
/// Largest power of a constant in a product.
pub(super) const MOST_POWER: i64 = 6;
/// Largest denominator of a fraction.
pub(super) const MOST_DENOMINATOR: i64 = 4;
/// Distance of an exponent from a fraction that counts as rounding. Exponents along exact symmetries hold to 1e-6; the finite move refutes false
/// ones.
pub(super) const FRACTION_ROUNDING: f64 = 0.02;
/// Share of a factor that is rounding.
pub(super) const FACTOR_ROUNDING: f64 = 1e-6;
/// Relative change of the slopes of forces up to which equations count as linear in the constants: rounding.
pub(super) const SLOPE_ROUNDING: f64 = 1e-9;

// ---- Which motion is recommended (checked by the tests of this module on a pendulum, a spring and closed chains) ----

/// A motion is recommended if it is this many times as informative as the recorded one.
pub(super) const RECOMMENDED_GAIN: f64 = 2.0;
/// Smallest effect, relative to other states, that is assumed at the recorded states.
pub(super) const LEAST_EFFECT: f64 = 1e-6;
/// Singular value of the effect of directions, relative to the separate effects of their unknowns, below which it is rounding.
pub(super) const SINGULAR_ROUNDING: f64 = 1e-6;
/// A coordinate stands still if its spread, relative to the largest, is at most this.
pub(super) const STANDSTILL: f64 = 1e-9;
/// Largest number of states at which the effect of a direction is evaluated.
pub(super) const MOST_PROBED_STATES: usize = 256;

// ---- Standard errors (checked by the rows "90 % range holds" of `lnn-studies rates --part identify`) ----

/// Residuals beyond this many standard deviations count linearly in robust fits and in fits to smoothed motion. Of normal noise three in a thousand
/// lie there, so that a fit without outliers loses less than 1 % of its accuracy.
pub(super) const HUBER: f64 = 3.0;
/// Largest window of correlated residuals, as a share of the samples: a longer one leaves too few independent sums.
pub(super) const MOST_WINDOW: f64 = 0.25;
/// Smallest share of degrees of freedom that initial states and constants leave.
pub(super) const LEAST_FREEDOM: f64 = 0.25;
/// Smallest number of segments whose scatter is used to widen errors.
pub(super) const LEAST_SCATTERED_SEGMENTS: usize = 8;
/// Standard deviations by which the scatter of segments must exceed that of noise to widen errors.
pub(super) const SCATTER_ERRORS: f64 = 2.0;
/// Difference between interpolations, in standard errors, from which it is reported: added in squares it doubles the error, at the root of 3.
pub(super) const RIVAL_DIFFERENCE: f64 = 1.7;
/// Simulated copies of a recording. A standard deviation of 20 numbers has an error of 16 %, and each copy costs a fit.
pub(super) const COPIES: usize = 20;
/// Additional degree of the polynomials that give the true motion of the copies. Windows for this degree are wider than those used for smoothing.
pub(super) const MORE_DEGREES: usize = 2;
/// Largest distance of integrated accelerations from the positions, as a share of the spread of a coordinate, at which the copies use them.
pub(super) const MOST_DRIFT: f64 = 0.1;
/// Width of a smoothing window over the half-width of the double average of equations, which so spans two thirds of a window in all. With this
/// value, confidence intervals have their stated coverage.
pub(super) const WINDOW_OVER_HALF_WIDTH: usize = 6;
/// Smallest residual that is assumed, over the spread of a force.
pub(super) const LEAST_FORCE_RESIDUAL: f64 = 1e-9;
/// Smallest unit of a force under constraints over the largest, so that a force without errors does not outweigh all others.
pub(super) const LEAST_FORCE_UNIT: f64 = 1e-3;

// ---- Noise of trajectories and of forces (checked by `lnn-studies rates --part identify`) ----

/// Smallest number of samples from which the noise of a single trajectory is estimated: a standard deviation of 40 numbers has an error of 11 %.
pub(super) const LEAST_OWN_NOISE_SAMPLES: usize = 40;
/// Log ratio of the noise of a trajectory to that of all above which it has a noise of its own.
pub(super) const OWN_NOISE_RATIO: f64 = 0.25;
/// The same in standard errors of the logarithm of a standard deviation.
pub(super) const OWN_NOISE_ERRORS: f64 = 5.0;
/// Smallest noise after an update, over that before it: keeps the weight of a coordinate that is fitted exactly finite.
pub(super) const LEAST_NOISE_LEFT: f64 = 1e-3;
/// Largest noise of forces that is tried, over that of neighbouring samples, which bounds it but is itself only estimated.
pub(super) const MOST_FORCE_NOISE: f64 = 1.5;
/// Number of factors of that noise that are tried, `4^-k`: down to a part in 4,000.
pub(super) const FORCE_NOISE_FACTORS: i32 = 7;
/// Decrease of minus twice the log-likelihood above which forces have noise: 1 in 1,000 by chance.
pub(super) const FORCE_NOISE_GAIN: f64 = 10.0;
/// Standard deviation of an unknown initial state, in units of what a single position determines of it: large enough to count as unknown, small
/// enough that rounding does not matter.
pub(super) const UNKNOWN_START: f64 = 100.0;
/// Largest variance of an innovation, over that of the noise, at which it is used: larger ones come from the unknown initial state.
pub(super) const MOST_INNOVATION_VARIANCE: f64 = 100.0;

// ---- Segments (checked by `lnn-studies rates --part identify` and `--part machines`) ----

/// Smallest number of samples in all trajectories together: those of two first segments.
pub(super) const LEAST_SAMPLES: usize = 12;
/// Smallest number of samples in a piece that is smoothed.
pub(super) const LEAST_SMOOTHED_SAMPLES: usize = 12;
/// Smallest number of samples in a first segment: three times the numbers of an initial state of one coordinate.
pub(super) const LEAST_SEGMENT: usize = 6;
/// Smallest number of samples in a useful trajectory: its initial state uses up two.
pub(super) const LEAST_TRACK: usize = 3;
/// Length of a first segment, in time scales of the motion: two fifths of the period of an oscillation.
pub(super) const FIRST_SEGMENT: f64 = 2.5;
/// Number of samples in a first segment of motion without a time scale.
pub(super) const USUAL_FIRST_SAMPLES: f64 = 20.0;
/// Largest number of samples in a first segment.
pub(super) const MOST_FIRST_SAMPLES: f64 = 400.0;
/// Largest number of samples that are fitted.
pub(super) const MOST_SAMPLES: usize = 60_000;
/// Number of consecutive segments that are kept or left out together, so that they can be joined four times.
pub(super) const SEGMENTS_OF_RUN: usize = 16;
/// Largest factor by which longer segments may increase the mean square.
pub(super) const MOST_INCREASE: f64 = 1.5;
/// Smallest decrease of the mean log standard error that longer or shorter segments must bring: 1 %.
pub(super) const LEAST_ERROR_DECREASE: f64 = 0.01;
/// Factor by which segments may be shorter than was chosen: between as long and half as long, since twice as long is tried too.
pub(super) const SHORT_OF_CHOSEN: f64 = 1.5;
/// Relative change of the sum of squares up to which a full turn of a constant changes nothing.
pub(super) const EQUAL_SQUARES: f64 = 1e-6;

// ---- Search of phases (checked by `lnn-studies rates --part machines`) ----

/// Range of a constant of a phase that is searched on either side of its given value, as a share of it.
pub(super) const PHASE_RANGE: f64 = 0.5;
/// Largest number of values that are tried on either side.
pub(super) const MOST_PHASE_VALUES: usize = 40;
/// The same after the part of the recording that is searched has doubled.
pub(super) const DOUBLED_PHASE_VALUES: usize = 3;
/// Smallest cosine of the angle between the derivatives by a constant before and after a small change: an angle of
/// 0.8 rad between them.
pub(super) const LEAST_COSINE: f64 = 0.7;
/// Largest number of halvings of a change until it is small: down to two millionths of the range.
pub(super) const PHASE_HALVINGS: i32 = 20;
/// Smallest relative decrease of the sum of squares that makes a fit farther from the given constants the better one. Fits within it are the
/// same law written in two ways, such as a drive of the other sign half a turn away, and differ by how far they have converged.
pub(super) const LEAST_PHASE_DECREASE: f64 = 1e-3;
/// Shortest part of a recording that is searched first.
pub(super) const SHORTEST_BEGINNING: f64 = 1.0 / 16.0;

// ---- Search of initial states (checked by the rows of the binary star of `lnn-studies rates --part machines`) ----

/// Rounds in which the initial states are fitted to the beginning of a trajectory, and to twice as much of it.
pub(super) const SEARCH_ROUNDS: usize = 15;
/// Initial states that are fitted to twice as much of the trajectory.
pub(super) const PROMISING_STARTS: usize = 16;
/// Initial states from which the constants are fitted.
pub(super) const CONTINUED_STARTS: usize = 5;
/// Relative difference of the sums of squares up to which two initial states are one.
pub(super) const EQUAL_STARTS: f64 = 1e-4;
/// Largest mean square at which a motion is continued: residuals of twice the noise.
pub(super) const MOST_CONTINUED_SQUARE: f64 = 4.0;
/// Number of segments to which the constants are fitted first.
pub(super) const SEGMENTS_BEFORE_CONSTANTS: usize = 4;
/// Number of segments that the model must fit so that no other initial state is tried.
pub(super) const ENOUGH_SEGMENTS: usize = 16;

// ---- Limits of work (a search that ends at a limit says so) ----

/// Segments that are integrated side by side, and initial states that are tried for a segment.
pub(super) const LANES: usize = 64;
/// Largest number of trajectories that are identified one by one.
pub(super) const MOST_SINGLE_TRAJECTORIES: usize = 64;
/// Largest number of trajectories with constants of their own: each is an unknown, and a step takes the cube of their number.
pub(super) const MOST_OWN_CONSTANTS: usize = 64;
/// Largest number of states of smoothed motion.
pub(super) const MOST_SMOOTHED_STATES: usize = 12_000;
/// Largest number of outliers in a result.
pub(super) const MOST_LISTED_OUTLIERS: usize = 100;
/// Largest number of outliers and of correlations in a report.
pub(super) const MOST_REPORTED: usize = 10;
/// Smallest correlation of errors in a report.
pub(super) const REPORTED_CORRELATION: f64 = 0.9;
/// Largest number of steps of a fit.
pub(super) const ITERATIONS: usize = 40;
/// Largest number of steps of the last fit, which gives the result: if it takes more, it has not converged.
pub(super) const LAST_ITERATIONS: usize = 200;
/// Largest number of steps of a fit to smoothed motion.
pub(super) const SMOOTHED_ITERATIONS: usize = 60;
/// Rounds in which initial states are adapted to other unknowns, or to segments that were joined.
pub(super) const START_ROUNDS: usize = 6;
/// The same after small changes: halved segments, another interpolation.
pub(super) const FEW_START_ROUNDS: usize = 3;
/// Largest number of steps of a fit to moved constants.
pub(super) const MOVED_ITERATIONS: usize = 12;
/// Largest number of halvings of each of these steps.
pub(super) const MOVED_HALVINGS: usize = 5;
/// Largest number of updates of the weights of coordinates; a fit that needs more is reported as not converged.
pub(super) const WEIGHT_UPDATES: usize = 20;
/// Largest number of integration steps between samples.
pub(super) const MOST_SUBSTEPS: usize = 64;
/// Largest number of segments by which the number of integration steps is chosen.
pub(super) const STEP_PROBES: usize = 32;

// ---- Numerics ----

/// Error of the integrator over the noise: it then adds 0.25 % to the mean square.
pub(super) const INTEGRATION_ERROR: f64 = 0.05;
/// Share of the diagonal that is added to keep normal equations regular: directions that the data do not determine get the smallest solution.
pub(super) const RIDGE: f64 = 1e-11;
/// Rounding of an eliminated diagonal, over the diagonal before initial states were eliminated: some tens of roundings of a double.
pub(super) const ELIMINATION: f64 = 1e-14;
/// Diagonal of a constant that counts as given: far above every effect, far below overflow.
pub(super) const GIVEN_WEIGHT: f64 = 1e100;
/// Damping of the first step.
pub(super) const FIRST_DAMPING: f64 = 1e-4;
/// Smallest damping: below the ridge it would change nothing.
pub(super) const LEAST_DAMPING: f64 = 1e-10;
/// Damping beyond which no step improves the fit.
pub(super) const MOST_DAMPING: f64 = 1e8;
/// Sum of squares per residual that is assumed for a segment that cannot be integrated: a residual of 10,000 times the noise.
pub(super) const FAILED_SQUARE: f64 = 1e8;
/// The same for an equation of smoothed motion that is not finite.
pub(super) const FAILED_EQUATION: f64 = 1e6;
/// Smallest share of a positive constant that a step leaves.
pub(super) const LEAST_SHARE_LEFT: f64 = 0.1;
/// Smallest value of a positive constant, over its starting value: its bound.
pub(super) const LEAST_POSITIVE: f64 = 1e-12;
/// Largest delay of a sensor, in typical steps between samples.
pub(super) const MOST_DELAY: f64 = 20.0;
/// A large delay of a sensor, in typical steps between samples, with which its error is compared.
pub(super) const USUAL_DELAY: f64 = 10.0;
/// Largest weight of a smoothed acceleration over the median: a single sample that happens to look exact does not outweigh all others.
pub(super) const MOST_WEIGHT: f64 = 5.0;
/// Share of the decrement that a step leaves at most if the next step uses its matrix again.
pub(super) const MATRIX_KEPT: f64 = 0.01;
/// Share of the diagonal that is added to polynomials through few samples: pieces of fewer than three times have the smallest one.
pub(super) const POLYNOMIAL_RIDGE: f64 = 1e-9;
/// Share of a force, in units of the forces of its state, that is rounding.
pub(super) const FORCE_ROUNDING: f64 = 1e-12;
/// Rows of a block of products.
pub(super) const PRODUCT_ROWS: usize = 64;

// ---- Physical inertias ----

/// Weights of the barrier, from first to last. The last one costs a hundredth of a squared standard error.
pub(super) const BARRIER_WEIGHTS: [f64; 8] = [1e5, 1e4, 1e3, 1e2, 1e1, 1.0, 0.1, 0.01];
/// Largest number of Newton steps for each weight.
pub(super) const BARRIER_STEPS: usize = 60;
/// Largest number of halvings of each of these steps.
pub(super) const BARRIER_HALVINGS: usize = 50;
/// Newton decrement at which the steps end, in units of the weight where this is above 1.
pub(super) const BARRIER_DECREMENT: f64 = 1e-9;
/// Share of the predicted decrease that a step must reach (Armijo's rule).
pub(super) const BARRIER_DECREASE: f64 = 0.1;
/// Share of the diagonal that is added to the Hessian.
pub(super) const BARRIER_RIDGE: f64 = 1e-14;
/// Smallest eigenvalue of a pseudo-inertia, in units of its diagonal, at which a body is left unchanged.
pub(super) const LEAST_INERTIA: f64 = 1e-6;
/// Standard deviations of the squared distance between estimates and truth, in standard errors, within which bodies with the true sums lie.
pub(super) const BODY_ERRORS: f64 = 4.0;
