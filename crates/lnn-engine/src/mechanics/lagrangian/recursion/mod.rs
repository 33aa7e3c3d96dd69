//! Recursive dynamics of a tree of rigid links; the number of operations grows linearly with the number of links.
//!
//! Vectors are given in the frame of a joint, whose `z` is its axis. From the frame of the link that carries it, `r' = R r + p` with `R =
//! Rot_z(gamma) Rot_x(alpha) Rot_z(theta)`; Denavit-Hartenberg rows have `gamma = 0` and `p = (a, -d sin alpha, d cos alpha)`, and a chain
//! of them skips computations that only a tree needs. A link is a distribution of mass with the moments `m = sum 1`, `h = sum r` and `J =
//! sum r r^T` about the origin of its frame, so that its inertia is `I = tr(J) - J`. With the angular velocity `w` and the acceleration `s`
//! of the origin, less that of gravity, the point `r` has the acceleration `s + B r`, `B = [dw/dt] + w w^T - w^2`, and the link requires
//! the force and the moment
//!
//! `f = m s + B h`,  `n = h x s + sum_k (row k of B J) as a skew matrix`.
//!
//! Source: R. Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapters 5 to 7; W. Khalil and E. Dombre, "Modeling, Identification and
//! Control of Robots", 2002, for the modified convention and for the grouping of constants without separate effect.

mod composite;
mod model;
#[cfg(test)]
mod tests;
mod vector;

pub(super) use model::Recursive;

use crate::scalar::Real;
use alloc::vec::Vec;
pub use vector::{Matrix, Vector, applied, cross, product, transposed};
use vector::{add, scaled};

/// The geometry of a tree of links, independent of the values of its constants.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// Links; each one comes after the link that carries it.
    pub rows: Vec<Row>,
    /// Number of coordinates.
    pub coordinates: usize,
    /// Acceleration of gravity in the frame of the base, in m/s^2.
    pub gravity: [f64; 3],
    /// Speed `s` of dry friction `Fc tanh(q_dot/s)`, in rad/s or m/s.
    pub coulomb_speed: f64,
}

/// A link and the joint that moves it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// The geometry of its joint.
    pub joint: Joint,
    /// Indices of the link's ten constants among the parameters: `m`, `h`, `Ixx`, `Ixy`, `Ixz`, `Iyy`, `Iyz`, `Izz`.
    pub inertia: [usize; 10],
    /// Index of the inertia of the drive.
    pub armature: Option<usize>,
    /// Indices of viscous and dry friction.
    pub friction: Option<[usize; 2]>,
}

/// A joint: the frame in which it moves a link, relative to the joint frame of the link that carries it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    /// Index of the link that carries it; `None` for the base.
    pub parent: Option<usize>,
    /// Sine and cosine of the rotation `gamma` about `z` before the twist.
    pub bend: [f64; 2],
    /// Sine and cosine of the twist.
    pub twist: [f64; 2],
    /// Angle about the joint in rad; a revolute joint adds its coordinate.
    pub theta: f64,
    /// The origin in m; a prismatic joint moves it along its axis.
    pub place: [f64; 3],
    /// `true` if the joint is prismatic.
    pub slides: bool,
    /// Index of the coordinate that moves it, and its motion per unit of that coordinate.
    pub drive: (usize, f64),
    /// The axes of this frame, as columns, in the frame of the link's constants; `None` if the frames coincide.
    pub axes: Option<Matrix<f64>>,
}

impl Joint {
    /// Returns the axis in the frame of the previous joint.
    pub fn axis(&self) -> Vector<f64> {
        let ([sb, cb], [sa, ca]) = (self.bend, self.twist);
        [sb * sa, -(cb * sa), ca]
    }
}

/// Moments of a distribution of mass about a frame's origin.
#[derive(Clone, Copy, Debug)]
struct Body<R> {
    mass: R,
    first: Vector<R>,
    second: Matrix<R>,
}

impl<R: Real> Body<R> {
    /// Converts the ten constants of a link to a body.
    fn of([m, hx, hy, hz, xx, xy, xz, yy, yz, zz]: [R; 10]) -> Self {
        let half = (xx + yy + zz) * R::half();
        let second = [[half - xx, -xy, -xz], [-xy, half - yy, -yz], [-xz, -yz, half - zz]];
        Self { mass: m, first: [hx, hy, hz], second }
    }

    /// Expresses the body in a frame of the same origin with these axes, as columns in its own frame: `A^T h` and `A^T J A`.
    fn along(self, axes: &Matrix<f64>) -> Self {
        let axes = transposed(*axes).map(|axis| axis.map(R::of));
        let halfway = transposed(self.second.map(|row| applied(&axes, row)));
        Self { mass: self.mass, first: applied(&axes, self.first), second: halfway.map(|row| applied(&axes, row)) }
    }

