//! Dynamics of a chain of rigid links by recursion over its links, in a number of operations that grows with their number.
//!
//! Vectors stand in the frame of a link, whose `z` is the axis of its joint. From the frame before, `r' = R r + p` with
//! `R = Rot_x(alpha) Rot_z(theta)` and `p = (a, -d sin alpha, d cos alpha)`. A link is a distribution of mass with the moments
//! `m = sum 1`, `h = sum r` and `J = sum r r^T` about the origin of its frame, so that its inertia is `I = tr(J) - J`. With the angular
//! velocity `w` and the acceleration `s` of the origin, less that of gravity, the point `r` is accelerated by `s + B r`,
//! `B = [dw/dt] + w w^T - w^2`, and the link takes the force and the moment
//!
//! `f = m s + B h`,  `n = h x s + sum_k (row k of B J) as a skew matrix`.
//!
//! Source: R. Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapters 5 to 7; W. Khalil and E. Dombre, "Modeling, Identification and
//! Control of Robots", 2002, for the modified convention and for the constants that have no effect of their own.

mod composite;
mod model;
#[cfg(test)]
mod tests;
mod vector;

pub(super) use model::Recursive;

use crate::scalar::Real;
use alloc::vec::Vec;
use vector::{Matrix, Vector, add, cross, scaled, transposed};

/// A chain of links whatever its constants are: rows of Denavit and Hartenberg in the modified convention.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// From the base to the tip.
    pub rows: Vec<Row>,
    /// Acceleration of gravity in the frame of the base, in m/s^2.
    pub gravity: [f64; 3],
    /// Speed `s` of dry friction `Fc tanh(q_dot/s)`, in rad/s or m/s.
    pub coulomb_speed: f64,
}

/// A link and the joint that moves it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// Length in m.
    pub a: f64,
    /// Sine and cosine of the twist.
    pub twist: [f64; 2],
    /// Offset along the joint in m; what a sliding joint adds to.
    pub d: f64,
    /// Angle about the joint in rad; what a turning joint adds to.
    pub theta: f64,
    /// `true` if the joint slides.
    pub slides: bool,
    /// Where the ten constants of the link stand among the parameters: `m`, `h`, `Ixx`, `Ixy`, `Ixz`, `Iyy`, `Iyz`, `Izz`.
    pub inertia: [usize; 10],
    /// Index of the inertia of the drive.
    pub armature: Option<usize>,
    /// Indices of viscous and dry friction.
    pub friction: Option<[usize; 2]>,
}

/// Moments of a distribution of mass about a frame's origin.
#[derive(Clone, Copy, Debug)]
struct Body<R> {
    mass: R,
    first: Vector<R>,
    second: Matrix<R>,
}

impl<R: Real> Body<R> {
    /// Of the ten constants of a link.
    fn of([m, hx, hy, hz, xx, xy, xz, yy, yz, zz]: [R; 10]) -> Self {
        let half = (xx + yy + zz) * R::half();
        let second = [[half - xx, -xy, -xz], [-xy, half - yy, -yz], [-xz, -yz, half - zz]];
        Self { mass: m, first: [hx, hy, hz], second }
    }

    /// Adds mass `m` at a place, first moment `h` and second moment `j` along an axis through it.
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

/// A link with its joint, all constants known.
#[derive(Clone, Copy, Debug)]
struct Link<R> {
    a: R,
    twist: [R; 2],
    d: R,
    theta: R,
    slides: bool,
    body: Body<R>,
    armature: R,
    viscous: R,
    dry: R,
}

/// Data of each link during a recursion: its frame, and the forces that the link alone needs to move.
pub(super) type Passes<R> = Vec<(Frame<R>, Load<R>)>;

/// A chain of links with its constants.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct Chain<R> {
    links: Vec<Link<R>>,
    gravity: Vector<R>,
    coulomb_speed: R,
}

impl<R: Real> Chain<R> {
    /// A shape with values of its parameters.
    ///
    /// What lies on the axis of a joint that turns moves with the link before as well: its mass, first and second moment are counted there,
    /// which changes no force of a joint and leaves less to compute.
    pub(super) fn new(shape: &Shape, parameters: &[R]) -> Self {
        let value = |at: Option<usize>| at.map_or(R::zero(), |at| parameters[at]);
        let link = |row: &Row| Link {
            a: R::of(row.a),
            twist: row.twist.map(R::of),
            d: R::of(row.d),
            theta: R::of(row.theta),
            slides: row.slides,
            body: Body::of(row.inertia.map(|at| parameters[at])),
            armature: value(row.armature),
            viscous: value(row.friction.map(|[viscous, _]| viscous)),
            dry: value(row.friction.map(|[_, dry]| dry)),
        };
        let mut links: Vec<Link<R>> = shape.rows.iter().map(link).collect();
        for k in (0..links.len()).rev().filter(|&k| !shape.rows[k].slides) {
            let own = links[k];
            let Body { mass, first, second } = &mut links[k].body;
            let on_axis = [*mass, first[2], second[2][2]];
            (*mass, first[2], second[2][2]) = (R::zero(), R::zero(), R::zero());
            if let Some(before) = k.checked_sub(1) {
                let [sine, cosine] = own.twist;
                let axis = [R::zero(), -sine, cosine];
                let place = add([own.a, R::zero(), R::zero()], scaled(own.d, axis));
                links[before].body.add_on_axis(on_axis, place, axis);
            }
        }
        Self { links, gravity: shape.gravity.map(R::of), coulomb_speed: R::of(shape.coulomb_speed) }
    }

