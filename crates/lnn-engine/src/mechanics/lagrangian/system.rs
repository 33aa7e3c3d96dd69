//! Facts about a hand-written system apart from its Lagrangian.

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
    /// Name, also of its CSV column; the velocity's column is the name and `_dot`.
    pub name: Cow<'static, str>,
    /// Unit of the coordinate; velocities are in this unit per [`System::time_unit`].
    pub unit: Cow<'static, str>,
    /// An angle: adding `2 pi` changes nothing.
    pub periodic: bool,
}

impl Coordinate {
    /// A periodic angle in radians.
    pub(crate) fn angle(name: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), unit: Cow::Borrowed("rad"), periodic: true }
    }
    /// A length in metres.
    pub(crate) fn length(name: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), unit: Cow::Borrowed("m"), periodic: false }
    }
}

/// A physical constant of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The paper's symbol.
    pub symbol: Cow<'static, str>,
    /// Default as decimal text, read in the working precision.
    pub default: Cow<'static, str>,
    /// Unit.
    pub unit: Cow<'static, str>,
    /// Allowed values.
    pub range: Range,
    /// `true` if its value is to be found by the training.
    pub learn: bool,
}

impl Parameter {
    /// A constant whose value is known.
    pub(crate) const fn new(symbol: &'static str, default: &'static str, unit: &'static str, range: Range) -> Self {
        let (symbol, default, unit) = (Cow::Borrowed(symbol), Cow::Borrowed(default), Cow::Borrowed(unit));
        Self { symbol, default, unit, range, learn: false }
    }
}

/// Number of coordinates of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Always the same.
    Fixed(usize),
    /// Chosen by an integer parameter.
    Chosen {
        /// Symbol of the parameter.
        symbol: &'static str,
        /// Its default.
        default: usize,
        /// Smallest value.
        least: usize,
        /// Largest value.
        most: usize,
        /// The arrangement of that many parts: along a line or in a net.
        layout: Layout,
    },
}

/// How many coordinates a chosen integer gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// A line: as many.
    Line,
    /// A square net of points in space, the integer along each side: three times its square.
    Net,
}

impl Layout {
    /// Coordinates of the chosen integer.
    const fn coordinates(self, chosen: usize) -> usize {
        match self {
            Self::Line => chosen,
            Self::Net => 3 * chosen * chosen,
        }
    }
    /// The integer that gives this number of coordinates.
    pub const fn chosen(self, coordinates: usize) -> usize {
        match self {
            Self::Line => coordinates,
            Self::Net => (coordinates / 3).isqrt(),
        }
    }
}

impl Size {
    /// The number of coordinates unless chosen otherwise.
    pub const fn default(self) -> usize {
        match self {
            Self::Fixed(n) => n,
            Self::Chosen { default, layout, .. } => layout.coordinates(default),
        }
    }
    /// The number of coordinates if this integer, which is within the bounds, is chosen.
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
    /// Of the coordinates.
    pub positions: Vec<(f64, f64)>,
    /// Of the velocities.
    pub velocities: Vec<(f64, f64)>,
}

impl Bounds {
    /// The same bounds for each of `n` coordinates.
    pub fn uniform(n: usize, position: (f64, f64), velocity: (f64, f64)) -> Self {
        Self { positions: vec![position; n], velocities: vec![velocity; n] }
    }
}

/// The paper's trajectory test of a system.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryTest {
    /// Box of the random starts.
    pub start: Bounds,
    /// End of the time span that starts at 0, in [`System::time_unit`].
    pub t_end: f64,
    /// Step of the output, in [`System::time_unit`].
    pub dt: f64,
}

/// Rejects coordinates outside a chart, given the parameters, with the violated condition.
pub(crate) type Domain = fn(parameters: &[f64], q: &[f64]) -> Result<(), &'static str>;

/// A plane in which a picture shows the position of a system in space, rather than its coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Labels of the horizontal and the vertical axis, with units.
    pub labels: [&'static str; 2],
    /// `(x, y)` from the values of [`System::parameters`] and `n` coordinates. Finite wherever both are finite and the
    /// result fits the number type; `NaN` for a wrong number of parameters. A point of a body of fixed size stays within
    /// that size: `x^2 + y^2 <= (sum of the rods)^2` for a chain of pendula, `R^2` on a sphere.
    pub point: fn(parameters: &[f64], q: &[f64]) -> (f64, f64),
}

