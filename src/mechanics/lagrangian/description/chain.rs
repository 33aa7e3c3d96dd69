//! A chain of links in a system file, from its rows of Denavit and Hartenberg to coordinates, parameters and formulas.
//!
//! With the angular velocity `w` of a link in its own frame, the velocity `v` of that frame's origin, the acceleration of gravity `g` and
//! the place `r` of the origin in the base, a rigid link of mass `m`, first moments `h = m c` and inertia `I` about the origin has
//!
//! `L = m v^2/2 + h.(v x w) + w.I w/2 + m g.r + h.g`,
//!
//! which is linear in its ten constants. From one link to the next, `w' = R^T w + q_dot z` and `v' = R^T (v + w x p)` of a joint that turns
//! (Featherstone, "Rigid Body Dynamics Algorithms", 2008).

use super::quantity::Decimal;
use super::{CoordinateDescription, Description, DescriptionError, ParameterDescription, Quantity, is_false};
use crate::lagrangian::recursion::{Row, Shape};
use crate::lagrangian::system::Range;
use crate::names::unknown;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::f64::consts::PI;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Most links.
const MAX_LINKS: usize = 16;
/// Acceleration of gravity in m/s^2 if none is given, and the speed at which dry friction is three quarters there.
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];
const COULOMB_SPEED: f64 = 0.01;
/// Bounds of positions in m, and of velocities in rad/s or m/s, of coordinates that the file does not describe.
const BOUNDS: (f64, f64) = (1.0, 3.0);
/// Part of a sine or cosine that is rounding.
const ROUNDING: f64 = 1e-15;

/// Settings that all links of a chain share.
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

/// Where the frame of a link is.
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
    #[cfg_attr(feature = "serde", serde(default = "nothing"))]
    a: Quantity,
    /// Twist in rad.
    #[cfg_attr(feature = "serde", serde(default = "nothing"))]
    alpha: Quantity,
    /// Offset along the joint in m; what a sliding joint adds to.
    #[cfg_attr(feature = "serde", serde(default = "nothing"))]
    d: Quantity,
    /// Angle about the joint in rad; what a turning joint adds to.
    #[cfg_attr(feature = "serde", serde(default = "nothing"))]
    theta: Quantity,
    /// `true` if the joint slides.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_false"))]
    prismatic: bool,
}

fn nothing() -> Quantity {
    Quantity(0.0)
}

/// A number times names; without names the number alone.
#[derive(Clone, Debug)]
struct Term {
    factor: f64,
    names: Vec<String>,
}

impl Term {
    fn number(factor: f64) -> Self {
        Self { factor, names: Vec::new() }
    }
    fn name(name: impl Into<String>) -> Self {
        Self { factor: 1.0, names: vec![name.into()] }
    }
    fn times(&self, other: &Self) -> Self {
        Self { factor: self.factor * other.factor, names: [self.names.clone(), other.names.clone()].concat() }
    }
    fn scaled(&self, factor: f64) -> Self {
        Self { factor: self.factor * factor, names: self.names.clone() }
    }
}

type Vector = [Term; 3];

/// A sum of terms as a formula.
fn formula(terms: &[Term]) -> String {
    let mut text = String::new();
    for term in terms.iter().filter(|term| term.factor != 0.0) {
        let (sign, size) = (if term.factor < 0.0 { "-" } else { "+" }, term.factor.abs());
        match (text.is_empty(), sign) {
            (true, "+") => {}
            (true, _) => text += "-",
            (false, _) => text += &format!(" {sign} "),
        }
        let number = (size != 1.0 || term.names.is_empty()).then(|| size.to_string());
        text += &number.into_iter().chain(term.names.iter().cloned()).collect::<Vec<_>>().join("*");
    }
    if text.is_empty() { "0".to_string() } else { text }
}

/// Sine and cosine, exact at quarter turns.
fn sine_cosine(angle: f64) -> [f64; 2] {
    let exact = |x: f64| if x.abs() < ROUNDING { 0.0 } else { x };
    [exact(angle.sin()), exact(angle.cos())]
}

