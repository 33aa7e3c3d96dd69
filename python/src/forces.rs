//! Forces from outside as Python gives them, and the forces that make a known motion.

use crate::arrays::{Numbers, slice, times};
use crate::errors::value;
use crate::subject::Subject;
use lnn::lagrangian::{ForceParts, Inputs, InverseDynamics, force_parts_by_rows, inverse_dynamics_by_rows};
use lnn::rollout::{Between, Force, SampledForce};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

/// Times, values `(times, n)` for every start or one for all of them, and how they are joined.
pub type Samples = (Vec<f64>, Vec<Vec<f64>>, Option<String>);

/// A function of Python `(t, q, v)`; what it raises is kept, and the motion ends there.
struct Called {
    function: Py<PyAny>,
    raised: Mutex<Option<PyErr>>,
}

impl Called {
    fn write(&self, t: f64, q: &[f64], v: &[f64], force: &mut [f64]) {
        let found = Python::attach(|py| {
            let [q, v] = [q, v].map(|x| PyArray1::from_slice(py, x));
            let found = self.function.call1(py, (t, q, v))?;
            let found: PyReadonlyArray1<'_, f64> = found.extract(py)?;
            Ok::<_, PyErr>(found.as_slice().map_err(value)?.to_vec())
        });
        match found {
            Ok(found) if found.len() == force.len() => force.copy_from_slice(&found),
            other => {
                force.fill(f64::NAN);
                if let (Err(error), Ok(mut raised)) = (other, self.raised.lock()) {
                    raised.get_or_insert(error);
                }
            }
        }
    }
}

/// The forces that drive motions.
#[derive(Default)]
pub struct Forces {
    each: Vec<Box<dyn Force<f64>>>,
    called: Option<Arc<Called>>,
}

impl Forces {
    /// Forces of motions of `n` coordinates over a span of time.
    ///
    /// # Errors
    /// `ValueError` for samples that are none, or that do not cover the span.
    pub fn of(
        n: usize,
        (from, to): (f64, f64),
        what: &str,
        (samples, function): (Option<Samples>, Option<Py<PyAny>>),
    ) -> PyResult<Self> {
        let mut forces = Self::default();
        if let Some((times, values, between)) = samples {
            let between: Between = match between {
                Some(name) => {
                    serde_json::from_value(name.into()).map_err(|error| value(format_args!("between: {error}")))?
                }
                None => Between::default(),
            };
            if let (Some(first), Some(last)) = (times.first(), times.last())
                && times.len() > 1
            {
                let slack = 1e-9 * (to - from).abs();
                if from.min(to) < first - slack || from.max(to) > last + slack {
                    let known = format_args!(
                        "{what}: known from t = {first} to {last}, and the motion runs from {from} to {to}"
                    );
                    return Err(value(known));
                }
            }
            for values in values {
                let sampled = SampledForce::new(n, times.clone(), values);
                forces.each.push(Box::new(sampled.map_err(value)?.between(between)));
            }
        }
        if let Some(function) = function {
            let called = Arc::new(Called { function, raised: Mutex::default() });
            let shared = Arc::clone(&called);
            let force = move |t: f64, q: &[f64], v: &[f64], force: &mut [f64]| shared.write(t, q, v, force);
            forces.each.push(Box::new(force));
            forces.called = Some(called);
        }
        Ok(forces)
    }

    /// So many of them as inputs of a system.
    pub fn inputs(this: &Arc<Self>, count: usize) -> Box<dyn Inputs<f64>> {
        let this = Arc::clone(this);
        Box::new((count, move |t: f64, values: &mut [f64]| {
            values.fill(0.0);
            if let Some(given) = this.on(0) {
                given.force(t, &[], &[], values);
            }
        }))
    }

    /// The force on a start.
    pub fn on(&self, start: usize) -> Option<&dyn Force<f64>> {
        self.each.get(start).or(self.each.first()).map(Box::as_ref)
    }

    /// What a function raised.
    pub fn raised(&self) -> Option<PyErr> {
        self.called.as_ref()?.raised.lock().ok()?.take()
    }
}

/// Forces that give states `(b, n)` their accelerations, flat: generalized, friction, external, of constraints, multipliers, then the parts
/// inertial, Coriolis and gravity; empty where there are none. A system that depends on the time needs the times `(b)`.
#[pyfunction(name = "inverse_dynamics")]
pub fn forces_of_motion<'py>(
    py: Python<'py>,
    subject: &Subject,
    q: PyReadonlyArray2<'py, f64>,
    v: PyReadonlyArray2<'py, f64>,
    a: PyReadonlyArray2<'py, f64>,
    t: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Vec<Numbers<'py>>> {
    let ((q, v), a, t, model) = (subject.states(&q, &v)?, slice(&a)?, times(t.as_ref())?, subject.moving());
    let found = py.detach(|| {
        let (forces, failures) = inverse_dynamics_by_rows(model, &[], [q, v, a], t)?;
        match failures.first() {
            Some(error) => Err(*error),
            None => Ok((forces, force_parts_by_rows(model, [q, v, a], t)?.0)),
        }
    });
    let (forces, parts) = found.map_err(|error: lnn::lagrangian::MechanicsError| value(error))?;
    let InverseDynamics { generalized, friction, external, constraint, multipliers } = forces;
    let ForceParts { inertial, coriolis, gravity, .. } = parts;
    let all = [generalized, friction, external, constraint, multipliers, inertial, coriolis, gravity];
    Ok(all.map(|numbers| numbers.into_pyarray(py)).into())
}
