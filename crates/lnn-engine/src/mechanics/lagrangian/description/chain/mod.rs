//! Links in a system file, a chain or a tree: converts the geometry of their joints to coordinates, parameters and formulas.
//!
//! Let `w` be the angular velocity of a link in its own frame, `v` the velocity of that frame's origin, `g` the acceleration of gravity and
//! `r` the position of the origin in the base. A rigid link of mass `m`, first moments `h = m c` and inertia `I` about the origin then has
//!
//! `L = m v^2/2 + h.(v x w) + w.I w/2 + m g.r + h.g`,
//!
//! which is linear in its ten constants. From one link to the next, a revolute joint gives `w' = R^T w + q_dot z` and `v' = R^T (v + w x
//! p)` (Featherstone, "Rigid Body Dynamics Algorithms", 2008).

mod formulas;
mod joints;
#[cfg(test)]
mod tests;

#[cfg(feature = "serde")]
use super::read;
use super::{CoordinateDescription, Description, DescriptionError, ParameterDescription, Quantity, is_false};
use crate::lagrangian::recursion::{Joint, Row, Shape};
use crate::lagrangian::thresholds::{COULOMB_SPEED, MOST_LINKS};
use crate::names::unknown;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::f64::consts::PI;
use formulas::{Base, Term, formula};
use joints::triple;
pub use joints::turned;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Defaults: acceleration of gravity in m/s^2, and speed at which dry friction reaches three quarters of its maximum.
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];
/// Default bounds of coordinates that the file does not describe: positions in m, and velocities in rad/s or m/s.
const BOUNDS: (f64, f64) = (1.0, 3.0);

/// Settings shared by all links.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct ChainDescription {
    /// Convention of the Denavit-Hartenberg rows.
    #[cfg_attr(feature = "serde", serde(default))]
    convention: Convention,
    /// Acceleration of gravity in the frame of the base, in m/s^2; by default `[0, 0, -9.81]`.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    gravity: Option<Vec<Quantity>>,
    /// `true` if every joint has viscous and dry friction.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    friction: bool,
    /// Speed `s` of dry friction `Fc tanh(q_dot/s)`, in rad/s or m/s; by default 0.01.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    coulomb_speed: Option<Quantity>,
    /// `true` if every drive has inertia.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    armature: bool,
}

/// Position of a link's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
enum Convention {
    /// On the axis of its own joint: `Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d)` (Craig, Khalil).
    #[default]
    Modified,
    /// On the axis of the next joint: `Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha)` (Denavit, Paul, Spong).
    Standard,
}

/// A link and the joint that moves it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct LinkDescription {
    /// Length in m.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    a: Quantity,
    /// Twist in rad.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    alpha: Quantity,
    /// Offset along the joint in m; a prismatic joint adds its coordinate.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    d: Quantity,
    /// Angle about the joint in rad; a revolute joint adds its coordinate.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    theta: Quantity,
    /// `true` if the joint is prismatic.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    prismatic: bool,
    /// Name, by which other links refer to it.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    name: Option<String>,
    /// Name or number of the link that carries it, 0 for the base; by default the previous link.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "read::reference")
    )]
    parent: Option<String>,
    /// Position of its origin in the frame of that link, in m.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    xyz: Option<Vec<Quantity>>,
    /// Rotations of its frame about the fixed axes x, y and z of that link's frame, in this order, in rad.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    rpy: Option<Vec<Quantity>>,
    /// Direction of the joint axis in its own frame; by default z.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    axis: Option<Vec<Quantity>>,
    /// Name or number of the link whose coordinate also moves this joint: by `ratio` times the coordinate plus an offset.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "read::reference")
    )]
    mimic: Option<String>,
    /// Motion of the joint per unit of that coordinate; by default 1.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    ratio: Option<Quantity>,
    /// Position of the joint when that coordinate is zero, in rad or m.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    offset: Option<Quantity>,
}

fn nothing() -> Quantity {
    Quantity(0.0)
}

