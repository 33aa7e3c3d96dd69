//! The base of all other modules: cancellation, names in messages, files, memory.
//!
//! | module | contents |
//! |---|---|
//! | [`cancellation`] | the flag that ends a long search, and its progress reports |
//! | [`findings`] | a result in sentences and tables |
//! | [`names`] | nearest known name for error messages, numbers and counts in words |
//! | [`storage`] | files: read within limits, written completely or not at all; locks of directories; the container of model files and checkpoints |

#[cfg(feature = "std")]
pub mod cancellation;
pub mod findings;
pub mod names;
#[cfg(feature = "std")]
pub mod storage;
