//! Links in a system file, a chain or a tree, from the places of their joints to coordinates, parameters and formulas.
//!
//! With the angular velocity `w` of a link in its own frame, the velocity `v` of that frame's origin, the acceleration of gravity `g` and
//! the place `r` of the origin in the base, a rigid link of mass `m`, first moments `h = m c` and inertia `I` about the origin has
//!
//! `L = m v^2/2 + h.(v x w) + w.I w/2 + m g.r + h.g`,
//!
//! which is linear in its ten constants. From one link to the next, `w' = R^T w + q_dot z` and `v' = R^T (v + w x p)` of a joint that turns
//! (Featherstone, "Rigid Body Dynamics Algorithms", 2008).

mod formulas;
mod joints;
#[cfg(test)]
mod tests;

#[cfg(feature = "serde")]
use super::read;
use super::{CoordinateDescription, Description, DescriptionError, ParameterDescription, Quantity, is_false};
use crate::lagrangian::recursion::{Joint, Row, Shape};
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

/// Most links.
const MAX_LINKS: usize = 64;
/// Acceleration of gravity in m/s^2 if none is given, and the speed at which dry friction is three quarters there.
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];
const COULOMB_SPEED: f64 = 0.01;
/// Bounds of positions in m, and of velocities in rad/s or m/s, of coordinates that the file does not describe.
const BOUNDS: (f64, f64) = (1.0, 3.0);

/// Settings that all links share.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct ChainDescription {
    /// How the rows are meant.
    #[cfg_attr(feature = "serde", serde(default))]
    convention: Convention,
    /// Acceleration of gravity in the frame of the base, in m/s^2; `[0, 0, -9.81]` if left out.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    gravity: Option<Vec<Quantity>>,
    /// Viscous and dry friction of every joint.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    friction: bool,
    /// Speed `s` of dry friction `Fc tanh(q_dot/s)`, in rad/s or m/s; 0.01 if left out.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    coulomb_speed: Option<Quantity>,
    /// Inertia of every drive.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    armature: bool,
}

/// The place of a link's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
enum Convention {
    /// On the axis of its own joint: `Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d)` (Craig, Khalil).
    #[default]
    Modified,
    /// On the axis of the next joint: `Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha)` (Denavit, Paul, Spong).
    Standard,
}

/// A link with the joint that moves it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct LinkDescription {
    /// Length in m.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    a: Quantity,
    /// Twist in rad.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    alpha: Quantity,
    /// Offset along the joint in m; what a sliding joint adds to.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    d: Quantity,
    /// Angle about the joint in rad; what a turning joint adds to.
    #[cfg_attr(feature = "serde", serde(default = "nothing", skip_serializing_if = "is_nothing"))]
    theta: Quantity,
    /// `true` if the joint slides.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    prismatic: bool,
    /// Name, by which other links refer to it.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    name: Option<String>,
    /// Name or number of the link that carries it, 0 for the base; the one before if left out.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "read::reference")
    )]
    parent: Option<String>,
    /// Place of its origin in the frame of that link, in m.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    xyz: Option<Vec<Quantity>>,
    /// Turns of its frame about the fixed axes x, y and z of the frame of that link, in this order, in rad.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    rpy: Option<Vec<Quantity>>,
    /// Direction of the axis of the joint in its own frame; z if left out.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    axis: Option<Vec<Quantity>>,
    /// Name or number of the link whose coordinate moves this joint too: by `ratio` times the coordinate and an offset.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "read::reference")
    )]
    mimic: Option<String>,
    /// How far the joint moves for each unit of that coordinate; 1 if left out.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    ratio: Option<Quantity>,
    /// Where the joint is at the zero of that coordinate, in rad or m.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    offset: Option<Quantity>,
}

fn nothing() -> Quantity {
    Quantity(0.0)
}

fn is_nothing(x: &Quantity) -> bool {
    x.0 == 0.0
}

/// A link with the joint that moves it, in words.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(Serialize))]
pub struct ShownLink<'a> {
    /// Its name, if it has one.
    pub name: Option<&'a str>,
    /// Number of the link that carries it, 0 for the base.
    pub parent: usize,
    /// `true` if its joint slides.
    pub prismatic: bool,
    /// The coordinate that moves it, and how far it moves for each unit of that.
    pub coordinate: &'a str,
    pub ratio: f64,
}

/// Symbols of the ten constants of a link, from 1: its mass, first moments and inertia about the origin of its frame.
pub fn inertia_symbols(link: usize) -> [String; 10] {
    ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"].map(|what| format!("{what}{link}"))
}

/// Symbols of the constants of a joint, from 1, that are not negative: the inertia of its drive, viscous and dry friction.
pub fn loss_symbols(link: usize) -> [String; 3] {
    ["Ia", "Fv", "Fc"].map(|what| format!("{what}{link}"))
}

impl Description {
    /// The chain of its links if there is nothing else; constants are at the index of their names in `parameters`.
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

    /// Its links in words, coordinates by these names.
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

    /// The description with its links expanded; unchanged if they are wrong, which its compilation reports.
    pub fn plain(&self) -> Self {
        self.unfolded().unwrap_or_else(|_| self.clone())
    }

    /// The description without links: their coordinates, parameters and formulas are expanded.
    pub(super) fn unfolded(&self) -> Result<Self, DescriptionError> {
        let fault = |key: &str, problem: String| Err(DescriptionError::new(key, problem));
        let mut plain = Self { chain: None, links: Vec::new(), ..self.clone() };
        let count = self.links.len();
        match (&self.chain, count) {
            (None, 0) => return Ok(plain),
            (Some(_), 0) => return fault("chain", "expected tables [[links]] beside it".to_string()),
            (_, 1..=MAX_LINKS) => {}
            _ => return fault("links", format!("expected 1 to {MAX_LINKS} tables [[links]], found {count}")),
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
        // The file's settings of a constant are used; a constant that neither a link nor a formula uses would be ignored silently.
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

    /// `true` if a formula of the file contains a name.
    fn uses(&self, name: &str) -> bool {
        let formulas = [&self.lagrangian, &self.dissipation].into_iter().flatten();
        let mut formulas = formulas.chain(self.definitions.values()).chain(self.constraints.values());
        formulas.any(|text| text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == name))
    }
}

impl LinkDescription {
    /// `true` if its place is given as a vector and turns, not as a row of Denavit and Hartenberg.
    fn is_placed(&self) -> bool {
        self.xyz.is_some() || self.rpy.is_some() || self.axis.is_some()
    }

    /// A coordinate that the file does not describe.
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