fn is_nothing(x: &Quantity) -> bool {
    x.0 == 0.0
}

/// A link and its joint, for display.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(Serialize))]
pub struct ShownLink<'a> {
    /// Its name, if it has one.
    pub name: Option<&'a str>,
    /// Number of the link that carries it, 0 for the base.
    pub parent: usize,
    /// `true` if its joint is prismatic.
    pub prismatic: bool,
    /// The coordinate that moves it.
    pub coordinate: &'a str,
    /// Motion of the joint per unit of the coordinate.
    pub ratio: f64,
}

/// Returns the symbols of the ten constants of a link, counted from 1: its mass, first moments and inertia about the origin of its frame.
pub fn inertia_symbols(link: usize) -> [String; 10] {
    ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"].map(|what| format!("{what}{link}"))
}

/// Returns the symbols of the non-negative constants of a joint, counted from 1: the inertia of its drive, viscous and dry friction.
pub fn loss_symbols(link: usize) -> [String; 3] {
    ["Ia", "Fv", "Fc"].map(|what| format!("{what}{link}"))
}

impl Description {
    /// Returns the chain of links if the description contains nothing else; constants are referred to by their index in `parameters`.
    pub(super) fn shape(&self, parameters: &BTreeMap<String, ParameterDescription>) -> Option<Shape> {
        let beside = [&self.lagrangian, &self.dissipation].into_iter().flatten().next().is_some();
        if self.links.is_empty() || beside || !self.constraints.is_empty() {
            return None;
        }
        let chain = self.chain.clone().unwrap_or_default();
        let place = |name: &String| parameters.keys().position(|known| known == name);
        let joints = self.joints().ok()?;
        let row = |(k, joint): (usize, &Joint)| {
            let [armature, viscous, dry] = loss_symbols(k + 1);
            let [m, hx, hy, hz, rest @ ..] = inertia_symbols(k + 1).each_ref().map(place);
            Some(Row {
                joint: *joint,
                inertia: [m?, hx?, hy?, hz?, rest[0]?, rest[1]?, rest[2]?, rest[3]?, rest[4]?, rest[5]?],
                armature: if chain.armature { Some(place(&armature)?) } else { None },
                friction: if chain.friction { Some([place(&viscous)?, place(&dry)?]) } else { None },
            })
        };
        let rows = joints.iter().enumerate().map(row).collect::<Option<_>>()?;
        let coordinates = self.links.iter().filter(|link| link.mimic.is_none()).count();
        let coulomb_speed = chain.coulomb_speed.map_or(COULOMB_SPEED, |speed| speed.0);
        Some(Shape {
            rows,
            coordinates,
            gravity: triple("chain.gravity", &chain.gravity, GRAVITY).ok()?,
            coulomb_speed,
        })
    }

