//! Data: states with their accelerations, sampled from known systems or taken from recorded motion.

mod dataset;
mod draw;
mod force_sizes;
mod motions;
mod of_config;
mod recording_split;
mod sampling;
mod shell;
mod weights;

pub use dataset::Datasets;
pub use dataset::{Dataset, DatasetError};
#[doc(hidden)]
pub use dataset::{Noise, StateEstimate};
pub use draw::SamplingError;
pub(crate) use draw::boxes;
pub(crate) use force_sizes::{force_spreads, sizes};
#[doc(hidden)]
pub use recording_split::{PrepareOptions, RecordingSplit, RecordingSplitError, Split};
pub use sampling::sample;
#[doc(hidden)]
pub use sampling::sample_all;
pub(crate) use sampling::sample_all_until;