/// Components of a vector at a state, given the parameters.
pub type Vector = fn(parameters: &[f64], q: &[f64], v: &[f64]) -> Vec<f64>;

/// Quantity that exact motion conserves besides its energy.
#[derive(Clone, Copy, Debug)]
pub struct Conserved {
    /// Name, with unit.
    pub name: &'static str,
    /// Components of the conserved vector at a state, from the values of [`System::parameters`]; never all zero on a
    /// motion of interest. `NaN` for a wrong number of parameters.
    pub vector: Vector,
}

/// Property that depends on the number of coordinates of a system.
#[derive(Clone, Debug)]
pub(crate) enum PerSize<T> {
    /// A rule for any number of coordinates.
    Rule(fn(usize) -> T),
    /// The value for the system's fixed number of coordinates.
    Given(T),
}

impl<T: Clone> PerSize<T> {
    /// For `n` coordinates.
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
    /// States to learn from, where the box of the training states alone does not do.
    pub states: Option<fn(bounds: &mut Bounds) -> StateAdvice>,
    /// The paper's budget, if the system is one of the paper's.
    pub paper: Option<PaperBudget>,
    /// Learning rate of a structure, if the default is not good.
    pub structure_rate: Option<f64>,
}

impl LearningAdvice {
    /// No advice: the box of the training states is suitable, and the paper does not cover the system.
    pub const NONE: Self = Self { states: None, paper: None, structure_rate: None };
}

/// Choices that go with the bounds of the training states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateAdvice {
    /// Coordinates for which half of the values are drawn uniform in their logarithm; empty for none.
    pub log_uniform: Vec<bool>,
    /// Accelerations above this multiple of the mean have relative residuals; 0 for none.
    pub acceleration_weighting: f64,
    /// Share of the states that lie along motions of the trajectory test.
    pub trajectory_fraction: f64,
    /// Shell around a centre whose states are drawn instead of those of a box.
    pub shell: Option<ShellAdvice>,
}

/// The paper's budget for a system.
#[derive(Clone, Copy, Debug)]
pub struct PaperBudget {
    /// Training states.
    pub states: usize,
    /// Widths of the hidden layers.
    pub hidden: &'static [usize],
    /// Phases of the schedule.
    pub phases: &'static [PaperPhase],
}

/// A phase of the paper's schedule.
#[derive(Clone, Copy, Debug)]
pub struct PaperPhase {
    /// Epochs.
    pub epochs: usize,
    /// Learning rate at the start.
    pub rate: f64,
    /// Lowest learning rate.
    pub lowest_rate: f64,
    /// Bounds of all positions, if they differ from the box of the training states.
    pub positions: Option<(f64, f64)>,
}

impl PaperPhase {
    /// A phase over the box of the training states.
    pub const fn new(epochs: usize, rate: f64, lowest_rate: f64) -> Self {
        Self { epochs, rate, lowest_rate, positions: None }
    }
}

/// Knowledge about a system: an entry of the catalogue, or a
/// user's [description](super::Description).
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
    /// Constants, in the order the Lagrangian takes them; [`Size::Chosen`] adds one more.
    pub parameters: Cow<'static, [Parameter]>,
    /// Unit of the evolution parameter: `s`, or `m` for proper time in geometric units (`G = c = 1`, where times and
    /// masses are lengths).
    pub time_unit: Cow<'static, str>,
    /// The coordinate that is a time (Lorentzian systems).
    pub time_like: Option<usize>,
    /// The mass shell `g(v, v) = -1` solved for the velocity of the time-like coordinate, in words of the columns;
    /// [`ClosedForm::constrained_velocity`] is the formula.
    pub constraint: Option<&'static str>,
    /// Box of the training states.
    pub(crate) training: PerSize<Bounds>,
    /// Box of the states on which errors are stated.
    pub(crate) validation: PerSize<Bounds>,
    /// Trajectory test.
    pub(crate) trajectory: PerSize<TrajectoryTest>,
    /// Domain of the coordinates; the error states the condition.
    pub(crate) domain: Option<Domain>,
    /// Its position in a plane; `None` for systems of one coordinate, where a plot over time suffices.
    #[doc(hidden)]
    pub plane: Option<Plane>,
    /// Quantity that is conserved besides the energy, if there is one.
    #[doc(hidden)]
    pub conserved: Option<Conserved>,
    /// Advice on learning it.
    #[doc(hidden)]
    pub learning: LearningAdvice,
    /// The description with its Lagrangian, for a system that is not in the catalogue.
    #[doc(hidden)]
    pub described: Option<Arc<Described>>,
}