    /// Returns the links for display, with these names of coordinates.
    pub(super) fn shown_links<'a>(&'a self, names: &[&'a str]) -> Vec<ShownLink<'a>> {
        let shown = |(link, joint): (&'a LinkDescription, Joint)| ShownLink {
            name: link.name.as_deref(),
            parent: joint.parent.map_or(0, |at| at + 1),
            prismatic: joint.slides,
            coordinate: names[joint.drive.0],
            ratio: joint.drive.1,
        };
        self.links.iter().zip(self.joints().unwrap_or_default()).map(shown).collect()
    }

    /// Returns the description with its links expanded; unchanged if they contain errors, which compilation reports.
    pub fn plain(&self) -> Self {
        self.unfolded().unwrap_or_else(|_| self.clone())
    }

    /// Largest number of links of a chain.
    pub const MOST_LINKS: usize = MOST_LINKS;

    /// Expands the links to coordinates, parameters and formulas.
    pub(super) fn unfolded(&self) -> Result<Self, DescriptionError> {
        let fault = |key: &str, problem: String| Err(DescriptionError::new(key, problem));
        let mut plain = Self { chain: None, links: Vec::new(), ..self.clone() };
        let count = self.links.len();
        match (&self.chain, count) {
            (None, 0) => return Ok(plain),
            (Some(_), 0) => return fault("chain", "expected tables [[links]] beside it".to_string()),
            (_, 1..=MOST_LINKS) => {}
            _ => return fault("links", format!("expected 1 to {MOST_LINKS} tables [[links]], found {count}")),
        }
        plain.parameters.clear();
        if self.metric.is_some() {
            return fault("metric", "expected `[[links]]` or `[metric]`, found both".to_string());
        }
        let joints = self.joints()?;
        let driven: Vec<&LinkDescription> = self.links.iter().filter(|link| link.mimic.is_none()).collect();
        if plain.coordinates.is_empty() {
            plain.coordinates = driven.iter().enumerate().map(|(k, link)| link.coordinate(k)).collect();
        }
        if plain.coordinates.len() != driven.len() {
            let (count, found) = (driven.len(), plain.coordinates.len());
            let problem = format!("expected {count} tables, one for each link without `mimic`, found {found}");
            return fault("coordinates", problem);
        }
        let chain = self.chain.clone().unwrap_or_default();
        let gravity = triple("chain.gravity", &chain.gravity, GRAVITY)?;
        let speed = chain.coulomb_speed.map_or(COULOMB_SPEED, |speed| speed.0);
        if !(speed.is_finite() && speed > 0.0) {
            return fault("chain.coulomb_speed", format!("expected a finite number above 0, found {speed}"));
        }
        let (mut sums, mut losses) = (Vec::new(), Vec::new());
        let mut bases = vec![Base::at_rest(gravity)];
        for (k, joint) in joints.iter().enumerate() {
            let (part, base) =
                plain.add_link((k + 1, joint), &bases[joint.parent.map_or(0, |at| at + 1)], chain.armature)?;
            sums.push(Term::name(part));
            bases.push(base);
            if chain.friction {
                losses.extend(plain.add_friction((k + 1, joint), speed)?);
            }
        }
        let whole = |own: Vec<Term>, more: &Option<String>| {
            let own = formula(&own);
            Some(more.as_ref().map_or(own.clone(), |more| format!("{own} + ({more})")))
        };
        plain.lagrangian = whole(sums, &self.lagrangian);
        if chain.friction {
            plain.dissipation = whole(losses, &self.dissipation);
        }
        // A constant in the file that neither a link nor a formula uses would be ignored silently, so it is rejected.
        let known = || plain.parameters.keys().map(String::as_str);
        let stray = |name: &&String| !plain.parameters.contains_key(*name) && !self.uses(name);
        if let Some(name) = self.parameters.keys().find(stray) {
            return fault(
                &format!("parameters.{name}"),
                unknown("constant of the links", name, known().collect::<Vec<_>>()),
            );
        }
        plain.parameters.extend(self.parameters.clone());
        Ok(plain)
    }

    /// Returns `true` if a formula of the file contains a name.
    fn uses(&self, name: &str) -> bool {
        let formulas = [&self.lagrangian, &self.dissipation].into_iter().flatten();
        let mut formulas = formulas.chain(self.definitions.values()).chain(self.constraints.values());
        formulas.any(|text| text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == name))
    }
}

impl LinkDescription {
    /// Returns `true` if its geometry is given by position and rotations, not by a Denavit-Hartenberg row.
    fn is_placed(&self) -> bool {
        self.xyz.is_some() || self.rpy.is_some() || self.axis.is_some()
    }

    /// Returns the default description of a coordinate.
    fn coordinate(&self, k: usize) -> CoordinateDescription {
        let pair = |size: f64| Some([Quantity(-size), Quantity(size)]);
        CoordinateDescription {
            name: format!("q{}", k + 1),
            unit: if self.prismatic { "m" } else { "rad" }.to_string(),
            periodic: !self.prismatic,
            time_like: false,
            bounds: pair(if self.prismatic { BOUNDS.0 } else { PI }),
            velocity_bounds: pair(BOUNDS.1),
        }
    }
}
