//! Properties of a hand-written system apart from its Lagrangian.

use super::Lagrangian;
use super::description::ShownLink;
use super::description::{Described, Description};
use crate::scalar::Real;
use alloc::borrow::Cow;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// A coordinate of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Coordinate {
    /// Name, also of its CSV column; the velocity's column adds `_dot`.
    pub name: Cow<'static, str>,
    /// Unit of the coordinate; velocities are in this unit per [`System::time_unit`].
    pub unit: Cow<'static, str>,
    /// `true` for an angle, for which values that differ by `2 pi` are equal.
    pub periodic: bool,
}

impl Coordinate {
    /// Returns a periodic angle in radians.
    pub(crate) fn angle(name: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), unit: Cow::Borrowed("rad"), periodic: true }
    }
    /// Returns a length in metres.
    pub(crate) fn length(name: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), unit: Cow::Borrowed("m"), periodic: false }
    }
}

/// A physical constant of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Symbol as in the paper.
    pub symbol: Cow<'static, str>,
    /// Default value as decimal text, which is parsed in the working precision.
    pub default: Cow<'static, str>,
    /// Unit.
    pub unit: Cow<'static, str>,
    /// Allowed values.
    pub range: Range,
    /// `true` if training determines its value.
    pub learn: bool,
}

impl Parameter {
    /// Returns a constant whose value is known.
    pub(crate) const fn new(symbol: &'static str, default: &'static str, unit: &'static str, range: Range) -> Self {
        let (symbol, default, unit) = (Cow::Borrowed(symbol), Cow::Borrowed(default), Cow::Borrowed(unit));
        Self { symbol, default, unit, range, learn: false }
    }
}

/// Number of coordinates of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// A fixed number.
    Fixed(usize),
    /// A number chosen by an integer parameter.
    Chosen {
        /// Symbol of the parameter.
        symbol: &'static str,
        /// Its default value.
        default: usize,
        /// Smallest value.
        least: usize,
        /// Largest value.
        most: usize,
        /// The arrangement of the parts: in a line or in a net.
        layout: Layout,
    },
}

/// How the number of coordinates follows from the chosen integer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// In a line: the integer itself.
    Line,
    /// In a square net of points in space with this many points per side: three times the square of the integer.
    Net,
}

impl Layout {
    /// Returns the number of coordinates for the chosen integer.
    const fn coordinates(self, chosen: usize) -> usize {
        match self {
            Self::Line => chosen,
            Self::Net => 3 * chosen * chosen,
        }
    }
    /// Returns the integer that gives this number of coordinates.
    pub const fn chosen(self, coordinates: usize) -> usize {
        match self {
            Self::Line => coordinates,
            Self::Net => (coordinates / 3).isqrt(),
        }
    }
}

impl Size {
    /// Returns the default number of coordinates.
    pub const fn default(self) -> usize {
        match self {
            Self::Fixed(n) => n,
            Self::Chosen { default, layout, .. } => layout.coordinates(default),
        }
    }
    /// Returns the number of coordinates for this integer, which must be within the bounds.
    pub const fn coordinates(self, chosen: usize) -> usize {
        match self {
            Self::Fixed(n) => n,
            Self::Chosen { layout, .. } => layout.coordinates(chosen),
        }
    }
}

/// A box of states: `(low, high)` per coordinate, in the system's units.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// Bounds of the coordinates.
    pub positions: Vec<(f64, f64)>,
    /// Bounds of the velocities.
    pub velocities: Vec<(f64, f64)>,
}

impl Bounds {
    /// Returns the same bounds for each of `n` coordinates.
    pub fn uniform(n: usize, position: (f64, f64), velocity: (f64, f64)) -> Self {
        Self { positions: vec![position; n], velocities: vec![velocity; n] }
    }
}

/// The trajectory test of a system, as in the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryTest {
    /// Box of the random initial states.
    pub start: Bounds,
    /// End of the time span, which starts at 0, in [`System::time_unit`].
    pub t_end: f64,
    /// Output step, in [`System::time_unit`].
    pub dt: f64,
}

/// Checks that coordinates are inside the chart, given the parameters; the error states the violated condition.
pub(crate) type Domain = fn(parameters: &[f64], q: &[f64]) -> Result<(), &'static str>;

/// A plane in which plots show the position of a system in space instead of its coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Labels of the horizontal and the vertical axis, with units.
    pub labels: [&'static str; 2],
    /// Computes `(x, y)` from the values of [`System::parameters`] and `n` coordinates. The result is finite if the arguments are finite
    /// and it fits the number type; it is `NaN` for a wrong number of parameters. Points of a body of fixed size stay within that size:
    /// `x^2 + y^2 <= (sum of the rods)^2` for a chain of pendula, `R^2` on a sphere.
    pub point: fn(parameters: &[f64], q: &[f64]) -> (f64, f64),
}

