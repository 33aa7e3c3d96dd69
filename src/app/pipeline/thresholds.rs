//! Numbers that decide or limit what a pipeline reports, in one table.

use std::time::Duration;

// Verdicts of headlines and notes. They only choose words; the adjacent numbers and `lnn-studies rates --part check|formula` check them.

/// Largest share of states with a wrong signature that a headline does not mention.
pub(super) const MOST_WRONG_SIGNATURES: f64 = 0.01;
/// Lyapunov times from which on predictions of chaotic motion are good: an error at the start has grown by a factor of e^3 = 20.
pub(super) const GOOD_LYAPUNOV_TIMES: f64 = 3.0;
/// Share of the tested time below which predictions of motion without chaos are bad.
pub(super) const BAD_SHARE_OF_TIME: f64 = 0.01;
/// Energy over the mean kinetic energy that may be lost or gained without a force or friction that explains it.
pub(super) const UNACCOUNTED_ENERGY: f64 = 0.1;
/// Factor by which a prediction must be better than constant velocity to count as better.
pub(super) const BETTER_THAN_CONSTANT_VELOCITY: f64 = 1.05;
/// Largest mean squared error of a force over its variance at which the force is well learned.
pub(super) const WELL_LEARNED_FORCE: f64 = 0.05;
/// The same error above which the force is not learned: a constant has an error of 1.
pub(super) const FAILED_FORCE: f64 = 0.3;
/// Largest misfit of a model whose loss of energy says something about the motion: the model explains most of the motion.
pub(super) const MISFIT_OF_ENERGY: f64 = 0.5;
/// Share of the held-out states outside the training states above which a note mentions it.
pub(super) const MOST_OUTSIDE: f64 = 0.1;
/// The same share above which held-out motion differs so much from the training motion that it tests nothing.
pub(super) const MOSTLY_OUTSIDE: f64 = 0.5;
/// Largest half-width of a range over the size of a quantity at which the quantity counts as determined, with the words for it: to one
/// digit, to a factor of about 2, with the right sign.
pub(super) const DETERMINED: [(f64, &str); 3] = [(0.1, "well"), (0.5, "roughly"), (1.0, "poorly")];
/// Jitter of a time step, relative to the step, that is due to rounding of the recorded times.
pub(super) const ROUNDING_OF_TIME_STEPS: f64 = 1e-6;

// Defaults of an evaluation; the paper's where it states them.

/// Relative tolerance of the learned motion in the paper's test.
pub const RTOL: f64 = 1e-6;
/// Starts of the trajectory test, as in the paper.
pub(crate) const STARTS: usize = 4;
/// Fresh states on which accelerations are compared: a median is known to about 1 %.
pub(super) const FRESH_STATES: usize = 12_000;
/// Share of the samples that a fit holds out by default.
pub const HELD_OUT: f64 = 0.2;
/// Samples ahead that are predicted by default.
pub(super) const SAMPLES_AHEAD: f64 = 200.0;
/// Width of the network beside a known part, and its weight decay: small, because effects that network and constants share are not
/// identifiable and should go to the constants.
pub(super) const RESIDUAL_WIDTH: usize = 8;
/// See [`RESIDUAL_WIDTH`].
pub(super) const RESIDUAL_DECAY: f64 = 0.01;
/// Seconds between two checkpoints of a run of an experiment.
pub(super) const CHECKPOINT_SECONDS: f64 = 60.0;
/// Seed of the states on which the physics of a model is examined.
pub(super) const PHYSICS_SEED: u64 = 0;

// Limits of work.

