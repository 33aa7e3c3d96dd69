//! What every floor above needs and none is about: names in messages, files, memory.
//!
//! | module | contents |
//! |---|---|
//! | [`names`] | nearest known name for error messages, numbers and counts in words |
//! | [`storage`] | files: read within limits, written completely or not at all; locks of directories; the container of model files and checkpoints |

pub mod names;
pub mod storage;
