//! Source of the motion for a roll-out: a trained model, or a system.

use crate::CliError;
use crate::arguments::constraints::constrained;
use crate::arguments::forces;
use crate::arguments::forces::KnownForce;
use crate::arguments::learned::{Learned, model_file};
use crate::arguments::number::finite;
use crate::arguments::probe::Probe;
use crate::arguments::source::{Source, parameter};
use crate::arguments::system_arg::{self, learned_system};
use lnn::lagrangian::{EulerLagrange, SystemInstance};
use lnn::report::with_unit;
use lnn::rollout::{Domain, Event};
use std::path::{Path, PathBuf};

/// A source of motion with what is known about it.
pub struct MotionSource {
    /// Name of the system.
    pub name: String,
    /// Its terms.
    pub model: Box<dyn EulerLagrange<f64>>,
    /// Coordinates, then velocities.
    pub columns: Vec<String>,
    /// Units of the columns; for a system known only from recordings, `rad` for angles and `SI` for others.
    pub units: Vec<String>,
    /// Events of the system.
    pub events: Vec<Event<f64>>,
    /// Names of the external forces, one per coordinate, and then of inputs.
    pub forces: Vec<String>,
    /// Values of inputs, if there are any.
    inputs: Option<KnownForce>,
    /// The system, if it is one.
    pub instance: Option<SystemInstance<f64>>,
    /// The states a model was trained on.
    pub domain: Option<Domain<f64>>,
    /// Unit of time; unknown for a recorded system, or a system of another version.
    pub time_unit: Option<String>,
    /// `true` if a time is among the coordinates, so that the parameter of the motion is another one.
    pub time_like: bool,
    /// The file it was read from.
    pub file: Option<PathBuf>,
}

