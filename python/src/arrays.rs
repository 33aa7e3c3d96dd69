//! Arrays of numbers from and for Python.

use crate::errors::value;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

/// Numbers for Python.
pub type Numbers<'py> = Bound<'py, PyArray1<f64>>;

/// Times of states; none where none are given.
pub fn times<'a>(given: Option<&'a PyReadonlyArray1<'_, f64>>) -> PyResult<&'a [f64]> {
    given.map_or(Ok(&[]), |times| times.as_slice().map_err(value))
}

/// The numbers of an array, row by row.
pub fn slice<'a>(array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<&'a [f64]> {
    array.as_slice().map_err(value)
}
