//! Limits, verdicts and settings of Lagrangians, their constraints and their descriptions; defaults of systems stand in their tables.

// Limits of what a file may describe, which keep recorded programs within memory. `cargo test -p lnn-engine -- lagrangian`, `cargo test --test
// suite -- mechanics` and the fuzz targets check them.

/// Largest number of coordinates of a system in a file.
pub(super) const MOST_COORDINATES: usize = 64;
/// Largest number each of parameters, definitions, inputs, constraints, events and measured quantities.
pub(super) const MOST_NAMES: usize = 256;
/// Largest number of links of a chain, each of which has a coordinate at most.
pub(super) const MOST_LINKS: usize = 64;
/// Largest number of characters of a formula.
pub(super) const MOST_CHARACTERS: usize = 1 << 16;
/// Deepest nesting of parentheses, signs and powers: more than formulas need, and far below what the stack allows.
pub(super) const MOST_NESTING: usize = 100;
/// Largest number of operations of a formula's program, after definitions are inserted, which may repeat each other.
pub(super) const MOST_OPERATIONS: usize = 1 << 16;
/// Number of bobs of the longest listed chain.
pub(super) const LISTED_BOBS: usize = 20;
/// Number of bobs of the longest supported chain.
pub(super) const MOST_BOBS: usize = 500;

// Verdicts. `cargo test -p lnn-engine -- lagrangian` and `cargo test --test suite -- mechanics` check them.

/// A normalized row depends on others if its component outside their span is below this multiple of the square root of the machine epsilon.
pub(super) const RANK_ROUNDINGS: f64 = 16.0;
/// A normalized row is redundant if its component outside the span of the previous rows is below this at every state.
pub(super) const REDUNDANT_ROW: f64 = 1e-6;
/// Defects below this multiple of the rounding error of the state count as zero.
pub(super) const PROJECTION_ROUNDINGS: f64 = 1024.0;
/// An eigenvalue of the mass matrix within the constraints below this many roundings of the largest one counts as zero.
pub(super) const NULL_ROUNDINGS: f64 = 1024.0;
/// Accelerations are accepted if they violate the constraints by less than this fraction of their size, or of the size of the accelerations
/// that the forces cause. This allows for values that a person has rounded to three digits.
pub(super) const NEAR_CONSTRAINTS: f64 = 1e-3;
/// Smallest motion of the drives, relative to that of all coordinates, for which they control it.
pub(super) const LEAST_DRIVE_MOTION: f64 = 1e-6;
/// A sine or cosine of an angle of a joint below this counts as rounding error: angles such as pi are given with 16 digits.
pub(super) const ROTATION_ROUNDING: f64 = 1e-15;

// Limits of work, and numbers of states that are examined.

/// Largest number of Newton steps of a projection onto the constraints.
pub(super) const MOST_PROJECTION_STEPS: usize = 60;
/// Number of states within the validation bounds at which the constraints of a system are examined.
pub(super) const EXAMINED_STATES: usize = 24;
/// Largest number of states at which couplings between coordinates are detected.
pub(super) const COUPLING_STATES: usize = 64;

// What is shown.

/// Largest number of names of a circle of definitions that a message lists.
pub(super) const SHOWN_NAMES: usize = 8;
/// Largest number of rows in a picture; in pictures of larger matrices a character represents several elements.
pub(super) const PICTURE_ROWS: usize = 64;

// Sizes at which another routine is faster or cheap enough, by `cargo bench --bench systems` and `cargo bench --bench hessians`.

/// Up to this many coordinates, a few states are evaluated with forward-mode numbers on the stack, because the interpreter has more
/// overhead.
pub(super) const STACK_COORDINATES: usize = 2;
/// Batches of at least this size, the lanes of a chunk, are always replayed.
pub(super) const LEAST_REPLAYED_STATES: usize = 8;
/// With more coordinates, curvature is computed in the model's precision, not in a higher one.
pub(super) const WIDE_COORDINATES: usize = 4;
/// Eliminations with at most this many products are always recorded: they take less time than a call of a solver.
pub(super) const MOST_RECORDED_PRODUCTS: usize = 60;
/// Largest number of coordinates for which the whole linearization is recorded as one program. Compared with separate programs for its
/// parts, in three runs of `cargo bench --bench hessians -- linearization`, it takes 0.4 to 0.5 times as long for two coordinates and 0.4
/// to 1.4 times for four.
pub(super) const MOST_WHOLE_COORDINATES: usize = 4;
/// Largest number of products per element of the full matrix in a recorded elimination; beyond it, a dense solver is faster.
pub(super) const PRODUCTS_PER_ELEMENT: usize = 8;
/// Largest number of velocities that vary together; beyond it, pairs of blocks of half this size are used.
pub(super) const BLOCK_VELOCITIES: usize = 8;
/// Programs with at most this many registers store them on the stack.
pub(super) const STACK_REGISTERS: usize = 16;
/// From this many numbers on, a call of the widest vector instructions is worthwhile.
pub(super) const LEAST_VECTOR_NUMBERS: usize = 64;

// Settings.

/// Default of the speed at which dry friction reaches three quarters of its maximum, in rad/s or m/s.
pub(super) const COULOMB_SPEED: f64 = 0.01;
