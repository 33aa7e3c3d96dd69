//! Data: states with their accelerations, sampled from known systems or taken from recorded motion.

mod dataset;
mod force_sizes;
mod of_config;
mod recording_split;
mod sampling;
mod shell;

pub(crate) use dataset::Weighting;
pub use dataset::{Dataset, DatasetError, Datasets};
#[doc(hidden)]
pub use dataset::{Noise, StateEstimate};
pub(crate) use force_sizes::{force_spreads, sizes};
#[doc(hidden)]
pub use recording_split::{PrepareOptions, RecordingSplit, RecordingSplitError, Split};
#[doc(hidden)]
pub use sampling::sample_all;
pub use sampling::{SamplingError, sample};
pub(crate) use sampling::{boxes, sample_all_until};
