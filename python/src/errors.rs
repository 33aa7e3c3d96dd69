//! Failures of the library as exceptions of Python.

use lnn::pipeline::PipelineError;
use lnn::recording::{DataError, Problem};
use pyo3::exceptions::{
    PyFileExistsError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyValueError,
};
use pyo3::{PyErr, PyResult};
use std::fmt::Display;

/// What was given is wrong.
pub fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// The choice of this name; `what` is the argument that gives it.
pub fn choice<T: Copy>(what: &str, given: &str, all: &[T], name: fn(T) -> &'static str) -> PyResult<T> {
    all.iter().copied().find(|&known| name(known) == given).ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|&known| name(known)).collect();
        value(format_args!("{what}: expected one of {}, found {given:?}", known.join(", ")))
    })
}

/// What was asked for cannot be done.
pub fn runtime(error: impl Display) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}

/// The exception of a pipeline's failure.
pub fn pipeline(error: PipelineError) -> PyErr {
    let text = error.to_string();
    match error {
        PipelineError::Interrupted | PipelineError::Unjudged(_) => PyKeyboardInterrupt::new_err(text),
        PipelineError::Taken { path, name } => PyFileExistsError::new_err(format!(
            "out: {}: there is {name} of another run; overwrite=True replaces it",
            path.display()
        )),
        PipelineError::Memory { .. } => PyMemoryError::new_err(text),
        PipelineError::Data(DataError::File { problem: Problem::Read(_), .. }) => PyOSError::new_err(text),
        PipelineError::Output { .. } | PipelineError::NoModel(_) | PipelineError::Held { .. } => {
            PyOSError::new_err(text)
        }
        PipelineError::Training(_) | PipelineError::Shooting(_) => PyRuntimeError::new_err(text),
        _ => PyValueError::new_err(text),
    }
}