/// `(a x b)_i` as two terms.
fn cross(a: &Vector, b: &Vector, i: usize) -> [Term; 2] {
    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
    [a[j].times(&b[k]), a[k].times(&b[j]).scaled(-1.0)]
}

/// Symbols of the ten constants of a link, from 1: its mass, first moments and inertia about the origin of its frame.
pub(crate) fn inertia_symbols(link: usize) -> [String; 10] {
    ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"].map(|what| format!("{what}{link}"))
}

/// Symbols of the constants of a joint, from 1, that are not negative: the inertia of its drive, viscous and dry friction.
pub(crate) fn loss_symbols(link: usize) -> [String; 3] {
    ["Ia", "Fv", "Fc"].map(|what| format!("{what}{link}"))
}

impl Description {
    /// The chain of its links if there is nothing beside them; constants stand where their names do in `parameters`.
    pub(super) fn shape(&self, parameters: &BTreeMap<String, ParameterDescription>) -> Option<Shape> {
        let beside = [&self.lagrangian, &self.dissipation].into_iter().flatten().next().is_some();
        if self.links.is_empty() || beside || !self.constraints.is_empty() {
            return None;
        }
        let chain = self.chain.clone().unwrap_or_default();
        let place = |name: &String| parameters.keys().position(|known| known == name);
        let row = |(k, link): (usize, &LinkDescription)| {
            let [armature, viscous, dry] = loss_symbols(k + 1);
            let ([a, alpha], [m, hx, hy, hz, rest @ ..]) =
                (self.before(k), inertia_symbols(k + 1).each_ref().map(place));
            Some(Row {
                a,
                twist: sine_cosine(alpha),
                d: link.d.0,
                theta: link.theta.0,
                slides: link.prismatic,
                inertia: [m?, hx?, hy?, hz?, rest[0]?, rest[1]?, rest[2]?, rest[3]?, rest[4]?, rest[5]?],
                armature: if chain.armature { Some(place(&armature)?) } else { None },
                friction: if chain.friction { Some([place(&viscous)?, place(&dry)?]) } else { None },
            })
        };
        let rows = self.links.iter().enumerate().map(row).collect::<Option<_>>()?;
        let gravity = chain.gravity.and_then(|given| given.iter().map(|x| x.0).collect::<Vec<_>>().try_into().ok());
        let coulomb_speed = chain.coulomb_speed.map_or(COULOMB_SPEED, |speed| speed.0);
        Some(Shape { rows, gravity: gravity.unwrap_or(GRAVITY), coulomb_speed })
    }

    /// Length and twist before the joint of a link: the standard row ends where the modified row of the next joint begins.
    fn before(&self, k: usize) -> [f64; 2] {
        let of = |link: &LinkDescription| [link.a.0, link.alpha.0];
        match self.chain.as_ref().map_or(Convention::Modified, |chain| chain.convention) {
            Convention::Modified => of(&self.links[k]),
            Convention::Standard => k.checked_sub(1).map_or([0.0; 2], |k| of(&self.links[k])),
        }
    }

    /// The same with links written out; as it is if they are wrong, which its compilation says.
    pub(crate) fn plain(&self) -> Self {
        self.unfolded().unwrap_or_else(|_| self.clone())
    }

