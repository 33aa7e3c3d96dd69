//! A system or a model to be analysed, the states at which it is evaluated, and functions of its coordinates.

use crate::CliError;
use crate::arguments::learned::{Learned, held};
use crate::arguments::number::{bounds, index_of, positive};
use crate::arguments::source::{Source, require_at_most};
use crate::arguments::system_arg::{self, learned_system};
use crate::thresholds::{CHARGES_SEED, NARROWEST_RANGE};
use lnn::lagrangian::{EulerLagrange, SystemInstance};
use lnn::network::file::MAX_COORDINATES;
use lnn::rollout::Trajectory;
use lnn::symmetry::{
    Basis, Charge, ChargeDrift, Chart, Degrees, Region, Symmetries, TOLERANCES, bases, enough, middle, most_states,
    most_symmetries, unknowns,
};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// A Lagrangian with the data about its coordinates.
pub struct Probe {
    /// Name of the system.
    pub name: String,
    /// Its terms.
    pub model: Box<dyn EulerLagrange<f64>>,
    /// Coordinates, then velocities.
    pub columns: Vec<String>,
    /// The region of states to examine: for a system, the states on which errors are reported; for a model, the central part of the
    /// training states.
    pub region: Region,
    /// `true` for a system, whose terms are exact.
    pub exact: bool,
    /// The formulas of its constraints, by name.
    pub constraints: BTreeMap<String, String>,
    /// Which coordinates are angles.
    pub periodic: Vec<bool>,
    units: Vec<String>,
    /// The system, or the system that a model learned, with its mass shell and its domain.
    system: Option<SystemInstance<f64>>,
}

/// `NAME=LOW:HIGH`, the bounds of a column.
pub type Bound = (String, [f64; 2]);

/// Parses a [`Bound`].
///
/// # Errors
/// The form that was expected.
pub fn bound(text: &str) -> Result<Bound, String> {
    let wrong = || {
        format!(
            "expected NAME=LOW:HIGH, such as r=4:12 or r_dot=-0.3:0.3, HIGH above LOW by {NARROWEST_RANGE:e} of the larger at least"
        )
    };
    let (name, range) = text.split_once('=').ok_or_else(wrong)?;
    let (low, high) = bounds(range).map_err(|_| wrong())?;
    let wide = high - low > NARROWEST_RANGE * low.abs().max(high.abs());
    if wide && !name.trim().is_empty() { Ok((name.trim().to_string(), [low, high])) } else { Err(wrong()) }
}

/// Parses the largest singular value at which a field counts as a symmetry.
///
/// # Errors
/// The range.
pub fn tolerance(text: &str) -> Result<f64, String> {
    let [least, most] = TOLERANCES;
    let value = positive(text).ok().filter(|x| (least..=most).contains(x));
    value.ok_or_else(|| format!("expected a number from {least:.1e} (rounding) to {most} (no longer a symmetry)"))
}

/// `true` for a file or directory that does not describe a system.
fn is_model(text: &str) -> bool {
    Path::new(text).exists() && !system_arg::is_file(text)
}

impl Probe {
    /// A model or a system, with constraints as well.
    ///
    /// # Errors
    /// As [`Probe::system`] and [`Probe::model`].
    pub fn with_constraints(text: &str) -> Result<Self, CliError> {
        match is_model(text) {
            true => Self::model_with_constraints(Path::new(text)),
            false => Self::system_with_constraints(text, &[]),
        }
    }

    /// A system by name or by file.
    ///
    /// # Errors
    /// A usage error for an unknown name, a mistake in a file or a wrong parameter.
    pub fn system(name: &str, given: &[(String, String)]) -> Result<Self, CliError> {
        let probe = Self::system_with_constraints(name, given)?;
        if probe.model.manifold().is_some() { Err(held(&name)) } else { Ok(probe) }
    }

