//! Thresholds and limits of the program in one table.

use std::time::Duration;

// Thresholds below which a value counts as too small.

/// Times that differ by less than this share of the duration are equal.
pub const ROUNDING_OF_TIMES: f64 = 1e-9;
/// Least width of a range of states relative to its larger end: over a narrower range, the functions of a column cannot be distinguished
/// from constants.
pub const NARROWEST_RANGE: f64 = 1e-6;

// Sizes of files in bytes: far above every file that the program writes, and small enough to be read into memory.

/// Largest configuration or system file.
pub const MAX_CONFIG_BYTES: u64 = 1 << 20;
/// Largest robot file; meshes are separate files.
pub const MAX_ROBOT_BYTES: u64 = 1 << 24;
/// Largest file of states, about two million rows of six columns with all digits.
pub const MAX_STATES_BYTES: u64 = 1 << 28;

// Limits of work and memory.

/// Number of states evaluated together, which bounds the memory for files of any length.
pub const ROWS_AT_ONCE: usize = 256;
/// Numbers of the matrices of states evaluated together: 8 MB for each matrix in double precision.
pub const NUMBERS_AT_ONCE: usize = 1 << 20;
/// Largest number of coordinates of a metric, whose curvature has `n^4` components.
pub const MOST_METRIC_COORDINATES: usize = 64;
/// Largest number of intervals on a line: seconds of work for a metric that is a formula.
pub const MOST_PIECES: usize = 1_000_000;
/// Largest number of directions in which the edge of a shadow is found; each requires a bisection of rays.
pub const MOST_EDGES: f64 = 4096.0;
/// Largest number of runs in a sweep; each is a training.
pub const MOST_RUNS: usize = 10_000;
/// Largest number of unknown coefficients of quadratic quantities for which states are drawn: the search grows with their cube.
pub const MOST_QUADRATIC_UNKNOWNS: usize = 1300;
/// Unknown coefficients squared times states from which a search for symmetries takes some seconds, so that it is announced.
pub const LONG_SEARCH: f64 = 3e9;
/// Largest number of wrong values of a configuration that are listed: each one needs a check of the whole configuration.
pub const MOST_MISTAKES: usize = 100;
/// Attempts to find an unused name of a temporary file; all fail only if as many copies of the process died with their files left behind.
pub const SPOOL_ATTEMPTS: usize = 100;

// Numbers of examined states.

/// States of a file at which the constraints of a model are examined: a few suffice, because constraints that depend on each other do so at
/// almost every state.
pub const EXAMINED_MOTION_STATES: usize = 24;
/// Seed of the states on which the symmetries of a roll-out are sought.
pub const CHARGES_SEED: u64 = 0;

// Ranges and defaults of light in a metric.

/// Distances that a camera and the sky may have, in the unit of the coordinates: their fourth powers are still numbers of
/// double precision.
pub const NEAREST: f64 = 1e-12;
/// See [`NEAREST`].
pub const FARTHEST: f64 = 1e15;

// What is shown.

/// Largest number of file names, or of differences, in one line of a message.
pub const SHOWN_NAMES: usize = 4;
/// Longest name of a system that becomes the name of a directory, in bytes; file systems allow 255.
pub const LONGEST_NAME: usize = 100;
/// Longest line of a comment in a printed configuration.
pub const COMMENT_WIDTH: usize = 110;
/// Time after which a search reports its progress if standard error is not a terminal: short searches stay silent.
pub const FIRST_LINE: Duration = Duration::from_millis(1500);
/// Time between such reports: logs of long searches stay short.
pub const NEXT_LINE: Duration = Duration::from_secs(10);
