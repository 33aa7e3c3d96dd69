//! Formulas of links: the Lagrangian of each link as a sum of products, with its parts as definitions.

use super::joints::sine_cosine;
use crate::lagrangian::description::quantity::Decimal;
use crate::lagrangian::description::{Description, DescriptionError, ParameterDescription};
use crate::lagrangian::recursion::Joint;
use crate::lagrangian::system::Range;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// A product of a number and names; without names just the number.
#[derive(Clone, Debug)]
pub(super) struct Term {
    factor: f64,
    names: Vec<String>,
}

impl Term {
    pub(super) fn number(factor: f64) -> Self {
        Self { factor, names: Vec::new() }
    }
    pub(super) fn name(name: impl Into<String>) -> Self {
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

/// Formats a sum of terms as a formula.
pub(super) fn formula(terms: &[Term]) -> String {
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

/// Returns `(a x b)_i` as two terms.
fn cross(a: &Vector, b: &Vector, i: usize) -> [Term; 2] {
    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
    [a[j].times(&b[k]), a[k].times(&b[j]).scaled(-1.0)]
}

impl Description {
    /// Adds a link; returns the name of its part of the Lagrangian and the base for the next links.
    pub(super) fn add_link(
        &mut self,
        (number, joint): (usize, &Joint),
        base: &Base,
        armature: bool,
    ) -> Result<(String, Base), DescriptionError> {
        let coordinate = self.coordinates[joint.drive.0].name.clone();
        let q = Term::name(&coordinate).scaled(joint.drive.1);
        let speed = Term::name(format!("{coordinate}_dot")).scaled(joint.drive.1);
        let own = |what: &str| format!("link{number}_{what}");
        let mut place = joint.place.map(Term::number);
        let turn = if joint.slides {
            for (i, along) in joint.axis().into_iter().enumerate() {
                place[i] = self.sum(own(&format!("p{}", AXES[i])), &[q.scaled(along), place[i].clone()])?;
            }
            sine_cosine(joint.theta).map(Term::number)
        } else {
            let angle = formula(&[q, Term::number(joint.theta)]);
            self.define_part(own("s"), format!("sin({angle})"))?;
            self.define_part(own("c"), format!("cos({angle})"))?;
            ["s", "c"].map(|what| Term::name(own(what)))
        };
        let height = [0, 1, 2].map(|i| place[i].times(&base.gravity[i]));
        let height = self.sum(own("u"), &[&height[..], core::slice::from_ref(&base.height)].concat())?;
        let mut carried = |i: usize| {
            let swung = cross(&base.turning, &place, i);
            self.sum(own(&format!("o{}", AXES[i])), &[&swung[..], core::slice::from_ref(&base.moving[i])].concat())
        };
        let there = [carried(0)?, carried(1)?, carried(2)?];
        let (turns, slides) = if joint.slides { (None, Some(&speed)) } else { (Some(&speed), None) };
        let there = Base {
            turning: self.inward(&own("w"), (joint, &turn), &base.turning, turns)?,
            moving: self.inward(&own("v"), (joint, &turn), &there, slides)?,
            gravity: self.inward(&own("g"), (joint, &turn), &base.gravity, None)?,
            height,
        };
        let [w, v, g] = [("w", &there.turning), ("v", &there.moving), ("g", &there.gravity)]
            .map(|(what, vector)| self.in_frame(&own(what), joint, vector));
        let (w, v, g) = (w?, v?, g?);
        let constant = |what: &str| Term::name(format!("{what}{number}"));
        let mass = constant("m");
        let mut terms: Vec<Term> = v.iter().map(|v| mass.times(v).times(v).scaled(0.5)).collect();
        terms.push(mass.times(&there.height));
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
            constants.push(("Ia".to_string(), if joint.slides { "kg" } else { "kg m^2" }, 0.0));
        }
        self.add_constants(number, &constants);
        self.define_part(own("L"), formula(&terms))?;
        Ok((own("L"), there))
    }

    /// Returns `R^T x` plus the joint's contribution along its axis. The inverse rotation is applied in order: about z by the bend, about
    /// x, about z.
    fn inward(
        &mut self,
        name: &str,
        (joint, [sine, cosine]): (&Joint, &[Term; 2]),
        from: &Vector,
        along: Option<&Term>,
    ) -> Result<Vector, DescriptionError> {
        let ([sb, cb], [sa, ca]) = (joint.bend, joint.twist);
        let first = self.sum(format!("{name}bx"), &[from[0].scaled(cb), from[1].scaled(sb)])?;
        let second = self.sum(format!("{name}by"), &[from[0].scaled(-sb), from[1].scaled(cb)])?;
        let [y, z] = [[ca, sa], [-sa, ca]].map(|[y, z]| [second.scaled(y), from[2].scaled(z)]);
        let y = self.sum(format!("{name}t"), &y)?;
        let z = [&z[..], &along.into_iter().cloned().collect::<Vec<_>>()].concat();
        Ok([
            self.sum(format!("{name}x"), &[cosine.times(&first), sine.times(&y)])?,
            self.sum(format!("{name}y"), &[sine.times(&first).scaled(-1.0), cosine.times(&y)])?,
            self.sum(format!("{name}z"), &z)?,
        ])
    }

    /// Rotates a vector from the frame of a joint to the frame in which the constants of its link are given.
    fn in_frame(&mut self, name: &str, joint: &Joint, vector: &Vector) -> Result<Vector, DescriptionError> {
        let Some(axes) = joint.axes else { return Ok(vector.clone()) };
        let mut part = |i: usize| {
            let terms: Vec<Term> = vector.iter().zip(axes[i]).map(|(term, x)| term.scaled(x)).collect();
            self.sum(format!("{name}l{}", AXES[i]), &terms)
        };
        Ok([part(0)?, part(1)?, part(2)?])
    }

    /// Adds the terms of a joint to Rayleigh's function: `Fv q_dot^2/2 + Fc s ln cosh(q_dot/s)`.
    pub(super) fn add_friction(
        &mut self,
        (number, joint): (usize, &Joint),
        speed: f64,
    ) -> Result<[Term; 2], DescriptionError> {
        let units = if joint.slides { ["N s/m", "N"] } else { ["N m s", "N m"] };
        let (at, ratio) = joint.drive;
        let velocity = format!("{}_dot", self.coordinates[at].name);
        let dry = format!("link{number}_dry");
        // ln cosh x = |x| + ln(1 + exp(-2 |x|)) - ln 2 does not overflow at any speed.
        let size = format!("abs({velocity}/{})", speed / ratio.abs());
        self.define_part(dry.clone(), format!("{speed}*({size} + ln1p(exp(-2*{size})))"))?;
        self.add_constants(number, &[("Fv".to_string(), units[0], 0.0), ("Fc".to_string(), units[1], 0.0)]);
        let constant = |what: &str| Term::name(format!("{what}{number}"));
        let viscous = Term {
            factor: 0.5 * ratio * ratio,
            names: [constant("Fv").names, vec![velocity.clone(), velocity]].concat(),
        };
        Ok([viscous, constant("Fc").times(&Term::name(dry))])
    }

    /// Adds the unknown constants of a link.
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

    /// Turns a sum of terms into one term, with a definition if needed.
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

/// Motion of the link that carries another one, in the frame of its joint, with the acceleration of gravity there and `g.r` of its origin.
#[derive(Clone)]
pub(super) struct Base {
    turning: Vector,
    moving: Vector,
    gravity: Vector,
    height: Term,
}

impl Base {
    /// Returns a base at rest.
    pub(super) fn at_rest(gravity: [f64; 3]) -> Self {
        let still = [0.0; 3].map(Term::number);
        Self { turning: still.clone(), moving: still, gravity: gravity.map(Term::number), height: Term::number(0.0) }
    }
}
