//! Something that moves by a Lagrangian: a system or a model.

use crate::attend::{left, whole};
use crate::errors::{pipeline, runtime, value};
use crate::forces::{Forces, Samples};
use crate::readings::{FormulaChoices, formula_shown, shown};
use lnn::certificate::{Certificate, CertificateOptions, Signature};
use lnn::constraints::{EXAMINED_STATES, examine};
use lnn::formula::{MODEL_STATES, FoundFormula};
use lnn::geometry::{Geometry, GeometryError};
use lnn::lagrangian::{Bounds, Size};
use lnn::lagrangian::{
    Description, EulerLagrange, Frictionless, Interruptible, Linearization, Linearizer, MechanicsError, Request,
    SystemInstance, Terms, constrained_systems, System,
};
use lnn::linalg::Workspace;
use lnn::network::{Header, ModelFile, NetworkLagrangian};
use lnn::pipeline::{
    CONSTRAINTS_UNSUPPORTED, EvaluationOptions, Watch, Evaluation, parse_robot, rewrite_robot, trained_on,
};
use lnn::report::page;
use lnn::rollout::{Event, Integrator, Occurrence, Rollout, RolloutError, RolloutOptions, Start, rollout_each};
use lnn::symmetry::{Chart, Degrees, Region, bases, enough, middle, most_states, most_symmetries, unknowns};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// States whose terms are computed at a time.
const CHUNK: usize = 4096;
/// Points whose geometry is computed at a time.
const GEOMETRY_CHUNK: usize = 256;
/// Components of Riemann tensors at once, at most: with all that stands beside them about 1 GB.
const MOST_GEOMETRY: usize = 1 << 25;

/// Origin of a Lagrangian.
enum Kind {
    System(Box<SystemInstance<f64>>, Box<dyn EulerLagrange<f64>>),
    Model(Box<Header>, Box<NetworkLagrangian<f64>>, Box<dyn EulerLagrange<f64>>),
}

/// A system or a model.
#[pyclass(frozen, module = "lnn._lnn")]
pub struct Subject {
    kind: Kind,
    /// Coordinates, then velocities.
    pub columns: Vec<String>,
}