impl MotionSource {
    /// A trained model, by its file or by the directory of its run.
    ///
    /// # Errors
    /// A data error for anything but an intact model file.
    pub fn model(path: &Path) -> Result<Self, CliError> {
        let learned = Learned::<f64>::load(path)?;
        let (domain, forces) = (Some(learned.domain()), forces::names(&learned.header));
        let system = learned_system(&learned.header).ok();
        let events = learned.system(path).map_or_else(|_| Vec::new(), |known| known.events());
        let events = events.into_iter().map(Event::from).collect();
        let time_unit = system.as_ref().map(|system| system.time_unit.to_string());
        let periodic = learned.header.architecture.periodic.iter();
        let units = match system {
            Some(system) => system.units(periodic.len()),
            None => {
                let unit =
                    |of: [&'static str; 2]| periodic.clone().map(move |angle| of[usize::from(*angle)].to_string());
                unit(["SI", "rad"]).chain(unit(["SI", "rad/s"])).collect()
            }
        };
        let time_like = learned.header.architecture.time_like.is_some();
        let (header, model) = learned.motion(path)?;
        let (name, columns, file) = (header.system, header.columns, Some(model_file(path)?));
        let (instance, inputs) = (None, None);
        Ok(Self { name, model, columns, units, events, forces, inputs, instance, domain, time_unit, time_like, file })
    }

    /// A system by name or by file.
    ///
    /// # Errors
    /// A usage error for an unknown name, a mistake in a file or a wrong parameter.
    pub fn system(name: &str, given: &[(String, String)]) -> Result<Self, CliError> {
        let system = system_arg::system(name)?;
        let instance = SystemInstance::<f64>::new(system.clone(), given).map_err(CliError::usage)?;
        let Source { model, columns, mut forces } = Source::of(&instance)?;
        let events = instance.events().into_iter().map(Event::from).collect();
        forces.extend(instance.inputs().map(str::to_string));
        let file = system_arg::is_file(name).then(|| PathBuf::from(name));
        let (name, time_unit) = (system.name.to_string(), Some(system.time_unit.to_string()));
        let (time_like, units) = (system.time_like.is_some(), system.units(columns.len() / 2));
        let (instance, inputs, domain) = (Some(instance), None, None);
        Ok(Self { name, model, columns, units, events, forces, inputs, instance, domain, time_unit, time_like, file })
    }

    /// Splits the values of `--force`: returns external forces, and gives inputs to the model.
    ///
    /// # Errors
    /// A usage error for constraints that leave no motion.
    pub fn take_inputs(&mut self, given: Option<KnownForce>) -> Result<Option<KnownForce>, CliError> {
        let n = self.columns.len() / 2;
        let (Some(given), true) = (given.clone(), self.forces.len() > n) else { return Ok(given) };
        let inputs = given.components(n..self.forces.len());
        self.inputs = Some(inputs.clone());
        if let Some(instance) = &self.instance {
            let count = instance.inputs().count();
            let values = move |t: f64, values: &mut [f64]| inputs.at(t, values);
            self.model = instance.build_with(Box::new((count, values))).map_err(CliError::usage)?;
        }
        let forces = given.components(0..n);
        Ok((!forces.is_zero()).then_some(forces))
    }

    /// The known values at a time: the time, then the inputs.
    pub fn known(&self, t: f64) -> Vec<f64> {
        let mut known = vec![t; 1 + self.forces.len() - self.columns.len() / 2];
        if let Some(inputs) = &self.inputs {
            inputs.at(t, &mut known[1..]);
        }
        known
    }

    /// Label of the parameter of the motion: a time, or the affine parameter of geodesics, which is the proper time of matter.
    pub fn parameter(&self) -> String {
        let parameter = if self.time_like { "affine parameter" } else { "time" };
        with_unit(parameter, self.time_unit.as_deref().unwrap_or_default())
    }

    /// The states that the motion should stay within: the training states of a model, all states for a system.
    pub fn range(&self) -> Domain<f64> {
        self.domain.clone().unwrap_or_else(|| Domain::new(vec![None; self.columns.len()]))
    }
}

/// A model or a system with an initial state, and what holds its motion.
#[derive(Debug, clap::Args)]
pub struct MotionArgs {
    /// Model, a file or the directory of a run.
    #[arg(required_unless_present = "system")]
    pub model: Option<PathBuf>,
    /// Predict the exact motion of a system instead of a model, by name (`lnn systems` lists them) or by its file.
    #[arg(long, value_name = "NAME|FILE", conflicts_with = "model")]
    system: Option<String>,
    /// A parameter of the system; may be repeated.
    #[arg(long, value_name = "SYMBOL=VALUE", conflicts_with = "model", value_parser = parameter)]
    param: Vec<(String, String)>,
    /// Initial state: coordinates, then velocities, separated by commas. It is used as given, on a mass shell or off it. Under
    /// constraints, a state that misses them by less than a thousandth of its size is projected onto them, and any other is refused.
    #[arg(long, value_name = "q1,..,v1,..", required = true, value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    pub state: Vec<f64>,
    /// Constraints that hold the motion, a file with a table [constraints] as `lnn constraints --out` writes it.
    #[arg(long, value_name = "FILE.toml")]
    pub constraints: Option<PathBuf>,
    /// Take the acceleration of least norm where the mass matrix is singular, and report the number of free directions.
    #[arg(long)]
    pub least_norm: bool,
}

impl MotionArgs {
    /// The source of the motion, under the given constraints.
    ///
    /// # Errors
    /// Those of [`MotionSource::model`] and [`MotionSource::system`], and a usage error for a state of the wrong length.
    pub fn read(&self) -> Result<MotionSource, CliError> {
        let mut source = match &self.model {
            Some(path) => MotionSource::model(path)?,
            None => MotionSource::system(self.system.as_deref().unwrap_or_default(), &self.param)?,
        };
        let (expected, found) = (source.columns.len(), self.state.len());
        if found != expected {
            let names = source.columns.join(",");
            return Err(CliError::usage(format_args!("--state: expected {expected} numbers ({names}), found {found}")));
        }
        if let Some(file) = &self.constraints {
            source.model = constrained(source.model, &source.columns, file, self.state.split_at(expected / 2))?;
        }
        Ok(source)
    }

    /// The same model or system as a subject of analysis.
    ///
    /// # Errors
    /// Those of [`Probe::model`] and [`Probe::system`].
    pub fn probe(&self) -> Result<Probe, CliError> {
        match &self.model {
            Some(path) => Probe::model(path),
            None => Probe::system(self.system.as_deref().unwrap_or_default(), &self.param),
        }
    }
}
