//! Limits of a training.

/// A loss counts only if at most one in this many validation states is left out.
pub(super) const STATES_PER_LEFT_OUT: usize = 100;
/// Evaluations that an iteration of L-BFGS may take on average; argmin's line searches have no limit.
pub(super) const EVALUATIONS_PER_ITERATION: usize = 20;
/// Number of parameters whose gradients are summed at a time.
pub(super) const PARAMETERS_AT_ONCE: usize = 1 << 14;
/// Largest checkpoint file that is read, in bytes.
pub(super) const LARGEST_CHECKPOINT: u64 = 1 << 34;
/// Largest count in a checkpoint: no training reaches it, and sums of smaller ones cannot overflow.
pub(super) const LARGEST_COUNT: u64 = 1 << 52;
/// Smallest ratio of the time between two checkpoints to the time that writing one takes.
pub(super) const TRAINING_PER_WRITING: u32 = 100;