/// All systems of the catalogue, as JSON.
#[pyfunction]
pub fn systems() -> PyResult<String> {
    let free = lnn::lagrangian::System::unconstrained().iter().map(Cow::Borrowed);
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

/// Values of all parameters of a system, its size among them.
pub fn values(configured: &SystemInstance<f64>) -> BTreeMap<String, f64> {
    let SystemInstance { system, coordinates, parameters } = configured;
    let named = system.parameters.iter().map(|parameter| parameter.symbol.to_string());
    let mut values: BTreeMap<String, f64> = named.zip(parameters.iter().copied()).collect();
    if let Size::Chosen { symbol, .. } = system.size {
        values.insert(symbol.to_string(), *coordinates as f64);
    }
    values
}

impl Subject {
    fn of(configured: SystemInstance<f64>) -> PyResult<Self> {
        let columns = configured.system.columns(configured.coordinates);
        let built = configured.build().map_err(value)?;
        Ok(Self { kind: Kind::System(Box::new(configured), built), columns })
    }

    /// A model, from a header and weights, under the constraints that it was learned under.
    pub fn learned(header: Header, network: NetworkLagrangian<f64>) -> PyResult<Self> {
        let columns = header.columns.clone();
        let motion = header.constrain(Box::new(network.cast::<f64>())).map_err(value)?;
        Ok(Self { kind: Kind::Model(Box::new(header), Box::new(network), motion), columns })
    }

    /// Refuses what knows free coordinates alone.
    pub fn require_free(&self) -> PyResult<()> {
        match self.moving().manifold() {
            None => Ok(()),
            Some(_) => Err(value(CONSTRAINTS_UNSUPPORTED)),
        }
    }

    fn n(&self) -> usize {
        self.columns.len() / 2
    }

    /// What moves.
    pub fn moving(&self) -> &dyn EulerLagrange<f64> {
        match &self.kind {
            Kind::System(_, built) => built.as_ref(),
            Kind::Model(_, _, motion) => motion.as_ref(),
        }
    }

    /// What moves, with its own friction or without.
    fn with_friction<T>(&self, friction: bool, work: impl FnOnce(&dyn EulerLagrange<f64>) -> T) -> T {
        if friction { work(self.moving()) } else { work(&Frictionless(self.moving())) }
    }

    /// The system, or the one that the model learned.
    pub fn system_instance(&self) -> PyResult<SystemInstance<f64>> {
        let header = match &self.kind {
            Kind::System(configured, _) => return Ok((**configured).clone()),
            Kind::Model(header, ..) => header,
        };
        let system = match &header.description {
            Some(description) => description.system().map(Cow::Owned).map_err(value)?,
            None => Cow::Borrowed(System::named(&header.system).map_err(|_| {
                let problem = "is no system of the catalogue: give the system to compare with";
                value(format_args!("{:?}, which the model learned, {problem}", header.system))
            })?),
        };
        SystemInstance::with_values(system, &header.parameters).map_err(value)
    }

    fn time_like(&self) -> Option<usize> {
        match &self.kind {
            Kind::System(configured, _) => configured.system.time_like,
            Kind::Model(header, ..) => header.architecture.time_like,
        }
    }

    /// Bounds of interest of every coordinate and velocity: those of validation, or of training.
    fn bounds(&self) -> Region {
        match &self.kind {
            Kind::System(configured, _) => {
                let Bounds { positions, velocities } = configured.system.validation(configured.coordinates);
                let pairs = |bounds: Vec<(f64, f64)>| bounds.into_iter().map(|(low, high)| [low, high]).collect();
                Region { position: pairs(positions), velocity: pairs(velocities) }
            }
            Kind::Model(header, ..) => Region { position: header.position.clone(), velocity: header.velocity.clone() },
        }
    }

    /// The states of interest: those of a system on which errors are stated, the middle of those that a model learned from, all of one turn of an
    /// angle.
    pub fn interest(&self) -> Region {
        let Region { position, velocity } = self.bounds();
        if matches!(self.kind, Kind::System(..)) {
            return Region { position, velocity };
        }
        let position = position.into_iter().zip(self.periodic());
        Region {
            position: position.map(|(range, angle)| if angle { range } else { middle(range) }).collect(),
            velocity: velocity.into_iter().map(middle).collect(),
        }
    }

    /// Unit of its coordinates and its time, if its system is known.
    pub fn time_unit(&self) -> Option<String> {
        self.system_instance().ok().map(|system| system.system.time_unit.to_string())
    }

    /// Whether its terms are exact: of a system, not of a model.
    pub fn is_exact(&self) -> bool {
        matches!(self.kind, Kind::System(..))
    }

    /// The kinds of values that its coordinates take in a region.
    pub fn charts(&self, region: &Region) -> Vec<Chart> {
        let known = self.periodic().into_iter().zip(self.units()).zip(&region.position);
        known.map(|((periodic, unit), range)| Chart::of(periodic, &unit, *range)).collect()
    }

    /// States of a region, on the mass shell and inside the domain of the system.
    fn sampled(&self, region: &Region, count: usize, seed: u64) -> PyResult<(Vec<f64>, Vec<f64>)> {
        self.sampled_beside(self, region, count, seed)
    }

    /// The same, inside the domain of another system as well, whose mass shell serves if this one has none.
    pub fn sampled_beside(
        &self,
        other: &Self,
        region: &Region,
        count: usize,
        seed: u64,
    ) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let systems: Vec<_> = [other, self].into_iter().filter_map(|one| one.system_instance().ok()).collect();
        let accept = |q: &[f64], v: &mut [f64]| {
            systems.iter().all(|s| s.check_domain(q).is_ok() && s.impose_constraint(q, v).is_ok())
        };
        let (q, v) = region.states(count, seed, accept);
        if q.len() < count * self.n() {
            return Err(value("region: nearly all of its states are outside the domain of the system"));
        }
        Ok((q, v))
    }

    /// Name of the system.
    pub fn name(&self) -> &str {
        match &self.kind {
            Kind::System(configured, _) => &configured.system.name,
            Kind::Model(header, ..) => &header.system,
        }
    }

    fn periodic(&self) -> Vec<bool> {
        match &self.kind {
            Kind::System(configured, _) => {
                configured.system.coordinates(configured.coordinates).iter().map(|c| c.periodic).collect()
            }
            Kind::Model(header, ..) => header.architecture.periodic.clone(),
        }
    }

    fn units(&self) -> Vec<String> {
        self.system_instance().map_or_else(
            |_| vec![String::new(); self.n()],
            |system| system.system.coordinates(system.coordinates).iter().map(|c| c.unit.to_string()).collect(),
        )
    }

    fn summary(&self) -> Value {
        let Region { position, velocity } = self.bounds();
        let mut summary = json!({
            "columns": self.columns, "periodic": self.periodic(), "units": self.units(),
            "time_like": self.time_like(), "position": position, "velocity": velocity,
        });
        let more = match &self.kind {
            Kind::System(configured, _) => {
                let system = &configured.system;
                json!({
                    "name": system.name, "title": system.title, "time_unit": system.time_unit,
                    "parameters": values(configured), "description": system.description(),
                    "inputs": configured.inputs().collect::<Vec<_>>(),
                    "measured": configured.readings().iter().map(|own| json!({
                        "name": own.name, "column": own.column, "error": own.error, "periodic": own.periodic,
                    })).collect::<Vec<_>>(),
                })
            }
            Kind::Model(header, ..) => json!({ "name": header.system, "header": header }),
        };
        if let (Some(summary), Value::Object(more)) = (summary.as_object_mut(), more) {
            summary.extend(more);
        }
        summary
    }

    /// A region with the bounds of the named columns replaced.
    pub fn region(&self, usual: Region, given: Vec<(String, f64, f64)>) -> PyResult<Region> {
        let mut region = usual;
        for (name, low, high) in given {
            let place = self.columns.iter().position(|column| *column == name);
            let place =
                place.ok_or_else(|| value(format_args!("region: no column {name:?} among {:?}", self.columns)))?;
            let n = self.n();
            let side = if place < n { &mut region.position[place] } else { &mut region.velocity[place - n] };
            *side = [low, high];
        }
        Ok(region)
    }

    fn fits(&self, what: &str, columns: usize) -> PyResult<()> {
        if columns == self.n() {
            return Ok(());
        }
        Err(value(format_args!("{what}: expected {} numbers per state, found {columns}", self.n())))
    }

    /// Terms of states; few of them, which are computed in a moment, without a look at signals.
    fn attended(
        &self,
        py: Python<'_>,
        states: States<'_>,
        (request, friction): (Request, bool),
        threads: usize,
    ) -> PyResult<Vec<(Terms<f64>, usize)>> {
        if states.times.is_empty() && !states.q.is_empty() && self.moving().is_timed() {
            return Err(value(MechanicsError::Timed));
        }
        let work = |watch: &Watch| {
            self.with_friction(friction, |model| computed(model, states, request, threads, &watch.interrupt))
        };
        if states.q.len() <= CHUNK * self.n() {
            return Ok(py.detach(|| work(&Watch::default())));
        }
        whole(py, None, work)
    }
}