/// Computes the components of a vector at a state, given the parameters.
pub type Vector = fn(parameters: &[f64], q: &[f64], v: &[f64]) -> Vec<f64>;

/// A quantity besides the energy that exact motion conserves.
#[derive(Clone, Copy, Debug)]
pub struct Conserved {
    /// Name, with unit.
    pub name: &'static str,
    /// Computes the components of the conserved vector at a state from the values of [`System::parameters`]. They are never all zero for a
    /// motion of interest, and `NaN` for a wrong number of parameters.
    pub vector: Vector,
}

/// A property that depends on the number of coordinates of a system.
#[derive(Clone, Debug)]
pub(crate) enum PerSize<T> {
    /// A rule for any number of coordinates.
    Rule(fn(usize) -> T),
    /// The value for the system's fixed number of coordinates.
    Given(T),
}

impl<T: Clone> PerSize<T> {
    /// Returns the property for `n` coordinates.
    fn of(&self, n: usize) -> T {
        match self {
            Self::Rule(rule) => rule(n),
            Self::Given(value) => value.clone(),
        }
    }
}

/// Advice on learning a system from states with their accelerations.
#[derive(Clone, Copy, Debug, Default)]
pub struct LearningAdvice {
    /// Training states, if the box of the training states is not suitable.
    pub states: Option<fn(bounds: &mut Bounds) -> StateAdvice>,
    /// The budget in the paper, if the paper covers the system.
    pub paper: Option<PaperBudget>,
    /// Learning rate for structured networks, if the default is not suitable.
    pub structure_rate: Option<f64>,
}

impl LearningAdvice {
    /// No advice: the box of the training states is suitable, and the paper does not cover the system.
    pub const NONE: Self = Self { states: None, paper: None, structure_rate: None };
}

/// Settings that belong to the bounds of the training states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateAdvice {
    /// Coordinates for which half of the values are drawn uniformly in their logarithm; may be empty.
    pub log_uniform: Vec<bool>,
    /// Accelerations above this multiple of the mean are weighted by relative residuals; 0 disables this.
    pub acceleration_weighting: f64,
    /// Fraction of the states that lie along motions of the trajectory test.
    pub trajectory_fraction: f64,
    /// Shell around a centre from which states are drawn instead of a box.
    pub shell: Option<ShellAdvice>,
}

/// The training budget of the paper for a system.
#[derive(Clone, Copy, Debug)]
pub struct PaperBudget {
    /// Training states.
    pub states: usize,
    /// Widths of the hidden layers.
    pub hidden: &'static [usize],
    /// Phases of the training schedule.
    pub phases: &'static [PaperPhase],
}

/// A phase of the training schedule.
#[derive(Clone, Copy, Debug)]
pub struct PaperPhase {
    /// Epochs.
    pub epochs: usize,
    /// Initial learning rate.
    pub rate: f64,
    /// Lowest learning rate.
    pub lowest_rate: f64,
    /// Bounds of all positions, if they differ from the box of the training states.
    pub positions: Option<(f64, f64)>,
}

impl PaperPhase {
    /// Returns a phase whose positions are those of the training states.
    pub const fn new(epochs: usize, rate: f64, lowest_rate: f64) -> Self {
        Self { epochs, rate, lowest_rate, positions: None }
    }
}

/// Properties of a system, either from the catalogue or from a user's [description](super::Description).
#[derive(Clone, Debug)]
pub struct System {
    /// Name on the command line.
    pub name: Cow<'static, str>,
    /// Name in a title.
    pub title: Cow<'static, str>,
    /// Number of coordinates.
    pub size: Size,
    /// Coordinates, in order.
    pub(crate) coordinates: PerSize<Vec<Coordinate>>,
    /// Constants, in the order of the Lagrangian's parameters; [`Size::Chosen`] adds one more.
    pub parameters: Cow<'static, [Parameter]>,
    /// Unit of the evolution parameter: `s`, or `m` for proper time in geometric units (`G = c = 1`, where times and
    /// masses are lengths).
    pub time_unit: Cow<'static, str>,
    /// The time-like coordinate of a Lorentzian system.
    pub time_like: Option<usize>,
    /// The mass shell `g(v, v) = -1` solved for the velocity of the time-like coordinate, as text with the names of the columns;
    /// [`ClosedForm::constrained_velocity`] computes it.
    pub constraint: Option<&'static str>,
    /// Box of the training states.
    pub(crate) training: PerSize<Bounds>,
    /// Box of the states at which errors are reported.
    pub(crate) validation: PerSize<Bounds>,
    /// Trajectory test.
    pub(crate) trajectory: PerSize<TrajectoryTest>,
    /// Checks the domain of the coordinates; the error states the condition.
    pub(crate) domain: Option<Domain>,
    /// Position in a plane; `None` for systems of one coordinate, which are plotted over time.
    #[doc(hidden)]
    pub plane: Option<Plane>,
    /// Conserved quantity besides the energy, if there is one.
    #[doc(hidden)]
    pub conserved: Option<Conserved>,
    /// Advice on training.
    #[doc(hidden)]
    pub learning: LearningAdvice,
    /// The compiled description of a system that is not in the catalogue.
    #[doc(hidden)]
    pub described: Option<Arc<Described>>,
}