    /// Adds mass `m` at a position, first moment `h` and second moment `j` along an axis through it.
    fn add_on_axis(&mut self, [m, h, j]: [R; 3], place: Vector<R>, axis: Vector<R>) {
        self.mass += m;
        let first = add(scaled(m, place), scaled(h, axis));
        self.first = add(self.first, first);
        let along = add(scaled(h, place), scaled(j, axis));
        for i in 0..3 {
            for k in 0..3 {
                self.second[i][k] += first[i] * place[k] + along[i] * axis[k];
            }
        }
    }
}

/// A link with its joint and the values of all constants.
#[derive(Clone, Copy, Debug)]
struct Link<R> {
    parent: Option<usize>,
    bend: [R; 2],
    twist: [R; 2],
    theta: R,
    place: Vector<R>,
    axis: Vector<R>,
    slides: bool,
    body: Body<R>,
    armature: R,
    viscous: R,
    dry: R,
}

/// Intermediate results of each link in a recursion.
#[derive(Debug)]
pub(super) struct Passes<R> {
    /// Its frame, and the load of its own motion.
    links: Vec<(Frame<R>, Load<R>)>,
    /// Its motion; only used in a tree.
    motions: Vec<Motion<R>>,
}

impl<R> Default for Passes<R> {
    fn default() -> Self {
        Self { links: Vec::new(), motions: Vec::new() }
    }
}

/// A tree of links with values of its constants.
#[derive(Clone, Debug)]
pub struct Chain<R> {
    links: Vec<Link<R>>,
    /// `true` if a link is not carried by the previous one, or has a bend.
    is_tree: bool,
    /// The coordinate of each joint and its motion per unit of that coordinate; `None` if every joint has a separate coordinate.
    drives: Option<Vec<(usize, R)>>,
    gravity: Vector<R>,
    coulomb_speed: R,
}

impl<R: Real> Chain<R> {
    /// Combines a shape with values of its parameters.
    ///
    /// Mass on the axis of a revolute joint also moves with the previous link. Its mass, first and second moment are assigned to that link,
    /// which leaves joint forces unchanged and saves operations.
    pub(super) fn new(shape: &Shape, parameters: &[R]) -> Self {
        let value = |at: Option<usize>| at.map_or(R::zero(), |at| parameters[at]);
        let link = |row: &Row| {
            let (joint, body) = (&row.joint, Body::of(row.inertia.map(|at| parameters[at])));
            Link {
                parent: joint.parent,
                bend: joint.bend.map(R::of),
                twist: joint.twist.map(R::of),
                theta: R::of(joint.theta),
                place: joint.place.map(R::of),
                axis: joint.axis().map(R::of),
                slides: joint.slides,
                body: joint.axes.as_ref().map_or(body, |axes| body.along(axes)),
                armature: value(row.armature),
                viscous: value(row.friction.map(|[viscous, _]| viscous)),
                dry: value(row.friction.map(|[_, dry]| dry)),
            }
        };
        let mut links: Vec<Link<R>> = shape.rows.iter().map(link).collect();
        for k in (0..links.len()).rev().filter(|&k| !shape.rows[k].joint.slides) {
            let own = links[k];
            let Body { mass, first, second } = &mut links[k].body;
            let on_axis = [*mass, first[2], second[2][2]];
            (*mass, first[2], second[2][2]) = (R::zero(), R::zero(), R::zero());
            if let Some(before) = own.parent {
                links[before].body.add_on_axis(on_axis, own.place, own.axis);
            }
        }
        let joints = || shape.rows.iter().map(|row| &row.joint).enumerate();
        let is_tree = joints().any(|(k, joint)| joint.parent != k.checked_sub(1) || joint.bend != [0.0, 1.0]);
        let alone = joints().all(|(k, joint)| joint.drive == (k, 1.0));
        let drives = (!alone).then(|| joints().map(|(_, joint)| (joint.drive.0, R::of(joint.drive.1))).collect());
        Self { links, is_tree, drives, gravity: shape.gravity.map(R::of), coulomb_speed: R::of(shape.coulomb_speed) }
    }

    /// Converts coordinates, velocities or accelerations to those of the joints.
    fn of_joints(&self, x: &[R]) -> Option<Vec<R>> {
        self.drives.as_ref().map(|drives| drives.iter().map(|&(at, ratio)| ratio * x[at]).collect())
    }

