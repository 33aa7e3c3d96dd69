//! Failures of the library as exceptions of Python.

use lnn::pipeline::PipelineError;
use lnn::recording::{DataError, Problem};
use pyo3::PyErr;
use pyo3::exceptions::{
    PyFileExistsError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyValueError,
};
use std::fmt::Display;

/// What was given is wrong.
pub fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
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