/// States `(b, n)`, the forces from outside that act on them, and their times `(b)`, which only a system that depends on the time needs.
#[derive(Clone, Copy)]
struct States<'a> {
    q: &'a [f64],
    v: &'a [f64],
    force: Option<&'a [f64]>,
    times: &'a [f64],
}

/// Terms of states, chunk by chunk, parts of them side by side.
fn computed(
    model: &dyn EulerLagrange<f64>,
    States { q, v, force, times }: States<'_>,
    request: Request,
    threads: usize,
    stop: &AtomicBool,
) -> Vec<(Terms<f64>, usize)> {
    let n = model.coordinates();
    // The same work of many coordinates takes fewer states.
    let chunk = (4 * CHUNK / (n * n)).clamp(64, CHUNK);
    let part = |range: Range<usize>| {
        let chunks = range.clone().step_by(chunk).map(|row| row * n..(row + chunk).min(range.end) * n);
        let terms = chunks.take_while(|_| !stop.load(Ordering::Relaxed)).map(|at| {
            let (q, v, mut terms) = (&q[at.clone()], &v[at.clone()], Terms::default());
            let times = times.get(at.start / n..at.end / n).unwrap_or_default();
            // Every row that fails is among the failures, its accelerations are NaN.
            let _ = model.terms_at(times, q, v, request, &mut terms);
            if let Some(force) = force {
                let _ = terms.add_force(n, v, &force[at], &mut Workspace::new());
            }
            (terms, q.len() / n)
        });
        terms.collect::<Vec<_>>()
    };
    let states = q.len() / n;
    let threads = threads.clamp(1, 256).min(states.div_ceil(CHUNK)).max(1);
    if threads == 1 {
        return part(0..states);
    }
    let share = states.div_ceil(threads).next_multiple_of(CHUNK);
    std::thread::scope(|scope| {
        let parts = (0..states).step_by(share).map(|row| row..(row + share).min(states));
        let running: Vec<_> = parts.map(|rows| scope.spawn(|| part(rows))).collect();
        running.into_iter().flat_map(|part| part.join().unwrap_or_default()).collect()
    })
}

