//! Joint frames of a description: converts its rows to frames whose `z` is the axis of the joint.

use super::Convention;
use crate::lagrangian::description::{Description, DescriptionError, Quantity};
use crate::lagrangian::recursion::{Joint, Matrix, applied, cross, product, transposed};
use crate::lagrangian::thresholds::ROTATION_ROUNDING;
use alloc::vec::Vec;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The identity, for the base and for links whose constants are given in the frame of their joint.
const SAME: Matrix<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

type Outcome<T> = Result<T, DescriptionError>;

fn exact(x: f64) -> f64 {
    if x.abs() < ROTATION_ROUNDING { 0.0 } else { x }
}

/// Computes sine and cosine, exact at multiples of a quarter turn.
pub(super) fn sine_cosine(angle: f64) -> [f64; 2] {
    [angle.sin(), angle.cos()].map(exact)
}

/// Computes `Rot_z(yaw) Rot_y(pitch) Rot_x(roll)`.
pub fn turned([roll, pitch, yaw]: [f64; 3]) -> Matrix<f64> {
    let [[sr, cr], [sp, cp], [sy, cy]] = [roll, pitch, yaw].map(sine_cosine);
    let about_y = [[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]];
    product(&product(&about_z([sy, cy]), &about_y), &about_x([sr, cr]))
}

