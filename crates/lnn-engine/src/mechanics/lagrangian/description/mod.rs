//! User-defined systems: the contents of a system file, and the [`System`](super::system::System) built from it.
//!
//! The structures match those of a TOML file (`docs/system-files.md`), of the table `[description]` of a configuration and of the header of
//! a model file.

mod chain;
mod checks;
mod events;
mod formulas;
mod measured;
mod metric;
#[cfg(feature = "serde")]
pub mod pair;
mod per_trajectory;
mod quantity;
#[cfg(feature = "serde")]
mod read;
mod scope;
mod states;
mod system;

use super::constraints::ExpressionConstraints;
use super::expression::{ExpressionError, Formula};
use super::formula_events::FormulaEvent;
use super::formula_forces::FormulaForces;
use super::formula_readings::FormulaReading;
use super::recursion::Shape;
use super::system::{Range, ShellAdvice};
use super::{ExpressionLagrangian, Lagrangian};
use crate::scalar::Real;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
pub use chain::ShownLink;
pub use chain::turned;
use chain::{ChainDescription, LinkDescription};
pub use chain::{inertia_symbols, loss_symbols};
pub use checks::is_free_name;
use events::EventDescription;
use measured::MeasuredDescription;
pub use per_trajectory::Per;
pub use per_trajectory::PerTrajectory;
use quantity::{Decimal, Quantity};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// A system: coordinates, parameters, and a Lagrangian or a metric given as formulas.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Description {
    /// Name: letters, digits, `-` and `_`; must differ from all names in the catalogue.
    pub name: String,
    /// Name in titles; by default the name.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub title: Option<String>,
    /// Unit of the evolution parameter; by default `s`, or none for a system with a time-like coordinate.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub time_unit: Option<String>,
    /// `L` in terms of coordinates, velocities `NAME_dot`, parameters and definitions; an alternative to a metric.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub lagrangian: Option<String>,
    /// Rayleigh's dissipation function `D` in terms of the same names, with the force `-dD/dv`; optional.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub dissipation: Option<String>,
    /// Generalized forces in addition to those of `L` and `D`, by the coordinates on which they act: formulas of the same names, the time
    /// `t` and inputs.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    pub forces: BTreeMap<String, String>,
    /// Measured quantities on which the forces depend, such as the voltage of a motor, and their units.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    pub inputs: BTreeMap<String, String>,
    /// Inputs that are constant along a motion, so that all formulas may depend on them.
    #[cfg_attr(feature = "serde", serde(skip))]
    marks: BTreeSet<String>,
    /// Events by name: a roll-out finds the zeros of these formulas of the same names and the time `t`.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    events: BTreeMap<String, EventDescription>,
    /// Sensor readings by name: formulas of the same names, accelerations, the time `t` and inputs.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    measured: BTreeMap<String, MeasuredDescription>,
    /// Coordinates, in order; for a chain of links by default `q1`, `q2`, and so on.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub(crate) coordinates: Vec<CoordinateDescription>,
    /// Settings shared by all links.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    chain: Option<ChainDescription>,
    /// Links of a chain, starting at its base, each with the joint that moves it, one per coordinate. A Lagrangian and a dissipation
    /// function are added to those of the links.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    links: Vec<LinkDescription>,
    /// Constants by name.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    #[doc(hidden)]
    pub parameters: BTreeMap<String, ParameterDescription>,
    /// Abbreviations for formulas; they may use each other in any order.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    pub definitions: BTreeMap<String, String>,
    /// Formulas that must vanish, by the names of the constraints: functions of coordinates, or linear in velocities.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    pub constraints: BTreeMap<String, String>,
    /// Lines of the constraints in the file, if known.
    #[cfg_attr(feature = "serde", serde(skip))]
    #[doc(hidden)]
    pub constraint_lines: ConstraintLines,
    /// Components of `g` in `L = g_ij q_i_dot q_j_dot / 2` by pairs of coordinates, `"t,r"`; the metric is symmetric, and missing
    /// components are 0.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub metric: Option<BTreeMap<String, String>>,
    /// Bounds of training states by column name; by default those of the coordinates.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "pair::by_name")
    )]
    pub training: BTreeMap<String, [Quantity; 2]>,
    /// Bounds of the states at which errors are reported.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "pair::by_name")
    )]
    pub validation: BTreeMap<String, [Quantity; 2]>,
    /// Trajectories on which a model is tested.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "TrajectoryDescription::is_empty"))]
    pub(crate) trajectory: TrajectoryDescription,
    /// Spherical shell for the training states, used for metrics of a field around a centre; by default the states fill the bounds.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub(crate) shell: Option<ShellDescription>,
}

