//! Every number that decides a verdict, limits the work or sets a method of analysis.
//!
//! `lnn-studies rates --part readings` counts how often networks are called good, an energy conserved and a motion chaotic;
//! `docs/verdicts.md` states the rates.

// ---- Validity of predictions, and chaos (rows "chaotic" of `lnn-studies rates --part readings`) ----

/// The relative error up to which a prediction is valid.
pub const VALID: f64 = 0.4;
/// Logarithm of the growth of a separation, below which a motion of at most [`REGULAR_TIME`] is regular: its Lyapunov time is then above a
/// fifth of the time span. Separations of regular motions grow in proportion to time, by a factor of some 50 in 50 s.
pub const REGULAR: f64 = 5.0;
/// Time from which the growth of regular motion is allowed to increase in proportion to time.
pub(super) const REGULAR_TIME: f64 = 50.0;
/// Largest distance of neighbours in the numbers of the chart, over that at the start: more would leave the linear range.
pub(super) const WIDEST_SEPARATION: f64 = 1e4;
/// Renormalisations of a separation over a motion, enough for an exponent.
pub(super) const RENORMALISATIONS: f64 = 100.0;
/// Smallest tolerance of the motions of an estimate.
pub(super) const SEPARATION_TOLERANCE: f64 = 1e-10;

// ---- Friction ----

/// Standard errors by which a loss of energy or a rate of decay must exceed 0.
pub(super) const FRICTION_SIGNIFICANCE: f64 = 4.0;
/// Fewest stretches of a steady loss of energy.
pub(super) const LEAST_STRETCHES: usize = 5;
/// Smallest share of the stretches that lose energy.
pub(super) const LEAST_LOSING: f64 = 0.8;
/// Smallest loss over a stretch, as a share of the kinetic energy.
pub(super) const LEAST_LOSS: f64 = 0.01;
/// Stretches that trajectories are cut into, at least about; their fewest samples, and their fewest energies.
pub(super) const LOSS_STRETCHES: usize = 20;
pub(super) const LEAST_STRETCH_SAMPLES: usize = 8;
pub(super) const LEAST_STRETCH_ENERGIES: usize = 4;
/// Largest number of samples of a stretch at which the energy is examined.
pub(super) const STRETCH_SAMPLES: usize = 64;
/// Smallest share of the acceleration that counts as decay.
pub(super) const LEAST_DECAY: f64 = 0.005;
/// Largest residual of the acceleration over its size: above it, the motion is of another kind.
pub(super) const MOST_DECAY_RESIDUAL: f64 = 0.3;
/// Degree of the functions of the coordinate.
pub(super) const DECAY_DEGREE: usize = 4;
/// Weight of the data relative to the prior that no part of the acceleration exceeds the acceleration itself.
pub(super) const DECAY_TRUST: f64 = 1e3;

// ---- What the data determine (rows "good" of `lnn-studies rates --part readings`) ----

/// Largest misfit of held-out motion for which the ranges of a model are valid.
pub const MOST_MISFIT: f64 = 0.3;
/// Standard deviations on either side that a range has.
pub(super) const RANGE: f64 = 2.0;
/// Share of the prior standard deviation that the data must leave for a number to count as open.
pub(super) const OPEN_SHARE: f64 = 0.5;
/// Largest rate of a momentum that counts as conserved, relative to the two parts of the rate (root mean squares). Models that explain the
/// motion of a planet have 0.07 to 0.3 in the angle, models of a cart with some friction 0.05 to 0.45; where a force acts the rate is 0.5
/// to 1.
pub(super) const CONSERVED_RATE: f64 = 1.0 / 3.0;
/// Share of an acceleration up to which the influence of another coordinate may be an error of the network: small networks of motion
/// without any coupling that miss 7 to 29 % of held-out accelerations show influences of 0.05 to 0.23, below twice that error, and networks
/// of coupled motion that miss 4 to 11 % show 0.18 to 0.32.
pub(super) const LEAST_INFLUENCE: f64 = 0.1;
/// Fraction of a range by which a state may lie outside the range.
pub(super) const OUTSIDE_MARGIN: f64 = 0.05;
/// Groups of consecutive states for the jackknife, each long enough to be independent of the others.
pub(super) const JACKKNIFE_GROUPS: usize = 20;
/// Fewest groups: a standard error from three has itself an error of a half.
pub(super) const LEAST_GROUPS: usize = 4;
/// Fewest states of a group.
pub(super) const LEAST_GROUP_STATES: usize = 5;
/// Smallest mean square of the residuals over that of the accelerations, against division by zero.
pub(super) const LEAST_SQUARE_RESIDUAL: f64 = 1e-20;

// ---- Changes of a model that the data may support ----

