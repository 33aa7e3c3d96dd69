//! What the fuzzer asks of `lnn`, one function of bytes per target; a claim that does not hold panics.
//!
//! Readers (`model_file`, `checkpoint`, `states_csv`, `recording`, `config`, `system_file`, `command_line`) take the bytes as they are and refuse them or give
//! something that is written back the same. The others make a problem of the bytes and compare two independent ways to
//! its answer: `program` reverse replay and nested forward numbers, `linalg` and `network` working precision and
//! double-double.
#![forbid(unsafe_code)]

pub mod checkpoint;
pub mod command_line;
pub mod config;
pub mod linalg;
pub mod model_file;
pub mod network;
pub mod program;
pub mod recording;
pub mod states_csv;
pub mod system_file;

mod accuracy;
pub mod bytes;
#[path = "../../tests/suite/common/nested.rs"]
mod nested;
mod sealed;