/// Spherical shell around a centre.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct ShellDescription {
    /// Names of the Cartesian coordinates around the centre.
    pub(crate) coordinates: Vec<String>,
    /// Smallest and largest distance from the centre.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "pair::one"))]
    pub radius: [Quantity; 2],
    /// Largest rapidity in a local frame; by default 1.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub rapidity: Option<Quantity>,
}

/// A coordinate.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct CoordinateDescription {
    /// Name, also of its column; the velocity's name adds `_dot`.
    pub name: String,
    /// Unit.
    #[cfg_attr(feature = "serde", serde(default = "one"))]
    pub unit: String,
    /// `true` for an angle in radians, for which values that differ by `2 pi` are equal.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    pub periodic: bool,
    /// `true` for the time-like coordinate of a spacetime.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    pub time_like: bool,
    /// Smallest and largest value of interest; by default one turn for a periodic coordinate.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "pair::optional")
    )]
    pub bounds: Option<[Quantity; 2]>,
    /// Smallest and largest velocity of interest; without them the velocity of the time-like coordinate of a metric follows from `g(v, v) =
    /// -1`.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "pair::optional")
    )]
    pub velocity_bounds: Option<[Quantity; 2]>,
}

/// A constant: a number, or a table with further keys.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize))]
pub struct ParameterDescription {
    /// Default value.
    pub default: Decimal,
    /// Unit.
    pub unit: String,
    /// Allowed values.
    pub range: Range,
    /// `true` if training determines its value.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "is_false"))]
    pub learn: bool,
    /// Set if the parameter has a separate value for each trajectory.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub per: Option<Per>,
    /// Known values, by the names of the trajectories.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "BTreeMap::is_empty"))]
    pub known: BTreeMap<String, Decimal>,
}

/// Trajectories on which a model is tested.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct TrajectoryDescription {
    /// End of the time span, which starts at 0; by default 10.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub t_end: Option<Quantity>,
    /// Output step; by default a hundredth of the span.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub dt: Option<Quantity>,
    /// Bounds of the initial states by column; by default the middle half of the validation bounds.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "pair::by_name")
    )]
    pub start: BTreeMap<String, [Quantity; 2]>,
}

impl TrajectoryDescription {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl Description {
    /// Returns this description with other values of parameters, by name.
    fn with_defaults(&self, values: &[(&str, f64)]) -> Self {
        let mut changed = self.clone();
        for (name, value) in values {
            if let Some(parameter) = changed.parameters.get_mut(*name) {
                parameter.default = Decimal(format!("{value:?}"));
            }
        }
        changed
    }

    /// Assembles a system from a Lagrangian and constraints; coordinates have units, bounds and velocity bounds, parameters have defaults,
    /// units and ranges.
    pub(super) fn of_parts<'a>(
        (name, title, time_unit): (&str, &str, &str),
        lagrangian: String,
        coordinates: impl Iterator<Item = (&'a str, &'a str, (f64, f64), (f64, f64))>,
        parameters: impl Iterator<Item = (&'a str, &'a str, &'a str, Range)>,
        constraints: BTreeMap<String, String>,
    ) -> Self {
        let pair = |(low, high): (f64, f64)| Some([Quantity(low), Quantity(high)]);
        let coordinate = |(name, unit, bounds, speeds): (&str, &str, _, _)| CoordinateDescription {
            name: name.to_string(),
            unit: unit.to_string(),
            periodic: unit == "rad",
            time_like: false,
            bounds: pair(bounds),
            velocity_bounds: pair(speeds),
        };
        let parameter = |(symbol, default, unit, range): (&str, &str, &str, Range)| {
            let (default, unit) = (Decimal(default.to_string()), unit.to_string());
            (
                symbol.to_string(),
                ParameterDescription { default, unit, range, learn: false, per: None, known: BTreeMap::new() },
            )
        };
        Self {
            name: name.to_string(),
            title: Some(title.to_string()),
            time_unit: Some(time_unit.to_string()),
            lagrangian: Some(lagrangian),
            dissipation: None,
            forces: BTreeMap::new(),
            inputs: BTreeMap::new(),
            marks: BTreeSet::new(),
            events: BTreeMap::new(),
            measured: BTreeMap::new(),
            coordinates: coordinates.map(coordinate).collect(),
            chain: None,
            links: Vec::new(),
            parameters: parameters.map(parameter).collect(),
            definitions: BTreeMap::new(),
            constraints,
            constraint_lines: ConstraintLines::default(),
            metric: None,
            training: BTreeMap::new(),
            validation: BTreeMap::new(),
            trajectory: TrajectoryDescription::default(),
            shell: None,
        }
    }
}

/// An error in a description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescriptionError {
    /// Path of the key, such as `metric.t,t`.
    pub key: String,
    /// The error, with its column if it is in a formula.
    pub problem: String,
}

