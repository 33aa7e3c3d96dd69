//! What a command prints, how it ends, and the errors it ends with.

pub mod error;
pub mod format;
pub mod interrupt;
pub mod output;
pub mod progress;
pub mod result_page;
pub mod watch;
