//! Facts about a hand-written system apart from its Lagrangian.

use super::Lagrangian;
use crate::scalar::Real;
use std::borrow::Cow;

/// A coordinate of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Coordinate {
    /// Name, also of its CSV column; the velocity's column is the name and `_dot`.
    pub name: Cow<'static, str>,
    /// Unit of the coordinate; velocities are in this unit per [`System::time_unit`].
    pub unit: &'static str,
    /// An angle: adding `2 pi` changes nothing.
    pub periodic: bool,
}

impl Coordinate {
    /// A periodic angle in radians.
    pub fn angle(name: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), unit: "rad", periodic: true }
    }
    /// A length in metres.
    pub fn length(name: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), unit: "m", periodic: false }
    }
}

/// Values a parameter may take, besides being finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Zero or more.
    AtLeastZero,
    /// More than zero.
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

/// A physical constant of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The paper's symbol.
    pub symbol: &'static str,
    /// Default as decimal text, read in the working precision.
    pub default: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Allowed values.
    pub range: Range,
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
    },
}

impl Size {
    /// The number of coordinates unless chosen otherwise.
    pub const fn default(self) -> usize {
        match self {
            Self::Fixed(n) => n,
            Self::Chosen { default, .. } => default,
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
    /// The same for each of `n` coordinates.
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

/// Refuses coordinates outside a chart, given the parameters, with what is demanded of them.
pub type Domain = fn(parameters: &[f64], q: &[f64]) -> Result<(), &'static str>;

/// A plane in which a picture shows where a system is, in space rather than over its coordinates.
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

/// Quantity that exact motion conserves beside its energy.
#[derive(Clone, Copy, Debug)]
pub struct Conserved {
    /// Name, with unit.
    pub name: &'static str,
    /// Components of the conserved vector at a state, from the values of [`System::parameters`]; never all zero on a
    /// motion of interest. `NaN` for a wrong number of parameters.
    pub vector: Vector,
}

/// Catalogue entry of a system; functions take the number of coordinates.
#[derive(Clone, Copy, Debug)]
pub struct System {
    /// Name on the command line.
    pub name: &'static str,
    /// Name in a title.
    pub title: &'static str,
    /// Number of coordinates.
    pub size: Size,
    /// Coordinates, in order.
    pub coordinates: fn(usize) -> Vec<Coordinate>,
    /// Constants, in the order the Lagrangian takes them; [`Size::Chosen`] adds one more.
    pub parameters: &'static [Parameter],
    /// Unit of the evolution parameter: `s`, or `m` for proper time in geometric units (`G = c = 1`, where times and
    /// masses are lengths).
    pub time_unit: &'static str,
    /// The coordinate that is a time (Lorentzian systems).
    pub time_like: Option<usize>,
    /// The mass shell `g(v, v) = -1` solved for the velocity of the time-like coordinate, in words of the columns;
    /// [`Closed::constrained_velocity`] is the formula.
    pub constraint: Option<&'static str>,
    /// Box of the training states.
    pub training: fn(usize) -> Bounds,
    /// Box of the states on which errors are stated.
    pub validation: fn(usize) -> Bounds,
    /// Trajectory test.
    pub trajectory: fn(usize) -> TrajectoryTest,
    /// Where the coordinates make sense; the error says what is demanded.
    pub domain: Option<Domain>,
    /// Where it is in a plane; `None` for systems of one coordinate, whose coordinate over time says all.
    pub plane: Option<Plane>,
    /// Quantity that is conserved beside the energy, if there is one.
    pub conserved: Option<Conserved>,
}

impl System {
    /// Names of the columns of a state of `n` coordinates: coordinates, then velocities (`theta1_dot`).
    pub fn columns(&self, n: usize) -> Vec<String> {
        let coordinates = (self.coordinates)(n);
        let positions = coordinates.iter().map(|c| c.name.to_string());
        positions.chain(coordinates.iter().map(|c| format!("{}_dot", c.name))).collect()
    }
    /// The same columns with their units (`theta1_dot [rad/s]`): labels of axes.
    pub fn labels(&self, n: usize) -> Vec<String> {
        self.columns(n).iter().zip(self.units(n)).map(|(column, unit)| format!("{column} [{unit}]")).collect()
    }
    /// Units of the same columns (`rad`, `rad/s`).
    pub fn units(&self, n: usize) -> Vec<String> {
        let coordinates = (self.coordinates)(n);
        let positions = coordinates.iter().map(|c| c.unit.to_string());
        positions.chain(coordinates.iter().map(|c| format!("{}/{}", c.unit, self.time_unit))).collect()
    }
}

/// A Lagrangian with a closed-form acceleration to compare with.
pub trait Closed: Lagrangian {
    /// `a(q, v)`, written down without differentiating the Lagrangian.
    fn acceleration<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> Vec<R>;

    /// The velocity of the time-like coordinate that puts a state on the mass shell `g(v, v) = -1`, pointing to the
    /// future; whatever `v` holds in its place is not read. `None` for a system without constraint.
    fn constrained_velocity<R: Real>(&self, _parameters: &[R], _q: &[R], _v: &[R]) -> Option<R> {
        None
    }
}
