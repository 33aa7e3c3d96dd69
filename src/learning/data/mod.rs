//! Data: states with their accelerations, sampled from known systems or taken from recorded motion.

mod bounds;
mod dataset;
mod datasets;
mod draw;
mod estimated;
mod motions;
mod of_config;
mod recording_split;
mod sampling;
mod shell;
mod weights;

pub(crate) use bounds::boxes;
pub use dataset::{Dataset, DatasetError};
pub use datasets::Datasets;
pub use draw::SamplingError;
#[doc(hidden)]
pub use estimated::{Noise, StateEstimate};
#[doc(hidden)]
pub use recording_split::{PrepareOptions, RecordingSplit, RecordingSplitError, Split};
pub use sampling::sample;
#[doc(hidden)]
pub use sampling::sample_all;
pub(crate) use sampling::sample_all_until;
