//! Limits of the files that are read, so that no file, however damaged, exhausts time or memory.

// ---- Trajectories ----

/// Fewest samples of a trajectory.
pub(crate) const LEAST_SAMPLES: usize = 16;
/// Largest difference, in rad, between the turns that the velocities before and after a gap predict: about a quarter of a turn. Above it,
/// the number of turns is ambiguous.
pub(super) const AMBIGUOUS_TURN: f64 = 1.5;
/// Most trajectories of one file.
pub(super) const MOST_TRAJECTORIES: usize = 100_000;

// ---- Sizes of files ----

/// Largest file in bytes.
pub(super) const LARGEST_FILE: u64 = 1 << 36;
/// Largest ratio of unpacked to packed bytes. Measured numbers shrink to a tenth at most; data that shrinks to a hundredth contains hardly
/// any number.
pub(super) const MOST_EXPANSION: u64 = 100;
/// Unpacked size in bytes that is allowed regardless of the ratio.
pub(super) const UNPACKED_ANYWAY: u64 = 1 << 26;
/// Longest line of a text in bytes.
pub(super) const LONGEST_LINE: u64 = 1 << 20;
/// Longest tag of a workbook, or text between two tags, in bytes.
pub(super) const LONGEST_TAG: u64 = 1 << 20;
/// Most rows of a sheet: Excel's own limit.
pub(super) const SHEET_ROWS: usize = 1 << 20;
/// Most columns of a sheet: Excel's own limit.
pub(super) const SHEET_COLUMNS: usize = 1 << 14;
/// Largest size in bytes of the text that a sheet is converted to.
pub(super) const SHEET_BYTES: usize = 1 << 28;
/// Most arrays of an archive.
pub(super) const MOST_ARRAYS: usize = 10_000;
/// Longest header of an array in bytes, which is NumPy's own default.
pub(super) const LONGEST_HEADER: usize = 10_000;
/// Rows of arrays that are read at a time.
pub(super) const ROWS_AT_ONCE: usize = 1024;
/// Most columns that are read one by one if some contain no numbers.
pub(super) const MOST_SEPARATE_COLUMNS: usize = 256;

// ---- Messages ----

/// Most problems that are reported for one file.
pub(super) const LISTED_PROBLEMS: usize = 5;
/// Most names of columns that a message lists.
pub(super) const LISTED_COLUMNS: usize = 8;