    /// Computes the friction torque or force on a coordinate: the sum of `-(Fv q_dot + Fc tanh(q_dot/s))` over the joints that it moves.
    pub(super) fn friction(&self, coordinate: usize, v: R) -> R {
        let own = |joint: usize, v: R| {
            let Link { viscous, dry, .. } = self.links[joint];
            let resting = if dry.is_exact_zero() { R::zero() } else { dry * (v / self.coulomb_speed).tanh() };
            -(viscous * v + resting)
        };
        let Some(drives) = &self.drives else { return own(coordinate, v) };
        let moved = drives.iter().enumerate().filter(|(_, (at, _))| *at == coordinate);
        moved.fold(R::zero(), |sum, (joint, &(_, ratio))| sum + ratio * own(joint, ratio * v))
    }

    /// Writes the torques and forces for the accelerations `a` at a state, `M a + c - g`, by the recursive Newton-Euler method; the buffer
    /// is overwritten.
    pub(super) fn inverse_dynamics(&self, state: [&[R]; 3], buffer: &mut Passes<R>, torques: &mut [R]) {
        let Some(drives) = &self.drives else { return self.joint_forces(state, buffer, torques) };
        let state = state.map(|x| self.of_joints(x).unwrap_or_default());
        let mut forces = vec![R::zero(); drives.len()];
        self.joint_forces(state.each_ref().map(|x| &x[..]), buffer, &mut forces);
        torques.fill(R::zero());
        drives.iter().zip(forces).for_each(|(&(at, ratio), force)| torques[at] += ratio * force);
    }

    /// Computes the torques and forces if every joint has a separate coordinate.
    fn joint_forces(&self, state: [&[R]; 3], buffer: &mut Passes<R>, forces: &mut [R]) {
        buffer.links.clear();
        buffer.motions.clear();
        match self.is_tree {
            true => self.forces_in::<true>(state, buffer, forces),
            false => self.forces_in::<false>(state, buffer, forces),
        }
    }

    /// Computes the torques and forces for a tree or a chain; the buffer must be empty.
    fn forces_in<const TREE: bool>(&self, [q, v, a]: [&[R]; 3], buffer: &mut Passes<R>, forces: &mut [R]) {
        let base = Motion::of_base(self.gravity);
        let mut motion = base;
        for (k, link) in self.links.iter().enumerate() {
            if TREE {
                motion = link.parent.map_or(base, |parent| buffer.motions[parent]);
            }
            let frame = link.frame(q[k]);
            motion = motion.carried::<TREE>(&frame, link.slides, (v[k], a[k]));
            buffer.links.push((frame, motion.load(&link.body)));
            if TREE {
                buffer.motions.push(motion);
            }
        }
        let mut behind: Option<Load<R>> = None;
        for (k, link) in self.links.iter().enumerate().rev() {
            let (frame, load) = buffer.links[k];
            let load = behind.map_or(load, |behind| load.with(behind));
            forces[k] = load.along(link.slides) + link.armature * a[k];
            let seen = load.seen::<TREE>(&frame);
            match (TREE, link.parent) {
                (false, _) => behind = Some(seen),
                (true, Some(parent)) => buffer.links[parent].1 = buffer.links[parent].1.with(seen),
                (true, None) => {}
            }
        }
    }
}

impl<R: Real> Link<R> {
    /// Returns the frame at a value of the coordinate.
    fn frame(&self, q: R) -> Frame<R> {
        let (angle, place) = if self.slides {
            (self.theta, add(self.place, scaled(q, self.axis)))
        } else {
            (self.theta + q, self.place)
        };
        let (sine, cosine) = angle.sin_cos();
        Frame { bend: self.bend, twist: self.twist, turn: [sine, cosine], place }
    }
}

/// The frame of a link relative to its carrier: sines and cosines of bend, twist and angle, and the position of its origin.
#[derive(Clone, Copy, Debug)]
struct Frame<R> {
    bend: [R; 2],
    twist: [R; 2],
    turn: [R; 2],
    place: Vector<R>,
}

impl<R: Real> Frame<R> {
    /// Computes `R^T x`: rotates a vector from the previous frame into this one.
    fn inward<const TREE: bool>(&self, [x, y, z]: Vector<R>) -> Vector<R> {
        let ([sb, cb], [sa, ca], [s, c]) = (self.bend, self.twist, self.turn);
        let (x, y) = if TREE { (cb * x + sb * y, cb * y - sb * x) } else { (x, y) };
        let (y, z) = (ca * y + sa * z, ca * z - sa * y);
        [c * x + s * y, c * y - s * x, z]
    }

