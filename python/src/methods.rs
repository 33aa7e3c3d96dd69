//! The methods of a subject in Python.

use crate::arrays::{Numbers, slice, times};
use crate::attend::{left, whole};
use crate::errors::{pipeline, runtime, value};
use crate::motions::{Given, Plan};
use crate::readings::{FormulaChoices, formula_shown, shown};
use crate::subject::{Kind, Subject, degrees_of};
use crate::tensors::{FIELDS, Geometries};
use crate::terms::{Field, States, field};
use lnn::certificate::{Certificate, CertificateOptions, Signature};
use lnn::constraints::{EXAMINED_STATES, examine};
use lnn::formula::{FoundFormula, MODEL_STATES};
use lnn::lagrangian::{
    Bounds, Description, EulerLagrange, Interruptible, Linearization, Linearizer, Request, SystemInstance,
};
use lnn::network::{ModelFile, NetworkLagrangian};
use lnn::pipeline::{Evaluation, EvaluationOptions, trained_on};
use lnn::report::page;
use lnn::symmetry::{Degrees, Region, bases, enough, most_states, most_symmetries, unknowns};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use std::borrow::Cow;
use std::f64::consts::TAU;

#[pymethods]
impl Subject {
    /// A system of the catalogue.
    #[staticmethod]
    fn system(name: &str, parameters: Vec<(String, String)>) -> PyResult<Self> {
        Self::of(SystemInstance::named(name, &parameters).map_err(value)?)
    }

    /// A system by its description: TOML, or JSON.
    #[staticmethod]
    fn described(text: &str, json: bool, parameters: Vec<(String, String)>) -> PyResult<Self> {
        let description: Description =
            if json { serde_json::from_str(text).map_err(value)? } else { toml::from_str(text).map_err(value)? };
        let system = Cow::Owned(description.system().map_err(value)?);
        Self::of(SystemInstance::new(system, &parameters).map_err(value)?)
    }

    /// A model from the bytes of its file.
    #[staticmethod]
    fn model(bytes: &[u8]) -> PyResult<Self> {
        let ModelFile { header, weights } = ModelFile::<f64>::from_bytes(bytes).map_err(value)?;
        let network = NetworkLagrangian::new(header.architecture.clone(), weights).map_err(value)?;
        Self::learned(header, network)
    }

