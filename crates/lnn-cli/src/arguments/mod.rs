//! Arguments that several commands share, and the files they name.

pub mod config;
pub mod constraints;
pub mod fit_config;
pub mod flags;
pub mod forces;
pub mod input;
pub mod integration;
pub mod layers;
pub mod learned;
pub mod metrics;
pub mod motion_source;
pub mod number;
pub mod plain_name;
pub mod print_config;
pub mod probe;
pub mod recording_args;
pub mod run_args;
pub mod source;
pub mod spool;
pub mod system_arg;
pub mod train_config;