/// Pieces of work of an evaluation: accelerations, motions, pictures, physics.
pub(super) const EVALUATION_PIECES: usize = 4;
/// Largest number of predicted windows of held-out motion; more are thinned evenly.
pub(super) const MOST_WINDOWS: usize = 500;
/// Number of evenly spaced windows that are tried first: if more than half of them fail, the others would probably fail as well, each after
/// the allowed number of steps.
pub(super) const PILOT_WINDOWS: usize = 40;
/// Windows between two checks of the interrupt flag; a multiple of the motions that are integrated together.
pub(super) const WINDOWS_AT_ONCE: usize = 32;
/// States evaluated at once.
pub(super) const STATES_AT_ONCE: usize = 4096;
/// Approximate number of states whose mass matrix is examined; more are thinned evenly.
pub(super) const SIGNATURE_STATES: usize = 20_000;
/// Fewest states for a comparison with the exact Lagrangian.
pub(super) const EQUIVALENCE_STATES: usize = 400;
/// States at which constraints are compared with each other.
pub(super) const CONSTRAINT_STATES: usize = 24;
/// States that are examined for a note on the penalty, which determine a share of one half to 2 %.
pub(super) const PENALTY_STATES: usize = 512;
/// Evaluations between two reports of progress.
pub(super) const EVALUATIONS_PER_REPORT: u64 = 1024;
/// Largest number of samples in which a first look seeks laws: seconds of searching.
pub(super) const FIRST_LOOK_SAMPLES: usize = 2000;
/// Fewest samples that a trajectory keeps in a first look.
pub(super) const FIRST_LOOK_LEAST: usize = 200;
/// Largest number of coordinates for which a first look seeks a formula: the number of terms grows with their fourth power.
pub(super) const FIRST_LOOK_COORDINATES: usize = 4;
/// Longest time for which a first look seeks a formula.
pub(super) const FIRST_LOOK_TIME: Duration = Duration::from_secs(2);
/// Largest number of networks in a fit; each is trained separately.
pub(super) const MOST_MEMBERS: usize = 32;
/// Largest number of samples in a smoothing window.
pub(super) const MOST_WINDOW_SAMPLES: usize = 1_000_001;
/// Largest product of weights, `n` and points of the maps of a metric: a second or so.
pub(super) const METRIC_WORK: usize = 150_000_000;
/// Largest product of weights, `n^3` and points of the curvature: a second or so.
pub(super) const CURVATURE_WORK: usize = 100_000_000;
/// Largest product of weights, `n^2` and boxes of a certificate: a second or so.
pub(super) const CERTIFICATE_WORK: usize = 80_000_000;
/// Largest number of boxes of a certificate.
pub(super) const CERTIFICATE_BOXES: usize = 2000;
/// Longest result of an earlier run that is read back, in bytes.
pub const MAX_RESULT_BYTES: u64 = 1 << 26;
/// Longest `run.json` that is read, in bytes; it is a single line.
pub(super) const MAX_RUN_BYTES: u64 = 1 << 12;

// Pictures and tables.

/// Points of a grid of an evaluation along each axis.
pub(super) const GRID_POINTS: usize = 81;
/// Starts whose motion is drawn.
pub(super) const DRAWN_STARTS: usize = 4;
/// Velocities of the fast map of `det M` over the upper bounds of the validation states.
pub(super) const FAST_VELOCITY: f64 = 0.99;
/// Points of a curve of prediction errors.
pub(super) const CURVE_TIMES: usize = 40;
/// Number of times ahead in a table of prediction errors.
pub(super) const TABLE_TIMES: usize = 4;
/// Largest number of points for the curvature, and of points along each axis of its map.
pub(super) const CURVATURE_POINTS: (usize, usize) = (100, 21);
/// Largest number of points along each axis of a map of the metric.
pub(super) const METRIC_POINTS: usize = 41;
/// Fewest points per axis for which a map is drawn.
pub(super) const LEAST_MAP_POINTS: usize = 8;
/// Samples of a motion under constraints that is drawn.
pub(super) const CONSTRAINT_SAMPLES: f64 = 600.0;
/// Largest number of planes, and of constraints, that are drawn.
pub(super) const MOST_PLANES_AND_CONSTRAINTS: (usize, usize) = (3, 7);
/// Points of a curve of a learned function.
pub(super) const FUNCTION_POINTS: usize = 161;
/// Step of the differences of momenta over the range of a coordinate, large enough that rounding is far below truncation.
pub(super) const MOMENTUM_STEP: f64 = 1e-4;
/// Largest number of components of a matrix that are drawn.
pub(super) const MOST_MAPS: usize = 10;
/// Share of the diagonal components' root mean square above which off-diagonal components are drawn.
pub(super) const SHOWN_OFF_DIAGONAL: f64 = 0.02;
/// Share of a turn from which an angle is shown over a full turn.
pub(super) const WHOLE_TURN: f64 = 0.9;
/// Largest number of recorded positions that are marked in a map.
pub(super) const MOST_MARKS: usize = 400;
/// Share of the range of a coordinate within which a recorded position counts as near a map.
pub(super) const NEAR_MAP: f64 = 0.1;

// Files of robots.

/// Largest number of XML nodes.
pub(super) const MAX_NODES: u32 = 1 << 20;
/// Largest number of links and joints, or of elements below the world, including fixed ones.
pub(super) const MAX_ELEMENTS: usize = 4096;
/// Default bounds of joints, in rad and m.
pub(super) const DEFAULT_BOUNDS: (f64, f64) = (std::f64::consts::PI, 1.0);
/// Default bound of speeds, in rad/s or m/s.
pub(super) const DEFAULT_SPEED: f64 = 3.0;
/// Gravitational acceleration in m/s^2; z points upwards.
pub(super) const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];
/// Default density in kg/m^3, as the format defines it.
pub(super) const DEFAULT_DENSITY: f64 = 1000.0;
/// Largest difference, over the size of a link's constants, between the written constants and those read back: rounding of a few products of
/// rotations of numbers that differ by some orders of magnitude.
pub(super) const WRITTEN_ROUNDING: f64 = 1e-9;
/// Largest relative difference at which a number counts as unchanged: the rounding of about ten operations.
pub(super) const SAME_NUMBER: f64 = 1e-14;
/// Largest number of list items in a message.
pub(super) const SHOWN_ITEMS: usize = 8;
