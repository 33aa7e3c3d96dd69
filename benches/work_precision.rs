//! Run time against error: roll-outs, derivative engines, activation kernels, small symmetric matrices.
//!
//! Every part writes its raw numbers as CSV, log-log diagrams and what failed or was left out, with the reason;
//! `report.html` gathers everything. Errors are judged in double-double.

#[path = "../tests/suite/common/mod.rs"]
mod common;
#[path = "work_precision/mod.rs"]
mod work_precision;

use clap::Parser;
use std::process::ExitCode;

/// Every part at its smallest.
pub fn trial() {
    work_precision::run(&work_precision::Options::smoke()).expect("every part runs");
}

fn main() -> ExitCode {
    match work_precision::run(&work_precision::Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}
