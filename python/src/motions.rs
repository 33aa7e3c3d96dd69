//! Motions from many starts, for Python.

use crate::arrays::Numbers;
use crate::attend::whole;
use crate::errors::value;
use crate::forces::{Forces, Samples};
use crate::subject::{Kind, Subject};
use lnn::lagrangian::{EulerLagrange, Frictionless, Interruptible};
use lnn::pipeline::trained_on;
use lnn::rollout::{Event, Integrator, Occurrence, Rollout, RolloutError, RolloutOptions, Start, rollout_each};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyList;
use std::sync::Arc;

/// Known functions of the time: samples, or a function of Python.
pub type Given = (Option<Samples>, Option<Py<PyAny>>);

/// What Python says about motions.
pub struct Plan<'a> {
    /// Start, end and step of the samples.
    pub times: (f64, f64, f64),
    /// Name of the integrator.
    pub method: &'a str,
    /// Relative and absolute tolerance, and the size of fixed steps.
    pub accuracy: (f64, f64, Option<f64>),
    /// Whether a model stays where it was trained, and whether friction acts.
    pub acting: (bool, bool),
    pub forces: Given,
    pub inputs: Given,
    pub threads: usize,
}

impl Plan<'_> {
    /// Motions of a subject from starts `(b, n)`.
    ///
    /// # Errors
    /// `ValueError` for a method, forces, inputs or starts that do not fit, and what a function of Python raised.
    pub fn motions<'py>(
        self,
        py: Python<'py>,
        subject: &Subject,
        (q, v): (&[f64], &[f64]),
    ) -> PyResult<Bound<'py, PyList>> {
        let (n, options) = (subject.n(), self.options(subject)?);
        let Self { times: (t0, t_end, _), acting: (_, friction), forces, inputs, threads, .. } = self;
        let forces = Forces::of(n, (t0, t_end), "force", forces)?;
        let mut known = None;
        let mut fed = None;
        if let Kind::System(configured, _) = &subject.kind
            && configured.inputs().next().is_some()
        {
            let given = Arc::new(Forces::of(configured.inputs().count(), (t0, t_end), "inputs", inputs)?);
            fed = Some(configured.build_with(Forces::inputs(&given, configured.inputs().count())).map_err(value)?);
            known = Some(given);
        }
        let starts = q.chunks(n).zip(v.chunks(n)).enumerate();
        let starts: Vec<_> = starts.map(|(k, (q, v))| Start { q, v, force: forces.on(k) }).collect();
        let motions = whole(py, None, |watch| {
            let follow = |model: &dyn EulerLagrange<f64>| {
                rollout_each(&Interruptible::new(model, &watch.interrupt), &starts, &options, threads)
            };
            match (&fed, friction) {
                (Some(model), true) => follow(model.as_ref()),
                (Some(model), false) => follow(&Frictionless(model.as_ref())),
                (None, _) => subject.with_friction(friction, follow),
            }
        })?;
        if let Some(error) = forces.raised().or_else(|| known.and_then(|known| known.raised())) {
            return Err(error);
        }
        listed(py, motions)
    }

    fn options(&self, subject: &Subject) -> PyResult<RolloutOptions<f64>> {
        let ((t0, t_end, dt), (rtol, atol, step), (bounded, _)) = (self.times, self.accuracy, self.acting);
        let method: Integrator = serde_json::from_value(self.method.into()).map_err(value)?;
        let domain = match &subject.kind {
            Kind::Model(header, ..) if bounded => Some(trained_on(header)),
            _ => None,
        };
        let events = subject.system_instance().map_or_else(|_| Vec::new(), |known| known.events());
        let events = events.into_iter().map(Event::from).collect();
        Ok(RolloutOptions::new(t_end, dt)
            .t0(t0)
            .method(method)
            .tolerances(rtol, atol)
            .step(step)
            .domain(domain)
            .events(events))
    }
}

/// Motions for Python: times, coordinates, velocities, energy, what stopped them, number of evaluations, events.
fn listed(py: Python<'_>, motions: Vec<Rollout<f64>>) -> PyResult<Bound<'_, PyList>> {
    let result = PyList::empty(py);
    for Rollout { trajectory, statistics, stop, events } in motions {
        if let Some(error @ RolloutError::Invalid { .. }) = &stop {
            return Err(value(error));
        }
        let energy = trajectory.energy.unwrap_or_default().into_pyarray(py);
        let [t, q, v] = [trajectory.t, trajectory.q, trajectory.v].map(|numbers| numbers.into_pyarray(py));
        let events: Vec<_> = events.into_iter().map(|event| happened(py, event)).collect();
        result.append((t, q, v, energy, stop.map(|stop| stop.to_string()), statistics.evaluations, events))?;
    }
    Ok(result)
}

/// Name, time and state of an event; velocities and energy before and energy after an impact.
type Happened<'py> = (String, f64, Numbers<'py>, Numbers<'py>, Option<(Numbers<'py>, f64, f64)>);

fn happened(py: Python<'_>, event: Occurrence<f64>) -> Happened<'_> {
    let Occurrence { name, t, q, v, impact } = event;
    let impact = impact.map(|hit| (hit.v_before.into_pyarray(py), hit.energy_before, hit.energy_after));
    (name, t, q.into_pyarray(py), v.into_pyarray(py), impact)
}
