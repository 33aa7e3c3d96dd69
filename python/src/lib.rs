//! The compiled part of the Python package `lnn`: arrays in, calls of the library, arrays and JSON out. It has no logic of its own; names,
//! defaults and documentation are those of the Python side.

mod arrays;
mod attend;
mod compare;
mod errors;
mod forces;
mod learn;
mod methods;
mod motions;
mod readings;
mod recorded;
mod shadow;
mod subject;
mod systems;
mod tensors;
mod terms;

use pyo3::prelude::*;

/// The extension module.
#[pymodule]
fn _lnn(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<subject::Subject>()?;
    module.add_function(wrap_pyfunction!(systems::systems, module)?)?;
    module.add_function(wrap_pyfunction!(systems::read_robot, module)?)?;
    module.add_function(wrap_pyfunction!(systems::rewritten_robot, module)?)?;
    module.add_function(wrap_pyfunction!(learn::configuration, module)?)?;
    module.add_function(wrap_pyfunction!(learn::train, module)?)?;
    module.add_function(wrap_pyfunction!(learn::learn, module)?)?;
    module.add_function(wrap_pyfunction!(learn::sweep, module)?)?;
    module.add_function(wrap_pyfunction!(learn::fit, module)?)?;
    module.add_function(wrap_pyfunction!(readings::constraints_of_motion, module)?)?;
    module.add_function(wrap_pyfunction!(readings::formula, module)?)?;
    module.add_function(wrap_pyfunction!(readings::identify, module)?)?;
    module.add_function(wrap_pyfunction!(learn::read_constraints, module)?)?;
    module.add_function(wrap_pyfunction!(forces::forces_of_motion, module)?)?;
    module.add_function(wrap_pyfunction!(recorded::unit_factor, module)?)?;
    module.add_function(wrap_pyfunction!(compare::compare_lagrangians, module)?)?;
    module.add_function(wrap_pyfunction!(compare::surfaces_of_metric, module)?)?;
    module.add_function(wrap_pyfunction!(shadow::shadow, module)?)?;
    module.add_function(wrap_pyfunction!(readings::check, module)?)?;
    Ok(())
}