    /// As [`Probe::system`], including systems with constraints.
    ///
    /// # Errors
    /// Those of [`Probe::system`].
    fn system_with_constraints(name: &str, given: &[(String, String)]) -> Result<Self, CliError> {
        let configure = |system| SystemInstance::<f64>::new(system, given).map_err(CliError::usage);
        let mut configured = configure(system_arg::system(name)?)?;
        // The drive of a system is removed, because properties of a Lagrangian do not depend on it.
        if let Some(driven) = configured.system.description().filter(|_| configured.is_timed()) {
            let mut free = driven.clone();
            free.forces.clear();
            free.inputs.clear();
            configured = configure(Cow::Owned(free.system().map_err(CliError::usage)?))?;
        }
        configured.require_states().map_err(CliError::usage)?;
        let Source { model, columns, .. } = Source::of(&configured)?;
        let n = configured.coordinates;
        require_at_most(MAX_COORDINATES, n)?;
        let (bounds, coordinates) = (configured.system.validation(n), configured.system.coordinates(n));
        let pairs = |list: Vec<(f64, f64)>| list.into_iter().map(|(low, high)| [low, high]).collect();
        Ok(Self {
            name: configured.system.name.to_string(),
            model,
            columns,
            region: Region { position: pairs(bounds.positions), velocity: pairs(bounds.velocities) },
            exact: true,
            periodic: coordinates.iter().map(|c| c.periodic).collect(),
            units: coordinates.iter().map(|c| c.unit.to_string()).collect(),
            constraints: configured.system.description().map(|own| own.constraints.clone()).unwrap_or_default(),
            system: Some(configured),
        })
    }

    /// A trained model, by its file or by the directory of its run.
    ///
    /// # Errors
    /// A data error for anything but an intact model file, a usage error for a model under constraints.
    pub fn model(path: &Path) -> Result<Self, CliError> {
        let probe = Self::model_with_constraints(path)?;
        if probe.model.manifold().is_some() { Err(held(&path.display())) } else { Ok(probe) }
    }

    /// As [`Probe::model`], including models under constraints.
    ///
    /// # Errors
    /// A data error for anything but an intact model file.
    fn model_with_constraints(path: &Path) -> Result<Self, CliError> {
        let learned = Learned::<f64>::load(path)?;
        // A model of recorded motion has no system; its coordinates have no units then.
        let known = learned_system(&learned.header).is_ok();
        let system = if known { Some(learned.system(path)?) } else { None };
        let constraints = learned.header.held_by().clone();
        let (header, model) = learned.motion(path)?;
        let periodic = header.architecture.periodic.iter().copied();
        let position = header.position.into_iter().zip(periodic);
        let position = position.map(|(range, periodic)| if periodic { range } else { middle(range) }).collect();
        let units = match &system {
            Some(system) => system.system.coordinates(system.coordinates).iter().map(|c| c.unit.to_string()).collect(),
            None => vec![String::new(); model.coordinates()],
        };
        Ok(Self {
            name: header.system,
            model,
            columns: header.columns,
            region: Region { position, velocity: header.velocity.into_iter().map(middle).collect() },
            exact: false,
            periodic: header.architecture.periodic,
            units,
            constraints,
            system,
        })
    }

    /// A system or a model: a file that ends in `.toml` and a name of the catalogue are systems, any other file or directory is a model.
    ///
    /// # Errors
    /// As [`Probe::system`] and [`Probe::model`].
    pub fn either(text: &str, given: &[(String, String)]) -> Result<Self, CliError> {
        let path = Path::new(text);
        match (is_model(text), given.is_empty()) {
            (true, true) => Self::model(path),
            (true, false) => Err(CliError::usage(format_args!("{text}: the parameters of a model are fixed"))),
            _ => Self::system(text, given),
        }
    }

    /// Replaces bounds of columns.
    ///
    /// # Errors
    /// A usage error for a column that does not exist.
    pub fn narrow(&mut self, ranges: &[Bound]) -> Result<(), CliError> {
        let n = self.model.coordinates();
        for (name, range) in ranges {
            match index_of("--region", "column", name, &self.columns)? {
                k if k < n => self.region.position[k] = *range,
                k => self.region.velocity[k - n] = *range,
            }
        }
        Ok(())
    }

    /// Restricts both regions to their intersection.
    ///
    /// # Errors
    /// A usage error if there are none.
    pub fn meet(&mut self, other: &mut Self) -> Result<(), CliError> {
        let both = self.region.meet(&other.region).map_err(|column| {
            let name = &self.columns[column];
            let [a, b] = [&self.region, &other.region].map(|region| {
                let [low, high] = region.range(column);
                format!("{low}:{high}")
            });
            CliError::usage(format_args!("{name}: the ranges {a} and {b} do not overlap; choose one with --region"))
        })?;
        (self.region, other.region) = (both.clone(), both);
        Ok(())
    }

