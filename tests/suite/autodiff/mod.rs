//! Derivatives by the tape: eager, and by recorded programs.

mod program;
mod recorded;
mod tape;
