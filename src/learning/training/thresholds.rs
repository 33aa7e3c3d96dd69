//! Numbers that limit a training.

/// At most one in this many validation states may be left out of a loss that counts.
pub(super) const STATES_PER_LEFT_OUT: usize = 100;
/// Evaluations that an iteration of L-BFGS may take on average; argmin's line searches have no limit.
pub(super) const EVALUATIONS_PER_ITERATION: usize = 20;
/// Parameters whose gradients are summed at a time.
pub(super) const PARAMETERS_AT_ONCE: usize = 1 << 14;
/// Largest checkpoint that is read, in bytes.
pub(super) const LARGEST_CHECKPOINT: u64 = 1 << 34;
/// Largest count in a checkpoint: no training reaches it, and sums of smaller ones cannot overflow.
pub(super) const LARGEST_COUNT: u64 = 1 << 52;
/// Time between two checkpoints over the time that writing one takes, at least.
pub(super) const TRAINING_PER_WRITING: u32 = 100;
