//! Data: states with their accelerations, sampled from known systems or taken from recorded motion.

mod dataset;
mod force_sizes;
mod of_config;
mod recording_split;
mod sampling;
mod shell;
mod thresholds;

pub(crate) use dataset::Weighting;
pub use dataset::{Dataset, DatasetError, Datasets};
pub(crate) use force_sizes::{force_spreads, sizes};
pub use recording_split::RecordingSplitError;
pub use sampling::SamplingError;
pub(crate) use sampling::{boxes, sample_all_until};

// Used by the other packages of this repository.
#[doc(hidden)]
pub use {
    dataset::{Noise, StateEstimate},
    recording_split::{PrepareOptions, RecordingSplit, Split},
};