/// Most changes that are considered.
pub(super) const MOST_CHANGES: usize = 260;
/// Highest degree of functions of the coordinates.
pub(super) const CHANGE_DEGREE: usize = 4;
/// Most coordinates for changes that depend on the coordinates: their number grows as a power of that of the coordinates.
pub(super) const MOST_DEPENDENT_COORDINATES: usize = 8;
/// Most coordinates for changes of fourth degree in the velocities.
pub(super) const MOST_QUARTIC_COORDINATES: usize = 3;
/// Prior size of a potential in kinetic energies, and of friction in inertial forces.
pub(super) const PRIOR_SIZE: f64 = 3.0;
/// Velocity at which dry friction saturates, over the root mean square velocity.
pub(super) const DRY_KNEE: f64 = 0.2;

// ---- States that are examined ----

/// States of observed motion; of more, evenly spaced ones.
pub(super) const EXAMINED_STATES: usize = 4000;
/// States at which couplings are examined.
pub(super) const INFLUENCE_STATES: usize = 500;
/// States at which the energy is examined.
pub(super) const ENERGY_STATES: usize = 256;

// ---- Ranges of learned constants ----

/// Samples of a stretch, and integration steps.
pub(super) const CONSTANT_STRETCH: usize = 40;
/// Fewest samples of a stretch.
pub(super) const LEAST_CONSTANT_STRETCH: usize = 8;
/// Samples that are examined; of more, evenly spaced stretches.
pub(super) const CONSTANT_SAMPLES: usize = 6000;
/// Corrections of the starts.
pub(super) const START_CORRECTIONS: usize = 4;
/// Largest number of parameters of a kind besides the constants; if there are more, evenly spaced ones are used.
pub(super) const EXAMINED_WEIGHTS: usize = 128;
/// Step of a central difference by a parameter, over its size: its truncation error is 1e-8.
pub(super) const PARAMETER_STEP: f64 = 1e-4;
/// Smallest independent fraction at which a column counts.
pub(super) const INDEPENDENT_COLUMN: f64 = 1e-10;

// ---- Predictions and tubes ----

/// Steps that a predicted motion may always take: irregular ones would take a million.
pub(super) const LEAST_STEPS: usize = 1000;
/// Further steps per sample of the windows; one step of a healthy motion covers several samples.
pub(super) const STEPS_PER_SAMPLE: f64 = 4.0;
/// Relative rounding error of times, and of counts that are computed from shares.
pub(super) const TIME_ROUNDING: f64 = 1e-9;
/// Spread of a coordinate over its value up to which it does not move.
pub(super) const ROUNDING_SPREAD: f64 = 1e-9;
/// Most times at which the scale of a tube is known; it is linear between them.
pub(super) const TUBE_KNOTS: usize = 50;

// ---- The test of trajectories, and its pictures ----

/// Steps after which a learned motion is abandoned: ten times those of a regular motion over the longest test. The motion of a model with a
/// singular mass matrix then takes only seconds.
pub(super) const LEARNED_STEPS: usize = 30_000;
/// Starts whose motions are computed together.
pub(super) const RUNS_AT_ONCE: usize = 64;
/// Samples of a drawn motion.
pub(super) const DRAWN_SAMPLES: f64 = 4000.0;
/// Lyapunov times that are drawn of a chaotic motion, at least and at most.
pub(super) const DRAWN_LYAPUNOV_TIMES: (f64, f64) = (4.0, 12.0);
/// Time span of a picture over the time of valid prediction, so that it shows how the two motions separate.
pub(super) const DRAWN_BEYOND_VALID: f64 = 1.3;
/// Turns of its liveliest coordinate that are drawn of a regular motion: ten swings.
pub(super) const DRAWN_TURNS: usize = 20;
/// Most turns that are drawn of a chaotic motion: under weak chaos neighbours separate only after many swings.
pub(super) const MOST_DRAWN_TURNS: usize = 40;

// ---- Comparisons and grids ----

/// Epochs of the filter that finds the trend of a loss.
pub(super) const LOSS_WINDOW: usize = 15;
/// Fewest losses whose trend can be found.
pub(super) const LEAST_LOSSES: usize = 5;
/// States at which accelerations are compared at once.
pub(super) const COMPARED_AT_ONCE: usize = 256;
/// Points whose geometry is computed at once.
pub(super) const POINTS_AT_ONCE: usize = 64;
/// Most points of an axis.
pub(super) const MOST_AXIS_POINTS: usize = 10_000;
/// Relative difference of `L` and the energy up to which `L` is a quadratic form of the velocity.
pub(super) const METRIC_ROUNDING: f64 = 1e-9;

// ---- Reports of states ----

/// Roundings up to which `L` and the energy of a state are equal, as those of a quadratic form of the velocity are.
pub(super) const METRIC_ROUNDINGS: f64 = 1024.0;
/// Largest number of parameters whose derivatives are reported: those of systems, not the weights of networks.
pub(super) const MOST_SHOWN_PARAMETERS: usize = 256;