    /// Computes `R x`: rotates a vector from this frame into the previous one.
    fn outward<const TREE: bool>(&self, [x, y, z]: Vector<R>) -> Vector<R> {
        let ([sb, cb], [sa, ca], [s, c]) = (self.bend, self.twist, self.turn);
        let (x, y) = (c * x - s * y, s * x + c * y);
        let (y, z) = (ca * y - sa * z, sa * y + ca * z);
        if TREE { [cb * x - sb * y, sb * x + cb * y, z] } else { [x, y, z] }
    }

    /// Computes `R m R^T`.
    fn turned(&self, m: Matrix<R>) -> Matrix<R> {
        let rows = transposed(transposed(m).map(|column| self.outward::<true>(column)));
        rows.map(|row| self.outward::<true>(row))
    }
}

/// Motion of a frame: angular velocity, its derivative, `B`, and the acceleration of the origin minus that of gravity.
#[derive(Clone, Copy, Debug)]
struct Motion<R> {
    turning: Vector<R>,
    spinning: Vector<R>,
    /// The off-diagonal part of `B`, and the negative of its diagonal.
    beside: Matrix<R>,
    inwards: Vector<R>,
    origin: Vector<R>,
}

impl<R: Real> Motion<R> {
    /// Returns the motion of the base, which is at rest: gravity acts as an upward acceleration.
    fn of_base(gravity: Vector<R>) -> Self {
        let still = [R::zero(); 3];
        Self { turning: still, spinning: still, beside: [still; 3], inwards: still, origin: gravity.map(|g| -g) }
    }

    /// Computes `B r`.
    fn swung(&self, r: Vector<R>) -> Vector<R> {
        let row =
            |i: usize, j: usize, k: usize| self.beside[i][j] * r[j] + self.beside[i][k] * r[k] - self.inwards[i] * r[i];
        [row(0, 1, 2), row(1, 2, 0), row(2, 0, 1)]
    }

    /// Returns the motion of the next link, given the velocity and acceleration of its joint.
    fn carried<const TREE: bool>(&self, frame: &Frame<R>, slides: bool, (v, a): (R, R)) -> Self {
        let origin = frame.inward::<TREE>(add(self.origin, self.swung(frame.place)));
        let [x, y, z] = frame.inward::<TREE>(self.turning);
        let spinning = frame.inward::<TREE>(self.spinning);
        if slides {
            let twice = R::two() * v;
            let origin = [origin[0] + twice * y, origin[1] - twice * x, origin[2] + a];
            return Self::of([x, y, z], spinning, origin);
        }
        Self::of([x, y, z + v], [spinning[0] + y * v, spinning[1] - x * v, spinning[2] + a], origin)
    }

    fn of(turning: Vector<R>, spinning: Vector<R>, origin: Vector<R>) -> Self {
        let ([x, y, z], [dx, dy, dz]) = (turning, spinning);
        let (xx, yy, zz, xy, xz, yz) = (x * x, y * y, z * z, x * y, x * z, y * z);
        let none = R::zero();
        let beside = [[none, xy - dz, xz + dy], [xy + dz, none, yz - dx], [xz - dy, yz + dx, none]];
        Self { turning, spinning, beside, inwards: [yy + zz, xx + zz, xx + yy], origin }
    }

    /// Computes the force and moment that this motion of a body requires.
    fn load(&self, body: &Body<R>) -> Load<R> {
        let (b, d, j) = (&self.beside, self.inwards, &body.second);
        let moment = |x: usize, y: usize, z: usize| {
            b[z][x] * j[x][y] - b[y][x] * j[x][z] + b[z][y] * j[y][y] - b[y][z] * j[z][z] + (d[y] - d[z]) * j[y][z]
        };
        Load {
            force: add(scaled(body.mass, self.origin), self.swung(body.first)),
            moment: add(cross(body.first, self.origin), [moment(0, 1, 2), moment(1, 2, 0), moment(2, 0, 1)]),
        }
    }
}

/// A force at the origin of a frame with a moment about it.
#[derive(Clone, Copy, Debug)]
struct Load<R> {
    force: Vector<R>,
    moment: Vector<R>,
}

impl<R: Real> Load<R> {
    /// Returns the load in and about the previous frame.
    fn seen<const TREE: bool>(&self, frame: &Frame<R>) -> Self {
        let force = frame.outward::<TREE>(self.force);
        Self { force, moment: add(frame.outward::<TREE>(self.moment), cross(frame.place, force)) }
    }
    fn with(&self, other: Self) -> Self {
        Self { force: add(self.force, other.force), moment: add(self.moment, other.moment) }
    }
    /// Returns the component of the load along or about the joint axis.
    fn along(&self, slides: bool) -> R {
        if slides { self.force[2] } else { self.moment[2] }
    }
}