    /// The same without links: their coordinates, parameters and formulas written out.
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
        if plain.coordinates.is_empty() {
            plain.coordinates = self.links.iter().enumerate().map(|(k, link)| link.coordinate(k)).collect();
        }
        if plain.coordinates.len() != count {
            let problem = format!("expected {count} tables, one for each link, found {}", plain.coordinates.len());
            return fault("coordinates", problem);
        }
        let chain = self.chain.clone().unwrap_or_default();
        let gravity = chain.gravity.map_or(Ok(GRAVITY), |given| {
            let given: Vec<f64> = given.iter().map(|x| x.0).collect();
            let finite = given.iter().all(|x| x.is_finite());
            given
                .try_into()
                .ok()
                .filter(|_| finite)
                .ok_or_else(|| DescriptionError::new("chain.gravity", "expected three finite numbers [x, y, z]"))
        })?;
        let speed = chain.coulomb_speed.map_or(COULOMB_SPEED, |speed| speed.0);
        if !(speed.is_finite() && speed > 0.0) {
            return fault("chain.coulomb_speed", format!("expected a finite number above 0, found {speed}"));
        }
        let (mut sums, mut losses) = (Vec::new(), Vec::new());
        let mut base = Base {
            turning: [0.0; 3].map(Term::number),
            moving: [0.0; 3].map(Term::number),
            gravity: gravity.map(Term::number),
            height: Term::number(0.0),
        };
        for (k, link) in self.links.iter().enumerate() {
            for (key, x) in [("a", link.a.0), ("alpha", link.alpha.0), ("d", link.d.0), ("theta", link.theta.0)] {
                if !x.is_finite() {
                    return fault(&format!("links[{k}].{key}"), format!("expected a finite number, found {x}"));
                }
            }
            sums.push(Term::name(plain.add_link((k + 1, link, self.before(k)), &mut base, chain.armature)?));
            if chain.friction {
                losses.extend(plain.add_friction((k + 1, link), speed)?);
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
        // What the file says of a constant counts; one that is neither of the links nor in a formula would be passed over in silence.
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

    /// Adds a link: the name of its part of the Lagrangian, and `base` moved on to it.
    fn add_link(
        &mut self,
        (number, link, [a, alpha]): (usize, &LinkDescription, [f64; 2]),
        base: &mut Base,
        armature: bool,
    ) -> Result<String, DescriptionError> {
        let coordinate = self.coordinates[number - 1].name.clone();
        let (q, speed) = (Term::name(&coordinate), Term::name(format!("{coordinate}_dot")));
        let own = |what: &str| format!("link{number}_{what}");
        let [sine, cosine] = if link.prismatic {
            sine_cosine(link.theta.0).map(Term::number)
        } else {
            let angle = formula(&[q.clone(), Term::number(link.theta.0)]);
            self.define_part(own("s"), format!("sin({angle})"))?;
            self.define_part(own("c"), format!("cos({angle})"))?;
            ["s", "c"].map(|what| Term::name(own(what)))
        };
        let along =
            if link.prismatic { self.sum(own("d"), &[q, Term::number(link.d.0)])? } else { Term::number(link.d.0) };
        let [sa, ca] = sine_cosine(alpha);
        let place = [Term::number(a), along.scaled(-sa), along.scaled(ca)];
        let height = [0, 1, 2].map(|i| place[i].times(&base.gravity[i]));
        let height = self.sum(own("u"), &[&height[..], core::slice::from_ref(&base.height)].concat())?;
        let mut carried = |i: usize| {
            let swung = cross(&base.turning, &place, i);
            self.sum(own(&format!("o{}", AXES[i])), &[&swung[..], core::slice::from_ref(&base.moving[i])].concat())
        };
        let there = [carried(0)?, carried(1)?, carried(2)?];
        // R^T, first about x and then about z; the motion of the joint is along z.
        let mut turned = |what: &str, from: &Vector, joint: Option<&Term>| -> Result<Vector, DescriptionError> {
            let [y, z] = [[ca, sa], [-sa, ca]].map(|[y, z]| [from[1].scaled(y), from[2].scaled(z)]);
            let y = self.sum(own(&format!("{what}t")), &y)?;
            let x = self.sum(own(&format!("{what}x")), &[cosine.times(&from[0]), sine.times(&y)])?;
            let y = self.sum(own(&format!("{what}y")), &[sine.times(&from[0]).scaled(-1.0), cosine.times(&y)])?;
            let z = [&z[..], &joint.into_iter().cloned().collect::<Vec<_>>()].concat();
            Ok([x, y, self.sum(own(&format!("{what}z")), &z)?])
        };
        let (turns, slides) = if link.prismatic { (None, Some(&speed)) } else { (Some(&speed), None) };
        let w = turned("w", &base.turning, turns)?;
        let v = turned("v", &there, slides)?;
        let g = turned("g", &base.gravity, None)?;
        let constant = |what: &str| Term::name(format!("{what}{number}"));
        let mass = constant("m");
        let mut terms: Vec<Term> = v.iter().map(|v| mass.times(v).times(v).scaled(0.5)).collect();
        terms.push(mass.times(&height));
        for i in 0..3 {
            let moment = constant(&format!("m{}", AXES[i]));
            terms.extend(cross(&v, &w, i).iter().chain([&g[i]]).map(|term| moment.times(term)));
            for j in i..3 {
                let inertia = constant(&format!("I{}{}", AXES[i], AXES[j]));
                terms.push(inertia.times(&w[i]).times(&w[j]).scaled(if i == j { 0.5 } else { 1.0 }));
            }
        }
        let mut constants = vec![("m".to_string(), "kg", 1.0)];
        for (i, x) in AXES.iter().enumerate() {
            constants.push((format!("m{x}"), "kg m", 0.0));
            constants.extend(AXES[i..].iter().map(|y| (format!("I{x}{y}"), "kg m^2", if x == y { 0.1 } else { 0.0 })));
        }
        if armature {
            terms.push(constant("Ia").times(&speed).times(&speed).scaled(0.5));
            constants.push(("Ia".to_string(), if link.prismatic { "kg" } else { "kg m^2" }, 0.0));
        }
        self.add_constants(number, &constants);
        *base = Base { turning: w, moving: v, gravity: g, height };
        self.define_part(own("L"), formula(&terms))?;
        Ok(own("L"))
    }

    /// Terms of Rayleigh's function of a joint: `Fv q_dot^2/2 + Fc s ln cosh(q_dot/s)`.
    fn add_friction(
        &mut self,
        (number, link): (usize, &LinkDescription),
        speed: f64,
    ) -> Result<[Term; 2], DescriptionError> {
        let units = if link.prismatic { ["N s/m", "N"] } else { ["N m s", "N m"] };
        let velocity = format!("{}_dot", self.coordinates[number - 1].name);
        let dry = format!("link{number}_dry");
        // ln cosh x = |x| + ln(1 + exp(-2 |x|)) - ln 2, which no speed overflows.
        let size = format!("abs({velocity}/{speed})");
        self.define_part(dry.clone(), format!("{speed}*({size} + ln1p(exp(-2*{size})))"))?;
        self.add_constants(number, &[("Fv".to_string(), units[0], 0.0), ("Fc".to_string(), units[1], 0.0)]);
        let constant = |what: &str| Term::name(format!("{what}{number}"));
        let viscous = Term { factor: 0.5, names: [constant("Fv").names, vec![velocity.clone(), velocity]].concat() };
        Ok([viscous, constant("Fc").times(&Term::name(dry))])
    }

    /// Unknown constants of a link.
    fn add_constants(&mut self, number: usize, constants: &[(String, &str, f64)]) {
        for (name, unit, value) in constants {
            let own = ParameterDescription {
                default: Decimal(value.to_string()),
                unit: (*unit).to_string(),
                range: Range::Any,
                learn: true,
                per: None,
                known: BTreeMap::new(),
            };
            self.parameters.insert(format!("{name}{number}"), own);
        }
    }

    /// `true` if a formula of the file holds a name.
    fn uses(&self, name: &str) -> bool {
        let formulas = [&self.lagrangian, &self.dissipation].into_iter().flatten();
        let mut formulas = formulas.chain(self.definitions.values()).chain(self.constraints.values());
        formulas.any(|text| text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == name))
    }

    /// A sum of terms as one expression, with a definition if needed.
    fn sum(&mut self, name: String, terms: &[Term]) -> Result<Term, DescriptionError> {
        let mut all: Vec<Term> = Vec::with_capacity(terms.len());
        for term in terms.iter().filter(|term| term.factor != 0.0) {
            match all.iter_mut().find(|known| known.names == term.names) {
                Some(known) => known.factor += term.factor,
                None => all.push(term.clone()),
            }
        }
        all.retain(|term| term.factor != 0.0);
        match &all[..] {
            [] => Ok(Term::number(0.0)),
            [single] if single.names.len() < 2 => Ok(single.clone()),
            _ => {
                self.define_part(name.clone(), formula(&all))?;
                Ok(Term::name(name))
            }
        }
    }

    fn define_part(&mut self, name: String, text: String) -> Result<(), DescriptionError> {
        match self.definitions.insert(name.clone(), text) {
            Some(_) => Err(DescriptionError::new(format!("definitions.{name}"), "the name is taken by `[[links]]`")),
            None => Ok(()),
        }
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Motion of the link before, in its frame, the acceleration of gravity there, and `g.r` of its origin.
struct Base {
    turning: Vector,
    moving: Vector,
    gravity: Vector,
    height: Term,
}

impl LinkDescription {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{SystemInstance, configure_system, inverse_dynamics};
    use std::borrow::Cow;

    fn instance(chain: &str, links: &str, pairs: &[(&str, f64)]) -> SystemInstance<f64> {
        let text = format!(r#"{{"name": "arm", "chain": {chain}, "links": {links}}}"#);
        let description: Description = serde_json::from_str(&text).unwrap();
        let given: Vec<(String, String)> = pairs.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
        configure_system(Cow::Owned(description.system().unwrap()), &given).unwrap()
    }

    fn forces(instance: &SystemInstance<f64>, [q, v, a]: [&[f64]; 3]) -> Vec<f64> {
        inverse_dynamics(&instance.build().unwrap(), q, v, a).unwrap().external
    }

    fn close(found: &[f64], expected: &[f64]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        assert_eq!(found.len(), expected.len());
    }

    /// Two rods that swing about level axes, of lengths `l` and masses `m` at their ends.
    const RODS: [(&str, f64); 8] = [
        ("m1", 2.0),
        ("mx1", 1.4),
        ("Izz1", 0.98),
        ("m2", 0.5),
        ("mx2", 0.2),
        ("Izz2", 0.08),
        ("Fv2", 0.3),
        ("Fc2", 0.1),
    ];
    const STATE: [&[f64]; 3] = [&[0.4, -1.1], &[0.8, 1.7], &[-0.6, 2.3]];

    /// Torques of these rods by the textbook's equations, angles from the direction of gravity.
    fn textbook() -> Vec<f64> {
        let ([q, v, a], g) = (STATE, 9.81);
        let (l, [m1, c1], [m2, c2]) = (0.7, [2.0, 0.7], [0.5, 0.4]);
        let (cosine, sine) = (q[1].cos(), q[1].sin());
        let (far, mixed) = (m2 * c2 * c2, m2 * l * c2);
        let hanging = m2 * g * c2 * (q[0] + q[1]).sin();
        let first = (m1 * c1 * c1 + m2 * l * l + far + 2.0 * mixed * cosine) * a[0] + (far + mixed * cosine) * a[1]
            - mixed * sine * v[1] * (2.0 * v[0] + v[1])
            + (m1 * c1 + m2 * l) * g * q[0].sin()
            + hanging;
        let second = (far + mixed * cosine) * a[0] + far * a[1] + mixed * sine * v[0] * v[0] + hanging;
        vec![first, second + 0.3 * v[1] + 0.1 * (v[1] / 0.01).tanh()]
    }

    #[test]
    fn rods_by_rows_of_either_convention_move_as_the_textbook_says() {
        // Gravity along x of the base.
        let chain = |convention: &str| {
            format!(r#"{{"convention": "{convention}", "gravity": [9.81, 0, 0], "friction": true}}"#)
        };
        let modified = instance(&chain("modified"), r#"[{}, {"a": 0.7}]"#, &RODS);
        close(&forces(&modified, STATE), &textbook());
        let standard = instance(&chain("standard"), r#"[{"a": 0.7}, {"a": 3, "alpha": 1}]"#, &RODS);
        close(&forces(&standard, STATE), &textbook());
    }

    #[test]
    fn a_pole_on_a_cart_moves_as_the_textbook_says() {
        // Gravity pulls against the x axis of the base and of the cart, which slides along its own z axis; at q2 = 0 the pole points
        // upwards, and it turns towards z.
        let links = r#"[{"prismatic": true, "d": 0.3, "alpha": "pi/2"}, {"alpha": "pi/2"}]"#;
        let masses = [("m1", 2.0), ("m2", 0.5), ("mx2", 0.2), ("Izz2", 0.08), ("Ia1", 0.25)];
        let cart = instance(r#"{"armature": true, "gravity": [-9.81, 0, 0]}"#, links, &masses);
        let [q, v, a] = STATE;
        let (cosine, sine) = (q[1].cos(), q[1].sin());
        let push = 2.75 * a[0] + 0.2 * (cosine * a[1] - sine * v[1] * v[1]);
        let swing = 0.08 * a[1] + 0.2 * cosine * a[0] - 0.2 * 9.81 * sine;
        close(&forces(&cart, STATE), &[push, swing]);
    }

    #[test]
    fn constants_of_links_have_their_symbols() {
        let arm = instance(r#"{"friction": true, "armature": true}"#, r#"[{}, {"prismatic": true}]"#, &[]);
        let mut own: Vec<String> = arm.system.parameters.iter().map(|known| known.symbol.to_string()).collect();
        let mut symbols: Vec<String> =
            (1..=2).flat_map(|link| [&inertia_symbols(link)[..], &loss_symbols(link)].concat()).collect();
        own.sort();
        symbols.sort();
        assert_eq!(own, symbols);
    }

    #[test]
    fn a_mistake_in_links_names_its_key() {
        let key = |text: &str| {
            let description: Description = serde_json::from_str(text).unwrap();
            description.system().unwrap_err().key
        };
        let of = |more: &str| key(&format!(r#"{{"name": "arm", {more}}}"#));
        assert_eq!(of(r#""chain": {}"#), "chain");
        assert_eq!(of(r#""chain": {"gravity": [0, 1]}, "links": [{}]"#), "chain.gravity");
        assert_eq!(of(r#""chain": {"coulomb_speed": 0}, "links": [{}]"#), "chain.coulomb_speed");
        assert_eq!(of(r#""links": [{}, {"alpha": "1/0"}]"#), "links[1].alpha");
        assert_eq!(of(r#""links": [{}], "metric": {}"#), "metric");
        assert_eq!(of(r#""links": [{}], "definitions": {"link1_s": "1"}"#), "definitions.link1_s");
        assert_eq!(of(r#""links": [{}], "parameters": {"lzz1": 1}"#), "parameters.lzz1");
        assert_eq!(of(r#""links": [{}], "parameters": {"k": 1}, "lagrangian": "-kk*q1^2""#), "parameters.k");
        let coordinates = r#""coordinates": [{"name": "a", "velocity_bounds": [-1, 1], "periodic": true}]"#;
        assert_eq!(of(&format!(r#""links": [{{}}, {{}}], {coordinates}"#)), "coordinates");
        assert_eq!(of(&format!(r#""links": [{}]"#, vec!["{}"; MAX_LINKS + 1].join(","))), "links");
    }

    #[test]
    fn what_the_file_says_is_added_and_kept() {
        let text = r#"{"name": "arm", "links": [{}], "chain": {"friction": true}, "lagrangian": "-k*q1^2/2", "dissipation": "c*q1_dot^4",
            "parameters": {"k": 3, "c": 0.5, "m1": {"default": 4, "unit": "kg"}}}"#;
        let description: Description = serde_json::from_str(text).unwrap();
        let system = description.system().unwrap();
        let symbols: Vec<&str> = system.parameters.iter().filter(|p| p.learn).map(|p| p.symbol.as_ref()).collect();
        assert!(symbols.contains(&"Izz1") && !symbols.contains(&"m1") && !symbols.contains(&"k"), "{symbols:?}");
        let given = [("Izz1", 0.5), ("Fv1", 0.2)].map(|(name, x)| (name.to_string(), x.to_string()));
        let instance = configure_system::<f64>(Cow::Owned(system), &given).unwrap();
        close(&forces(&instance, [&[0.2], &[1.5], &[3.0]]), &[1.5 + 0.6 + 0.3 + 2.0 * 1.5_f64.powi(3)]);
        let described = instance.system.described.as_ref().unwrap();
        let again = described.with_defaults(&[("Izz1", 0.25)]);
        assert!(again.definitions.is_empty() && again.links == description.links);
        assert_eq!(again.parameters["Izz1"].default, Decimal("0.25".to_string()));
        assert_eq!(again.system().unwrap().parameters.len(), instance.parameters.len());
    }
}