/// What a geometry has of numbers at a point, by name and number of indices.
const FIELDS: [(&str, u32); 10] = [
    ("metric", 2),
    ("inverse", 2),
    ("christoffel", 3),
    ("riemann", 4),
    ("ricci", 2),
    ("einstein", 2),
    ("weyl", 4),
    ("determinant", 0),
    ("scalar", 0),
    ("kretschmann", 0),
];

/// Geometries of points, field by field; `NaN` at the points that fail.
#[derive(Default)]
struct Geometries {
    numbers: [Vec<f64>; FIELDS.len()],
    signatures: Vec<i64>,
    failures: Vec<(usize, String)>,
}

impl Geometries {
    fn push(&mut self, n: usize, found: Result<Geometry<f64>, GeometryError>) {
        let parts = match found {
            Ok(Geometry { metric, connection, curvature }) => {
                self.signatures.extend([metric.signature.positive as i64, metric.signature.negative as i64]);
                let tensors =
                    [metric.components, metric.inverse, connection.symbols, curvature.riemann, curvature.ricci];
                let more = [curvature.einstein, curvature.weyl];
                let scalars = [metric.determinant, curvature.scalar, curvature.kretschmann].map(|x| vec![x]);
                tensors.into_iter().chain(more).chain(scalars).collect::<Vec<_>>()
            }
            Err(error) => {
                self.failures.push((self.signatures.len() / 2, error.to_string()));
                self.signatures.extend([0, 0]);
                FIELDS.iter().map(|(_, rank)| vec![f64::NAN; n.pow(*rank)]).collect()
            }
        };
        self.numbers.iter_mut().zip(parts).for_each(|(all, part)| all.extend(part));
    }
}

/// A field of terms.
type Field = fn(&mut Terms<f64>) -> &mut Vec<f64>;

type Numbers<'py> = Bound<'py, PyArray1<f64>>;