impl core::fmt::Display for DescriptionError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { key, problem } = self;
        if key.is_empty() { f.write_str(problem) } else { write!(f, "{key}: {problem}") }
    }
}

impl core::error::Error for DescriptionError {}

impl DescriptionError {
    fn new(key: impl Into<String>, problem: impl core::fmt::Display) -> Self {
        Self { key: key.into(), problem: problem.to_string() }
    }
    fn formula(key: impl Into<String>) -> impl FnOnce(ExpressionError) -> Self {
        |error| Self::new(key, error)
    }
}

/// Line numbers of constraints in a file by their names. They are ignored when descriptions are compared.
#[derive(Clone, Debug, Default)]
pub struct ConstraintLines(pub BTreeMap<String, usize>);

impl PartialEq for ConstraintLines {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// A description with its compiled Lagrangian.
#[derive(Clone, Debug)]
pub struct Described {
    /// The description with its links expanded.
    pub description: Description,
    /// The description before expansion, if it has links.
    written: Option<Description>,
    /// Its Lagrangian, whose parameters are sorted by name. If the Lagrangian or the forces depend on the time, the time is a coordinate
    /// after the others, and inputs are coordinates after the time.
    pub lagrangian: ExpressionLagrangian,
    /// Its dissipation function, if it has one, with the parameters of the Lagrangian.
    pub dissipation: Option<ExpressionLagrangian>,
    /// Its forces, if it has any, with the parameters of the Lagrangian.
    pub(super) forces: Option<FormulaForces>,
    /// Its events, with the parameters of the Lagrangian.
    pub(super) events: Arc<[FormulaEvent]>,
    /// Its measured quantities, with the parameters of the Lagrangian.
    pub(super) readings: Arc<[FormulaReading]>,
    /// Its constraints, if it has any, with the parameters of the Lagrangian.
    pub constraints: Option<ExpressionConstraints>,
    /// `true` if the constraints are known to be independent, so that no check is needed.
    pub independent: bool,
    /// The chain of links, if the description contains nothing else.
    pub(super) chain: Option<Arc<Shape>>,
    /// The velocity of the time-like coordinate on the mass shell.
    shell: Option<Formula>,
    /// Region of the training states, if they do not fill their bounds.
    pub around_centre: Option<ShellAdvice>,
}

impl Described {
    /// Returns `true` if the Lagrangian or forces depend on the time or on inputs.
    pub fn is_timed(&self) -> bool {
        Lagrangian::coordinates(&self.lagrangian) > self.description.coordinates.len()
    }

    /// Returns `true` if the description was written as a chain of links.
    pub fn is_chain(&self) -> bool {
        self.written.is_some()
    }

    /// Number of links in the original description.
    pub(crate) fn links(&self) -> usize {
        self.written.as_ref().map_or(0, |written| written.links.len())
    }

    /// Returns its links for display.
    pub(crate) fn shown_links(&self) -> Vec<ShownLink<'_>> {
        let names: Vec<&str> = self.description.coordinates.iter().map(|c| c.name.as_str()).collect();
        self.written.as_ref().map_or_else(Vec::new, |written| written.shown_links(&names))
    }

    /// Returns the original description with other values of parameters, by name.
    pub fn with_defaults(&self, values: &[(&str, f64)]) -> Description {
        let plain = self.description.with_defaults(values);
        match &self.written {
            Some(written) => Description { parameters: plain.parameters, ..written.clone() },
            None => plain,
        }
    }

    /// Returns the velocity of the time-like coordinate that puts a state on the mass shell `g(v, v) = -1`, pointing to the future; its
    /// element of `v` is ignored. Returns `None` for a system without mass shell.
    pub fn constrained_velocity<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Option<R> {
        self.shell.as_ref().map(|shell| shell.evaluate(parameters, q, v))
    }
}

fn one() -> String {
    "1".to_string()
}

fn is_false(x: &bool) -> bool {
    !x
}
