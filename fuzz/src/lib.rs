//! What the fuzzer asks of `lnn`, one function of bytes per target; a claim that does not hold panics.
//!
//! Readers (`model_file`, `checkpoint`, `states_csv`, `recording`, `config`, `fit_config`, `record`, `system_file`, `robot_file`, `command_line`) take the bytes as they are and refuse them or give
//! something that is written back the same; so do `identified`, of a system with other constants, and `formula_file`, of a formula that is
//! found. `page` compares the page of a system with the library. The others make a problem of the bytes and compare two independent ways to
//! its answer: `program` reverse replay and nested forward numbers, `linalg` and `network` working precision and
//! double-double.
#![forbid(unsafe_code)]

pub mod checkpoint;
pub mod command_line;
pub mod config;
pub mod fit_config;
pub mod formula_file;
pub mod identified;
pub mod linalg;
pub mod model_file;
pub mod network;
pub mod page;
pub mod program;
pub mod record;
pub mod recording;
pub mod robot_file;
pub mod states_csv;
pub mod system_file;

mod accuracy;
pub mod bytes;
#[path = "../../tests/suite/common/nested.rs"]
mod nested;
mod sealed;