    /// Frames of the links at a place.
    fn frames(&self, q: &[R]) -> Vec<Frame<R>> {
        self.links.iter().zip(q).map(|(link, &q)| link.frame(q)).collect()
    }

    /// Torque or force of friction in a joint, `-(Fv q_dot + Fc tanh(q_dot/s))`.
    pub(super) fn friction(&self, joint: usize, v: R) -> R {
        let Link { viscous, dry, .. } = self.links[joint];
        let resting = if dry.is_exact_zero() { R::zero() } else { dry * (v / self.coulomb_speed).tanh() };
        -(viscous * v + resting)
    }

    /// Writes the torques and forces that give a state the accelerations `a`, `M a + c - g`, by the recursion of Newton and Euler; the buffer
    /// is overwritten.
    pub(super) fn inverse_dynamics(&self, [q, v, a]: [&[R]; 3], buffer: &mut Passes<R>, torques: &mut [R]) {
        buffer.clear();
        let mut motion = Motion::of_base(self.gravity);
        for (k, link) in self.links.iter().enumerate() {
            let frame = link.frame(q[k]);
            motion = motion.carried(&frame, link.slides, (v[k], a[k]));
            buffer.push((frame, motion.load(&link.body)));
        }
        let mut behind: Option<Load<R>> = None;
        for (k, (frame, load)) in buffer.iter().enumerate().rev() {
            let load = behind.map_or(*load, |behind| load.with(behind));
            torques[k] = load.along(self.links[k].slides) + self.links[k].armature * a[k];
            behind = Some(load.seen(frame));
        }
    }
}

impl<R: Real> Link<R> {
    /// The frame at a value of the coordinate.
    fn frame(&self, q: R) -> Frame<R> {
        let (angle, along) = if self.slides { (self.theta, self.d + q) } else { (self.theta + q, self.d) };
        let (sine, cosine) = angle.sin_cos();
        let [sa, ca] = self.twist;
        Frame { twist: self.twist, turn: [sine, cosine], place: [self.a, -(along * sa), along * ca] }
    }
}

/// Where a link is, seen from the previous one: sines and cosines of twist and angle, and the place of its origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame<R> {
    twist: [R; 2],
    turn: [R; 2],
    place: Vector<R>,
}

impl<R: Real> Frame<R> {
    /// `R^T x`: a vector of the frame before in this one.
    fn inward(&self, [x, y, z]: Vector<R>) -> Vector<R> {
        let ([sa, ca], [s, c]) = (self.twist, self.turn);
        let (y, z) = (ca * y + sa * z, ca * z - sa * y);
        [c * x + s * y, c * y - s * x, z]
    }

    /// `R x`: a vector of this frame in the previous one.
    fn outward(&self, [x, y, z]: Vector<R>) -> Vector<R> {
        let ([sa, ca], [s, c]) = (self.twist, self.turn);
        let (x, y) = (c * x - s * y, s * x + c * y);
        [x, ca * y - sa * z, sa * y + ca * z]
    }

    /// `R m R^T`.
    fn turned(&self, m: Matrix<R>) -> Matrix<R> {
        let rows = transposed(transposed(m).map(|column| self.outward(column)));
        rows.map(|row| self.outward(row))
    }
}

/// Motion of a frame: angular velocity, its derivative, `B`, and the acceleration of the origin less that of gravity.
#[derive(Clone, Copy, Debug)]
struct Motion<R> {
    turning: Vector<R>,
    spinning: Vector<R>,
    /// `B` beside its diagonal, and the negative of its diagonal.
    beside: Matrix<R>,
    inwards: Vector<R>,
    origin: Vector<R>,
}

impl<R: Real> Motion<R> {
    /// Of the base, which rests: that it does not fall is as if it was accelerated upwards.
    fn of_base(gravity: Vector<R>) -> Self {
        let still = [R::zero(); 3];
        Self { turning: still, spinning: still, beside: [still; 3], inwards: still, origin: gravity.map(|g| -g) }
    }

    /// `B r`.
    fn swung(&self, r: Vector<R>) -> Vector<R> {
        let row =
            |i: usize, j: usize, k: usize| self.beside[i][j] * r[j] + self.beside[i][k] * r[k] - self.inwards[i] * r[i];
        [row(0, 1, 2), row(1, 2, 0), row(2, 0, 1)]
    }

    /// Of the next link, whose joint moves with a velocity and an acceleration.
    fn carried(&self, frame: &Frame<R>, slides: bool, (v, a): (R, R)) -> Self {
        let origin = frame.inward(add(self.origin, self.swung(frame.place)));
        let [x, y, z] = frame.inward(self.turning);
        let spinning = frame.inward(self.spinning);
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

    /// Force and moment that a body takes to move so.
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
pub(super) struct Load<R> {
    force: Vector<R>,
    moment: Vector<R>,
}

impl<R: Real> Load<R> {
    /// In and about the previous frame.
    fn seen(&self, frame: &Frame<R>) -> Self {
        let force = frame.outward(self.force);
        Self { force, moment: add(frame.outward(self.moment), cross(frame.place, force)) }
    }
    fn with(&self, other: Self) -> Self {
        Self { force: add(self.force, other.force), moment: add(self.moment, other.moment) }
    }
    /// Forces and moments that the joint transmits.
    fn along(&self, slides: bool) -> R {
        if slides { self.force[2] } else { self.moment[2] }
    }
}
