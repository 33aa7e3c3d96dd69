use pyo3::prelude::*;
#[pymodule]
fn _lnn(_module: &Bound<'_, PyModule>) -> PyResult<()> { Ok(()) }