/// One field of all chunks; `NaN` where a chunk has none of it.
fn field<'py>(py: Python<'py>, parts: &mut [(Terms<f64>, usize)], width: usize, take: Field) -> Numbers<'py> {
    let whole = |numbers: Vec<f64>, states: usize| {
        if numbers.len() == states * width { numbers } else { vec![f64::NAN; states * width] }
    };
    if let [(terms, states)] = parts {
        return whole(std::mem::take(take(terms)), *states).into_pyarray(py);
    }
    let mut all = Vec::with_capacity(parts.iter().map(|part| part.1 * width).sum());
    for (terms, states) in parts {
        all.append(&mut whole(std::mem::take(take(terms)), *states));
    }
    all.into_pyarray(py)
}

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
        forces: (Option<Samples>, Option<Py<PyAny>>),
        inputs: (Option<Samples>, Option<Py<PyAny>>),
        threads: usize,
    ) -> PyResult<Bound<'py, PyList>> {
        let (q, v) = self.states(&q, &v)?;
        let n = self.n();
        let ((t0, t_end, dt), (rtol, atol, step), (bounded, friction)) = (times, accuracy, acting);
        let method: Integrator = serde_json::from_value(method.into()).map_err(value)?;
        let domain = match &self.kind {
            Kind::Model(header, ..) if bounded => Some(trained_on(header)),
            _ => None,
        };
        let events = self.system_instance().map_or_else(|_| Vec::new(), |known| known.events());
        let events = events.into_iter().map(Event::from).collect();
        let options = RolloutOptions::new(t_end, dt)
            .t0(t0)
            .method(method)
            .tolerances(rtol, atol)
            .step(step)
            .domain(domain)
            .events(events);
        let forces = Forces::of(n, (t0, t_end), "force", forces)?;
        let mut known = None;
        let mut fed = None;
        if let Kind::System(configured, _) = &self.kind
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
                (None, _) => self.with_friction(friction, follow),
            }
        })?;
        if let Some(error) = forces.raised().or_else(|| known.and_then(|known| known.raised())) {
            return Err(error);
        }
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

    /// Metric, connection and curvature at points `(b, n)`: flat arrays by name, signatures, and the points that fail with what is wrong.
    #[allow(clippy::type_complexity)]
    fn geometry<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
        velocity: Vec<f64>,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyArray1<i64>>, Vec<(usize, String)>)> {
        self.require_free()?;
        let (n, points) = (self.n(), slice(&points)?);
        let most = MOST_GEOMETRY / n.pow(4).max(1);
        if points.len() / n > most {
            return Err(value(format_args!("q: expected at most {most} points, found {}", points.len() / n)));
        }
        let model = self.moving();
        let found = whole(py, None, |watch| {
            let mut found = Geometries::default();
            let chunks = points.chunks(GEOMETRY_CHUNK * n);
            for points in chunks.take_while(|_| !watch.interrupt.load(Ordering::Relaxed)) {
                Geometry::of(model, points, &velocity)?.into_iter().for_each(|one| found.push(n, one));
            }
            Ok::<_, GeometryError>(found)
        })?;
        let Geometries { numbers, signatures, failures } = found.map_err(value)?;
        let arrays = PyDict::new(py);
        for ((name, _), numbers) in FIELDS.iter().zip(numbers) {
            arrays.set_item(*name, numbers.into_pyarray(py))?;
        }
        Ok((arrays, signatures.into_pyarray(py), failures))
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

impl Subject {
    /// Both arrays of states as slices.
    pub fn states<'a>(
        &self,
        q: &'a PyReadonlyArray2<'_, f64>,
        v: &'a PyReadonlyArray2<'_, f64>,
    ) -> PyResult<(&'a [f64], &'a [f64])> {
        use numpy::PyUntypedArrayMethods;
        self.fits("q", q.shape()[1])?;
        self.fits("v", v.shape()[1])?;
        if q.shape() != v.shape() {
            return Err(value(format_args!(
                "expected as many velocities as coordinates, found {} and {}",
                v.shape()[0],
                q.shape()[0]
            )));
        }
        Ok((slice(q)?, slice(v)?))
    }
}

/// Degrees of the functions of a basis.
///
/// # Errors
/// `ValueError` for a text that is none.
pub fn degrees_of(text: &str) -> PyResult<Degrees> {
    text.parse().map_err(|problem: String| value(format_args!("basis: {problem}")))
}

/// Times of states; none where none are given.
pub fn times<'a>(given: Option<&'a PyReadonlyArray1<'_, f64>>) -> PyResult<&'a [f64]> {
    given.map_or(Ok(&[]), |times| times.as_slice().map_err(value))
}

/// The numbers of an array, row by row.
pub fn slice<'a>(array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<&'a [f64]> {
    array.as_slice().map_err(value)
}

/// Name, time and state of an event; velocities and energy before and energy after an impact.
type Happened<'py> = (String, f64, Numbers<'py>, Numbers<'py>, Option<(Numbers<'py>, f64, f64)>);

fn happened(py: Python<'_>, event: Occurrence<f64>) -> Happened<'_> {
    let Occurrence { name, t, q, v, impact } = event;
    let impact = impact.map(|hit| (hit.v_before.into_pyarray(py), hit.energy_before, hit.energy_after));
    (name, t, q.into_pyarray(py), v.into_pyarray(py), impact)
}