impl System {
    /// Returns the description of the system; `None` for a system of the catalogue.
    pub fn description(&self) -> Option<&Description> {
        self.described.as_deref().map(|described| &described.description)
    }
    /// Returns the original description with other values of parameters, by name; `None` for a system of the catalogue.
    pub fn with_defaults(&self, values: &[(&str, f64)]) -> Option<Description> {
        self.described.as_deref().map(|described| described.with_defaults(values))
    }
    /// Returns `true` if the system was written as links, in a chain or a tree.
    pub fn is_chain(&self) -> bool {
        self.described.as_ref().is_some_and(|described| described.is_chain())
    }
    /// Returns its links for display.
    #[doc(hidden)]
    pub fn shown_links(&self) -> Vec<ShownLink<'_>> {
        self.described.as_ref().map_or_else(Vec::new, |described| described.shown_links())
    }
    /// Returns the number of its links.
    pub fn links(&self) -> usize {
        self.described.as_ref().map_or(0, |described| described.links())
    }
    /// Returns the coordinates, in order, of the system of `n` coordinates.
    pub fn coordinates(&self, n: usize) -> Vec<Coordinate> {
        self.coordinates.of(n)
    }
    /// Returns the box of the training states of `n` coordinates.
    pub fn training(&self, n: usize) -> Bounds {
        self.training.of(n)
    }
    /// Returns the box of the states of `n` coordinates at which errors are reported.
    pub fn validation(&self, n: usize) -> Bounds {
        self.validation.of(n)
    }
    /// Returns the trajectory test of `n` coordinates.
    pub fn trajectory(&self, n: usize) -> TrajectoryTest {
        self.trajectory.of(n)
    }
    /// Returns the column names of a state of `n` coordinates: coordinates, then velocities (`theta1_dot`).
    pub fn columns(&self, n: usize) -> Vec<String> {
        let coordinates = self.coordinates(n);
        let positions = coordinates.iter().map(|c| c.name.to_string());
        positions.chain(coordinates.iter().map(|c| format!("{}_dot", c.name))).collect()
    }
    /// Returns the column names with units (`theta1_dot [rad/s]`) as labels of axes.
    pub fn labels(&self, n: usize) -> Vec<String> {
        self.columns(n).iter().zip(self.units(n)).map(|(column, unit)| format!("{column} [{unit}]")).collect()
    }
    /// Returns the units of these columns (`rad`, `rad/s`).
    pub fn units(&self, n: usize) -> Vec<String> {
        let coordinates = self.coordinates(n);
        let positions = coordinates.iter().map(|c| c.unit.to_string());
        let rate =
            |unit: &str| if self.time_unit == "1" { unit.to_string() } else { format!("{unit}/{}", self.time_unit) };
        positions.chain(coordinates.iter().map(|c| rate(&c.unit))).collect()
    }
}

/// A Lagrangian with a closed-form acceleration for comparison.
pub trait ClosedForm: Lagrangian {
    /// Computes `a(q, v)` from a formula, without differentiating the Lagrangian.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R>;

    /// Computes the velocity of the time-like coordinate that puts a state on the mass shell `g(v, v) = -1`, pointing to the future; its
    /// element of `v` is ignored. Returns `None` for a system without constraint.
    fn constrained_velocity<R: Real>(&self, _parameters: &[R], _q: &[R], _v: &[R]) -> Option<R> {
        None
    }
}

/// Allowed values of a parameter, which must also be finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub enum Range {
    /// Any finite number.
    #[default]
    #[cfg_attr(feature = "serde", serde(rename = "any"))]
    Any,
    /// Zero or more.
    #[cfg_attr(feature = "serde", serde(rename = "at least 0"))]
    AtLeastZero,
    /// More than zero.
    #[cfg_attr(feature = "serde", serde(rename = "positive"))]
    Positive,
}

impl Range {
    /// Returns the condition in words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Any => "finite",
            Self::AtLeastZero => "finite and at least 0",
            Self::Positive => "finite and above 0",
        }
    }
}

/// Shell around a centre, and the largest speed of motion in it.
#[derive(Clone, Debug, PartialEq)]
pub struct ShellAdvice {
    /// Cartesian coordinates around the centre.
    pub coordinates: Cow<'static, [usize]>,
    /// Smallest and largest distance from the centre.
    pub radius: (f64, f64),
    /// Largest rapidity in a local frame.
    pub rapidity: f64,
}