impl System {
    /// The description that the system was made from; none for a system of the catalogue.
    pub fn description(&self) -> Option<&Description> {
        self.described.as_deref().map(|described| &described.description)
    }
    /// The original description, with other values of parameters, by name; none for a system of the catalogue.
    pub fn with_defaults(&self, values: &[(&str, f64)]) -> Option<Description> {
        self.described.as_deref().map(|described| described.with_defaults(values))
    }
    /// `true` for links, a chain or a tree.
    pub fn is_chain(&self) -> bool {
        self.described.as_ref().is_some_and(|described| described.is_chain())
    }
    /// Its links as one can show them.
    #[doc(hidden)]
    pub fn shown_links(&self) -> Vec<ShownLink<'_>> {
        self.described.as_ref().map_or_else(Vec::new, |described| described.shown_links())
    }
    /// Number of its links.
    pub fn links(&self) -> usize {
        self.described.as_ref().map_or(0, |described| described.links())
    }
    /// Coordinates, in order, of the system of `n` coordinates.
    pub fn coordinates(&self, n: usize) -> Vec<Coordinate> {
        self.coordinates.of(n)
    }
    /// Box of the training states of `n` coordinates.
    pub fn training(&self, n: usize) -> Bounds {
        self.training.of(n)
    }
    /// Box of the states of `n` coordinates on which errors are stated.
    pub fn validation(&self, n: usize) -> Bounds {
        self.validation.of(n)
    }
    /// Trajectory test of `n` coordinates.
    pub fn trajectory(&self, n: usize) -> TrajectoryTest {
        self.trajectory.of(n)
    }
    /// Names of the columns of a state of `n` coordinates: coordinates, then velocities (`theta1_dot`).
    pub fn columns(&self, n: usize) -> Vec<String> {
        let coordinates = self.coordinates(n);
        let positions = coordinates.iter().map(|c| c.name.to_string());
        positions.chain(coordinates.iter().map(|c| format!("{}_dot", c.name))).collect()
    }
    /// These columns with their units (`theta1_dot [rad/s]`), as labels of axes.
    pub fn labels(&self, n: usize) -> Vec<String> {
        self.columns(n).iter().zip(self.units(n)).map(|(column, unit)| format!("{column} [{unit}]")).collect()
    }
    /// Units of these columns (`rad`, `rad/s`).
    pub fn units(&self, n: usize) -> Vec<String> {
        let coordinates = self.coordinates(n);
        let positions = coordinates.iter().map(|c| c.unit.to_string());
        let rate =
            |unit: &str| if self.time_unit == "1" { unit.to_string() } else { format!("{unit}/{}", self.time_unit) };
        positions.chain(coordinates.iter().map(|c| rate(&c.unit))).collect()
    }
}

/// A Lagrangian with a closed-form acceleration to compare with.
pub trait ClosedForm: Lagrangian {
    /// `a(q, v)`, written down without differentiating the Lagrangian.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R>;

    /// The velocity of the time-like coordinate that puts a state on the mass shell `g(v, v) = -1`, pointing to the
    /// future; whatever `v` holds in its place is not read. `None` for a system without constraint.
    fn constrained_velocity<R: Real>(&self, _parameters: &[R], _q: &[R], _v: &[R]) -> Option<R> {
        None
    }
}

/// Values a parameter may take, besides being finite.
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
    /// The condition in words.
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
    /// Lowest and highest distance from it.
    pub radius: (f64, f64),
    /// Largest rapidity in a local frame.
    pub rapidity: f64,
}