fn about_x([s, c]: [f64; 2]) -> Matrix<f64> {
    [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
}

fn about_z([s, c]: [f64; 2]) -> Matrix<f64> {
    [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
}

/// Returns axes of a joint as columns, the third of which is `axis`. If `axis` is an axis of the frame, so are the other two.
fn around(axis: [f64; 3]) -> Matrix<f64> {
    let far = if axis[0].abs() > axis[1].abs() { 0 } else { 1 };
    let far = if axis[2].abs() > axis[far].abs() { 2 } else { far };
    let next = SAME[(far + 1) % 3];
    let along = axis[(far + 1) % 3];
    let x: [f64; 3] = core::array::from_fn(|i| next[i] - along * axis[i]);
    let x = unit(x);
    transposed([x, cross(axis, x), axis])
}

fn unit(x: [f64; 3]) -> [f64; 3] {
    let length = x[0].hypot(x[1]).hypot(x[2]);
    x.map(|x| x / length)
}

/// Decomposes a rotation `Rot_z(gamma) Rot_x(alpha) Rot_z(theta)` into bend, twist and angle; the bend is zero if possible.
fn parts(turn: &Matrix<f64>) -> ([f64; 2], [f64; 2], f64) {
    let turn = turn.map(|row| row.map(exact));
    let (x, y) = (turn[0][2], -turn[1][2]);
    let (bend, sine) = if x == 0.0 { ([0.0, 1.0], y) } else { ([x / x.hypot(y), y / x.hypot(y)], x.hypot(y)) };
    // The first row of `Rot_x(alpha) Rot_z(theta)` is `(cos theta, -sin theta, 0)`.
    let [sb, cb] = bend;
    let first = |j: usize| cb * turn[0][j] + sb * turn[1][j];
    (bend, [sine, turn[2][2]], (-first(1)).atan2(first(0)))
}

impl Description {
    /// Converts the links to joints and checks their descriptions.
    pub(super) fn joints(&self) -> Outcome<Vec<Joint>> {
        let mut own: Vec<Option<usize>> = Vec::with_capacity(self.links.len());
        for link in &self.links {
            let count = own.iter().flatten().count();
            own.push(link.mimic.is_none().then_some(count));
        }
        let mut joints: Vec<Joint> = Vec::with_capacity(own.len());
        for (k, link) in self.links.iter().enumerate() {
            self.check_link(k)?;
            let parent = self.parent(k)?;
            let mut joint = self.joint(k, parent, parent.and_then(|parent| joints[parent].axes))?;
            if let Some(leader) = &link.mimic {
                let problem = "expected the name or the number of a link that has a coordinate of its own";
                let found = self.numbered(leader).and_then(|number| own[number.checked_sub(1)?]);
                joint.drive =
                    (found.ok_or_else(|| fault(k, "mimic", problem))?, link.ratio.map_or(1.0, |ratio| ratio.0));
            } else if let Some(own) = own[k] {
                joint.drive = (own, 1.0);
            }
            let offset = link.offset.map_or(0.0, |offset| offset.0);
            if link.prismatic {
                let axis = joint.axis();
                joint.place = core::array::from_fn(|i| joint.place[i] + offset * axis[i]);
            } else {
                joint.theta += offset;
            }
            joints.push(joint);
        }
        Ok(joints)
    }

    /// Converts one link to a joint, except for its drive; `axes` are those of the parent's joint in the parent's frame.
    fn joint(&self, k: usize, parent: Option<usize>, axes: Option<Matrix<f64>>) -> Outcome<Joint> {
        let link = &self.links[k];
        let mut joint = Joint {
            parent,
            bend: [0.0, 1.0],
            twist: [0.0, 1.0],
            theta: link.theta.0,
            place: [0.0; 3],
            slides: link.prismatic,
            drive: (k, 1.0),
            axes: None,
        };
        let turn = if link.is_placed() {
            let key = |what: &str| format!("links[{k}].{what}");
            joint.place = triple(&key("xyz"), &link.xyz, [0.0; 3])?;
            let axis = unit(triple(&key("axis"), &link.axis, SAME[2])?);
            if !axis.iter().all(|x| x.is_finite()) {
                return Err(fault(k, "axis", "expected a vector that is not zero"));
            }
            let own = around(axis);
            joint.axes = (own != SAME).then_some(own);
            product(&turned(triple(&key("rpy"), &link.rpy, [0.0; 3])?), &own)
        } else {
            let [a, alpha] = self.before(k, parent);
            let [sine, cosine] = sine_cosine(alpha);
            (joint.twist, joint.place) = ([sine, cosine], [a, -(link.d.0 * sine), link.d.0 * cosine]);
            if axes.is_none() {
                return Ok(joint);
            }
            product(&about_x([sine, cosine]), &about_z(sine_cosine(joint.theta)))
        };
        let seen = transposed(axes.unwrap_or(SAME));
        (joint.bend, joint.twist, joint.theta) = parts(&product(&seen, &turn));
        joint.place = applied(&seen, joint.place).map(exact);
        Ok(joint)
    }

    /// Returns the length and twist before the joint of a link: a standard row ends where a modified row begins.
    fn before(&self, k: usize, parent: Option<usize>) -> [f64; 2] {
        let of = |k: usize| [self.links[k].a.0, self.links[k].alpha.0];
        if self.is_standard() { parent.map_or([0.0; 2], of) } else { of(k) }
    }

    fn is_standard(&self) -> bool {
        self.chain.as_ref().is_some_and(|chain| chain.convention == Convention::Standard)
    }

    /// Returns the index of a link, from 1, by its name or number; 0 for the base.
    fn numbered(&self, text: &str) -> Option<usize> {
        let named = self.links.iter().position(|link| link.name.as_deref() == Some(text));
        named.map(|at| at + 1).or_else(|| text.parse().ok().filter(|number| *number <= self.links.len()))
    }

    /// Returns the index of the link that carries another one, `None` for the base.
    fn parent(&self, k: usize) -> Outcome<Option<usize>> {
        let Some(text) = &self.links[k].parent else { return Ok(k.checked_sub(1)) };
        let number = self.numbered(text).filter(|number| *number <= k);
        let problem = || {
            fault(
                k,
                "parent",
                &format!("expected the name or the number of a link before it, 0 for the base, found {text:?}"),
            )
        };
        Ok(number.ok_or_else(problem)?.checked_sub(1))
    }

    /// Checks the keys of one link.
    fn check_link(&self, k: usize) -> Outcome<()> {
        let link = &self.links[k];
        let rows = [("a", link.a), ("alpha", link.alpha), ("d", link.d), ("theta", link.theta)];
        let given = [("ratio", link.ratio), ("offset", link.offset)];
        let numbers = rows.into_iter().chain(given.into_iter().filter_map(|(key, x)| Some((key, x?))));
        for (key, x) in numbers {
            if !x.0.is_finite() {
                return Err(fault(k, key, &format!("expected a finite number, found {}", x.0)));
            }
        }
        if let Some((key, _)) = rows.iter().find(|(_, x)| link.is_placed() && x.0 != 0.0) {
            return Err(fault(
                k,
                key,
                "expected a row of Denavit and Hartenberg or `xyz`, `rpy` and `axis`, found both",
            ));
        }
        if link.is_placed() && self.is_standard() {
            return Err(fault(k, "", "`xyz`, `rpy` and `axis` do not go with the convention \"standard\""));
        }
        if link.ratio.is_some_and(|ratio| ratio.0 == 0.0) {
            return Err(fault(k, "ratio", "expected a number other than 0"));
        }
        if let Some((key, _)) = given.iter().find(|(_, x)| x.is_some() && link.mimic.is_none()) {
            return Err(fault(k, key, "expected `mimic` beside it"));
        }
        let Some(name) = &link.name else { return Ok(()) };
        if name.is_empty() || name.chars().count() > 100 || name.chars().any(char::is_control) {
            return Err(fault(k, "name", "expected 1 to 100 characters on one line"));
        }
        let is_taken = self.links[..k].iter().any(|other| other.name.as_ref() == Some(name));
        match is_taken || name.parse::<usize>().is_ok() {
            true => Err(fault(
                k,
                "name",
                &format!("expected a name that no other link has and that is no number, found {name:?}"),
            )),
            false => Ok(()),
        }
    }
}

fn fault(k: usize, key: &str, problem: &str) -> DescriptionError {
    let dot = if key.is_empty() { "" } else { "." };
    DescriptionError::new(format!("links[{k}]{dot}{key}"), problem)
}

/// Parses three finite numbers, or returns the defaults if the key is missing.
pub(super) fn triple(key: &str, given: &Option<Vec<Quantity>>, usual: [f64; 3]) -> Outcome<[f64; 3]> {
    let Some(given) = given else { return Ok(usual) };
    let given: Vec<f64> = given.iter().map(|x| x.0).filter(|x| x.is_finite()).collect();
    given.try_into().map_err(|_| DescriptionError::new(key, "expected three finite numbers [x, y, z]"))
}