    /// Names of the coordinates.
    pub fn coordinates(&self) -> &[String] {
        &self.columns[..self.model.coordinates()]
    }

    /// Units of the coordinates, empty texts where they are not known, and of time.
    pub fn units(&self) -> (Vec<String>, String) {
        let time = self.system.as_ref().map_or("s", |system| &system.system.time_unit);
        (self.units.clone(), time.to_string())
    }

    fn charts(&self) -> Vec<Chart> {
        let parts = self.periodic.iter().zip(&self.units).zip(&self.region.position);
        parts.map(|((periodic, unit), range)| Chart::of(*periodic, unit, *range)).collect()
    }

    /// Functions of the coordinates up to these degrees, or the default ones for its coordinates.
    ///
    /// # Errors
    /// A usage error for degrees with too many functions.
    pub fn basis(&self, degrees: Option<Degrees>) -> Result<(Basis, Degrees), CliError> {
        Basis::within(self.coordinates(), &self.charts(), degrees)
            .map_err(|problem| CliError::usage(format_args!("--basis: {problem}")))
    }

    /// Number of states for a search with `unknowns` coefficients: the requested one, or the default one as far as memory allows.
    ///
    /// # Errors
    /// A usage error for more states than memory allows.
    pub fn points(&self, asked: Option<usize>, usual: usize, unknowns: usize) -> Result<usize, CliError> {
        let most = most_states(self.model.coordinates(), unknowns);
        match asked {
            Some(points) if points > most => Err(CliError::usage(format_args!(
                "--points: expected at most {most} states for {unknowns} unknown coefficients, found {points}"
            ))),
            asked => Ok(asked.unwrap_or(usual).min(most)),
        }
    }

    /// Finds the point symmetries in the basis that shows the most of them; among equal ones, in the basis with the widest gap.
    ///
    /// # Errors
    /// A data error if nothing can be found out.
    pub fn symmetries(
        &self,
        degrees: Option<Degrees>,
        states: (&[f64], &[f64]),
        tolerance: Option<f64>,
    ) -> Result<(Symmetries, Degrees), CliError> {
        let bases = bases(self.coordinates(), &self.charts(), degrees, self.exact);
        most_symmetries(self.model.as_ref(), bases, states, (tolerance, self.exact)).map_err(CliError::data)
    }

    /// The charges of the point symmetries in the default basis along a motion.
    ///
    /// # Errors
    /// A usage error for a region outside the domain, a data error for terms that are not finite.
    pub fn charges(&self, motion: &Trajectory<f64>) -> Result<Vec<ChargeDrift>, CliError> {
        let (largest, model) = (self.basis(None)?.0, self.model.as_ref());
        let (q, v) = self.states(self.enough(unknowns(model.coordinates(), largest.len())), CHARGES_SEED)?;
        let (found, _) = self.symmetries(None, (&q, &v), None)?;
        let charges = Charge::of(model, &found.basis, &found.fields, motion).map_err(CliError::data)?;
        Ok(found.drifts(&charges))
    }

    /// Number of states to examine for a number of unknown coefficients.
    pub fn enough(&self, unknowns: usize) -> usize {
        enough(unknowns, self.exact)
    }

    /// States `(states, n)` of the region, on the mass shell and inside the domain of the system.
    ///
    /// # Errors
    /// A usage error if hardly any state of the region is inside.
    pub fn states(&self, states: usize, seed: u64) -> Result<(Vec<f64>, Vec<f64>), CliError> {
        self.states_beside(self, states, seed)
    }

    /// As [`Probe::states`], but also inside the domain of another system, whose mass shell is used if this one has none.
    ///
    /// # Errors
    /// Those of [`Probe::states`].
    pub fn states_beside(&self, other: &Self, states: usize, seed: u64) -> Result<(Vec<f64>, Vec<f64>), CliError> {
        let systems: Vec<_> = [other, self].into_iter().filter_map(|probe| probe.system.as_ref()).collect();
        let accept = |q: &[f64], v: &mut [f64]| {
            systems.iter().all(|system| system.check_domain(q).is_ok() && system.impose_constraint(q, v).is_ok())
        };
        let (q, v) = self.region.states(states, seed, accept);
        if q.len() < states * self.model.coordinates() {
            return Err(CliError::usage("--region: nearly all of its states are outside the domain of the system"));
        }
        Ok((q, v))
    }
}
