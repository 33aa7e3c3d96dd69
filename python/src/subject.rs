//! Something that moves by a Lagrangian: a system or a model.

use crate::arrays::slice;
use crate::errors::value;
use lnn::lagrangian::{Bounds, EulerLagrange, Frictionless, Size, System, SystemInstance};
use lnn::network::{Header, NetworkLagrangian};
use lnn::pipeline::CONSTRAINTS_UNSUPPORTED;
use lnn::symmetry::{Chart, Degrees, Region, middle};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Origin of a Lagrangian.
pub enum Kind {
    System(Box<SystemInstance<f64>>, Box<dyn EulerLagrange<f64>>),
    Model(Box<Header>, Box<NetworkLagrangian<f64>>, Box<dyn EulerLagrange<f64>>),
}

/// A system or a model.
#[pyclass(frozen, module = "lnn._lnn")]
pub struct Subject {
    pub kind: Kind,
    /// Coordinates, then velocities.
    pub columns: Vec<String>,
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
    /// A system with values of its parameters.
    pub fn of(configured: SystemInstance<f64>) -> PyResult<Self> {
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

    pub fn n(&self) -> usize {
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
    pub fn with_friction<T>(&self, friction: bool, work: impl FnOnce(&dyn EulerLagrange<f64>) -> T) -> T {
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

    pub fn time_like(&self) -> Option<usize> {
        match &self.kind {
            Kind::System(configured, _) => configured.system.time_like,
            Kind::Model(header, ..) => header.architecture.time_like,
        }
    }

    /// Bounds of interest of every coordinate and velocity: those of validation, or of training.
    pub fn bounds(&self) -> Region {
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
    pub fn sampled(&self, region: &Region, count: usize, seed: u64) -> PyResult<(Vec<f64>, Vec<f64>)> {
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

    pub fn periodic(&self) -> Vec<bool> {
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

    pub fn summary(&self) -> Value {
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

    /// Both arrays of states as slices.
    pub fn states<'a>(
        &self,
        q: &'a PyReadonlyArray2<'_, f64>,
        v: &'a PyReadonlyArray2<'_, f64>,
    ) -> PyResult<(&'a [f64], &'a [f64])> {
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
