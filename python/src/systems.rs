//! The systems of the catalogue, and those of robots' files.

use crate::errors::{runtime, value};
use crate::subject::Subject;
use lnn::lagrangian::{System, SystemInstance, constrained_systems};
use lnn::pipeline::{parse_robot, rewrite_robot};
use pyo3::prelude::*;
use serde_json::Value;
use std::borrow::Cow;

/// All systems of the catalogue, as JSON.
#[pyfunction]
pub fn systems() -> PyResult<String> {
    let free = System::unconstrained().iter().map(Cow::Borrowed);
    let all: PyResult<Vec<Value>> = free
        .chain(constrained_systems().into_iter().map(Cow::Owned))
        .map(|system| Ok(Subject::of(SystemInstance::new(system, &[]).map_err(value)?)?.summary()))
        .collect();
    Ok(Value::from(all?).to_string())
}

/// The description of the system of a URDF or MJCF file as JSON, and what of the file is not read.
#[pyfunction]
pub fn read_robot(text: &str) -> PyResult<(String, Vec<String>)> {
    let (system, notes) = parse_robot(text).map_err(at_line)?;
    // As it was given: with its links.
    let description = system.with_defaults(&[]).ok_or_else(|| runtime("no description"))?;
    Ok((serde_json::to_string(&description).map_err(runtime)?, notes))
}

/// A URDF with values of constants by symbol.
#[pyfunction]
pub fn rewritten_robot(text: &str, values: Vec<(String, f64)>) -> PyResult<String> {
    let values: Vec<(&str, f64)> = values.iter().map(|(symbol, x)| (symbol.as_str(), *x)).collect();
    rewrite_robot(text, &values).map_err(at_line)
}

fn at_line((line, problem): (usize, String)) -> PyErr {
    value(format_args!("line {line}: {problem}"))
}