    /// The bytes of a model's file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let Kind::Model(header, network, _) = &self.kind else { return Err(value("a system has no model file")) };
        let file = ModelFile { header: (**header).clone(), weights: network.weights().to_vec() };
        Ok(PyBytes::new(py, &file.to_bytes().map_err(value)?))
    }

    /// Everything but numbers, as JSON.
    fn facts(&self) -> String {
        self.summary().to_string()
    }

    /// All terms of states `(b, n)`, flat, and the rows that fail with what is wrong.
    #[allow(clippy::type_complexity)]
    fn terms<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        t: Option<PyReadonlyArray1<'py, f64>>,
        threads: usize,
    ) -> PyResult<(Vec<Numbers<'py>>, Vec<(usize, String)>)> {
        let (q, v) = self.states(&q, &v)?;
        let states = States { q, v, force: None, times: times(t.as_ref())? };
        let mut parts = self.attended(py, states, (Request::ALL, true), threads)?;
        let mut failures = Vec::new();
        let mut before = 0;
        for (terms, states) in &parts {
            failures.extend(terms.failures.iter().map(|e| (before + e.row().unwrap_or(0), e.to_string())));
            before += states;
        }
        let n = self.n();
        let mut taken = |width, take| field(py, &mut parts, width, take);
        let found = vec![
            taken(1, |t| &mut t.lagrangian),
            taken(n, |t| &mut t.momentum),
            taken(n, |t| &mut t.dl_dq),
            taken(n * n, |t| &mut t.mass_matrix),
            taken(n, |t| &mut t.coriolis),
            taken(n, |t| &mut t.acceleration),
            taken(1, |t| &mut t.energy),
        ];
        let (mut found, conserves) = (found, self.moving().conserves_energy());
        if !conserves {
            found.push(taken(n, |t| &mut t.force));
            found.push(taken(1, |t| &mut t.dissipation));
        }
        Ok((found, failures))
    }

    /// One term of states `(b, n)`, flat; forces from outside and friction act on accelerations alone.
    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (name, q, v, t, threads, force=None, friction=true))]
    fn term<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        t: Option<PyReadonlyArray1<'py, f64>>,
        threads: usize,
        force: Option<PyReadonlyArray2<'py, f64>>,
        friction: bool,
    ) -> PyResult<Numbers<'py>> {
        let (q, v) = self.states(&q, &v)?;
        let force = force.as_ref().map(slice).transpose()?;
        let n = self.n();
        let (request, width, take): (Request, usize, Field) = match name {
            "lagrangian" => (Request::LAGRANGIAN, 1, |t| &mut t.lagrangian),
            "momentum" => (Request::MOMENTUM, n, |t| &mut t.momentum),
            "mass_matrix" => (Request::MASS_MATRIX, n * n, |t| &mut t.mass_matrix),
            "energy" => (Request::ENERGY, 1, |t| &mut t.energy),
            _ => (Request::ACCELERATION, n, |t| &mut t.acceleration),
        };
        let states = States { q, v, force, times: times(t.as_ref())? };
        let mut parts = self.attended(py, states, (request, friction), threads)?;
        Ok(field(py, &mut parts, width, take))
    }

    /// Accelerations and their derivatives by coordinates, velocities and forces at states `(b, n)`, flat.
    fn linearize<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        force: Option<PyReadonlyArray2<'py, f64>>,
        friction: bool,
    ) -> PyResult<Vec<Numbers<'py>>> {
        let (q, v) = self.states(&q, &v)?;
        let force = force.as_ref().map(slice).transpose()?;
        let work = |model: &dyn EulerLagrange<f64>| Linearizer::new(model).under(q, v, force).cloned();
        let found = py.detach(|| self.with_friction(friction, work)).map_err(value)?;
        let Linearization { acceleration, by_q, by_v, by_force } = found;
        Ok([acceleration, by_q, by_v, by_force].map(|numbers| numbers.into_pyarray(py)).into())
    }

    /// Motions from starts `(b, n)`, under forces from outside and with their own friction, or not.
    #[allow(clippy::too_many_arguments)]
    fn rollout<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        times: (f64, f64, f64),
        method: &str,
        accuracy: (f64, f64, Option<f64>),
        acting: (bool, bool),
        forces: Given,
        inputs: Given,
        threads: usize,
    ) -> PyResult<Bound<'py, PyList>> {
        let (q, v) = self.states(&q, &v)?;
        let plan = Plan { times, method, accuracy, acting, forces, inputs, threads };
        plan.motions(py, self, (q, v))
    }

    /// Metric, connection and curvature at points `(b, n)`: flat arrays by name, signatures, and the points that fail with what is wrong.
    #[allow(clippy::type_complexity)]
    fn geometry<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
        velocity: Vec<f64>,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyArray1<i64>>, Vec<(usize, String)>)> {
        self.require_free()?;
        let found = Geometries::of(py, self, slice(&points)?, &velocity)?;
        let arrays = PyDict::new(py);
        for ((name, _), numbers) in FIELDS.iter().zip(found.numbers) {
            arrays.set_item(*name, numbers.into_pyarray(py))?;
        }
        Ok((arrays, found.signatures.into_pyarray(py), found.failures))
    }

    /// Point symmetries, as JSON.
    fn symmetries(
        slf: &Bound<'_, Self>,
        py: Python<'_>,
        region: Vec<(String, f64, f64)>,
        degrees: Option<&str>,
        points: Option<usize>,
        seed: u64,
        tolerance: Option<f64>,
    ) -> PyResult<String> {
        let this = slf.get();
        this.require_free()?;
        let (n, exact) = (this.n(), this.is_exact());
        let region = this.region(this.interest(), region)?;
        let charts = this.charts(&region);
        let degrees: Option<Degrees> = degrees.map(degrees_of).transpose()?;
        let names = &this.columns[..n];
        let tried = bases(names, &charts, degrees, exact);
        let most = tried.iter().map(|(basis, _)| unknowns(n, basis.len())).max().unwrap_or(0);
        let points = points.unwrap_or(enough(most, exact)).min(most_states(n, most));
        let subject = slf.clone().unbind();
        let (found, degrees) = left(py, move |watch| {
            let this = subject.get();
            let (q, v) = this.sampled(&region, points, seed)?;
            let model = Interruptible::new(this.moving(), &watch.interrupt);
            most_symmetries(&model, tried, (&q, &v), (tolerance, exact)).map_err(runtime)
        })??;
        let summary = found.summary(this.name(), degrees, seed, None);
        shown(&summary, &summary.findings())
    }

    /// Its constraints, and the directions that no equation moves, as JSON.
    fn constraints(&self, py: Python<'_>, seed: u64) -> PyResult<String> {
        let system = self.system_instance().ok();
        let description = system.as_ref().and_then(|system| system.system.description());
        let formulas = description.map(|description| description.constraints.clone()).unwrap_or_default();
        let found = whole(py, None, |watch| {
            let (q, v) = self.sampled(&self.interest(), EXAMINED_STATES, seed)?;
            let model = Interruptible::new(self.moving(), &watch.interrupt);
            let about = (self.name(), &self.columns[..self.n()]);
            Ok::<_, PyErr>(examine(about, &model, &formulas, (&q, &v)))
        })??;
        shown(&found, &found.findings())
    }

    /// The Lagrangian as a formula, as JSON.
    fn formula(&self, py: Python<'_>, choices: &str) -> PyResult<String> {
        self.require_free()?;
        let (mut options, name) = FormulaChoices::read(choices)?;
        let (names, periodic) = (&self.columns[..self.n()], self.periodic());
        whole(py, None, |watch| {
            options.cancellation = watch.cancellation();
            let (q, v) = self.sampled(&self.interest(), MODEL_STATES, options.seed)?;
            let found = FoundFormula::of_model(self.moving(), (names, &periodic), (&q, &v), &options).map_err(value)?;
            formula_shown(&found, &name)
        })?
    }

    /// Where the mass matrix is proven to have its signature, as JSON.
    #[allow(clippy::too_many_arguments)]
    fn certify(
        &self,
        py: Python<'_>,
        region: Vec<(String, f64, f64)>,
        signature: Option<(usize, usize)>,
        condition: Option<f64>,
        seconds: f64,
        boxes: usize,
        threads: usize,
    ) -> PyResult<String> {
        self.require_free()?;
        let mut known = self.bounds();
        if matches!(self.kind, Kind::Model(..)) {
            for (bounds, _) in known.position.iter_mut().zip(self.periodic()).filter(|(_, periodic)| *periodic) {
                *bounds = [0.0, TAU];
            }
        }
        let Region { position, velocity } = self.region(known, region)?;
        let pairs = |bounds: Vec<[f64; 2]>| bounds.into_iter().map(|[low, high]| (low, high)).collect();
        let region = Bounds { positions: pairs(position), velocities: pairs(velocity) };
        let usual = Signature::of(self.n(), self.time_like().is_some());
        let signature = signature.map_or(usual, |(positive, negative)| Signature { positive, negative });
        let found: Certificate = whole(py, None, |watch| {
            let mut options = CertificateOptions::new(signature);
            (options.condition, options.seconds, options.boxes) = (condition, seconds, boxes);
            (options.threads, options.stop) = (threads, Some(watch.interrupt.as_ref()));
            match &self.kind {
                Kind::System(configured, _) => Certificate::of_system(configured, &region, &options),
                Kind::Model(_, network, _) => Certificate::of_network(network, &region, &options),
            }
        })?
        .map_err(value)?;
        shown(&found, &found.findings(&self.columns))
    }

    /// The page of a model, HTML.
    fn page(&self) -> PyResult<String> {
        let Kind::Model(header, network, _) = &self.kind else { return Err(value("a system has no page")) };
        page(header, network, self.system_instance().ok().as_ref()).map_err(value)
    }

    /// A model beside a system, the one that it learned if none is given, as JSON.
    fn evaluate(
        &self,
        py: Python<'_>,
        system: Option<&Self>,
        plan: (usize, u64, usize),
        progress: Option<Py<PyAny>>,
    ) -> PyResult<String> {
        let Kind::Model(header, network, _) = &self.kind else { return Err(value("a system is exact already")) };
        let (starts, seed, threads) = plan;
        let system = system.unwrap_or(self).system_instance()?;
        if system.system.columns(system.coordinates) != self.columns {
            return Err(value(format_args!("expected a system with the columns {:?}", self.columns)));
        }
        let mut options = EvaluationOptions::new(&system, trained_on(header), seed).map_err(pipeline)?;
        // A system that is described in the model's file is the one whose constraints it was learned under.
        options.constraints = header.description.is_none().then(|| header.constraints.clone());
        (options.starts, options.threads) = (starts, threads);
        let found = whole(py, progress.as_ref(), |watch| Evaluation::of(&system, network, options, watch))?;
        serde_json::to_string(&found.map_err(pipeline)?).map_err(runtime)
    }
}
