//! The directories that commands fill: runs, their results, and how they continue.

pub mod differences;
pub mod files;
pub mod folder;
pub mod learn;
pub mod output_dir;
pub mod results;
pub mod resume;
pub mod run_list;
pub mod runs;
pub mod shard;
