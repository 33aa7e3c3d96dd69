//! Accelerations by articulated bodies: a link feels the links behind it as a body whose inertia has lost what their joints give way to.
//!
//! Up to the sixteen links that a system file may have, a program of this recursion takes more time than one of composite bodies with an
//! elimination; it shares little with them and judges them in tests.
//!
//! The force and the moment on such a body are `n = A dw + B s + b`, `f = B^T dw + C s + c` of its angular acceleration `dw` and the acceleration
//! `s` of its origin.

use super::vector::{Matrix, Vector, add, cross, outer, scaled, sum, symmetric, transposed};
use super::{Chain, Frame, Link, Load, Motion};
use crate::scalar::Real;

/// `A`, `B`, `C` and the load `b`, `c` without acceleration.
#[derive(Clone, Copy)]
struct Articulated<R> {
    angular: Matrix<R>,
    mixed: Matrix<R>,
    linear: Matrix<R>,
    bias: Load<R>,
}

/// What remains of a joint when the accelerations are known up to it.
#[derive(Clone, Copy)]
struct Joint<R> {
    /// Force and moment by the acceleration of the joint.
    push: Load<R>,
    /// Inertia that the joint moves.
    pivot: R,
    /// Torque or force that is left to accelerate it.
    rest: R,
}

impl<R: Real> Articulated<R> {
    /// Of a link alone, which moves so without accelerations.
    fn of(link: &Link<R>, motion: &Motion<R>) -> Self {
        let (zero, [x, y, z], j) = (R::zero(), link.body.first, &link.body.second);
        let angular = [
            [j[1][1] + j[2][2], -j[0][1], -j[0][2]],
            [-j[0][1], j[0][0] + j[2][2], -j[1][2]],
            [-j[0][2], -j[1][2], j[0][0] + j[1][1]],
        ];
        let m = link.body.mass;
        Self {
            angular,
            mixed: [[zero, -z, y], [z, zero, -x], [-y, x, zero]],
            linear: [[m, zero, zero], [zero, m, zero], [zero, zero, m]],
            bias: motion.load(&link.body),
        }
    }

    fn with(&self, other: Self) -> Self {
        Self {
            angular: sum(&self.angular, &other.angular),
            mixed: sum(&self.mixed, &other.mixed),
            linear: sum(&self.linear, &other.linear),
            bias: self.bias.with(other.bias),
        }
    }

    /// The joint with a torque or force on it, and the body that is felt beyond it.
    fn opened(&self, link: &Link<R>, torque: R) -> (Joint<R>, Self) {
        let axis = |m: &Matrix<R>| [m[0][2], m[1][2], m[2][2]];
        let push = if link.slides {
            Load { force: self.linear[2], moment: axis(&self.mixed) }
        } else {
            Load { force: self.mixed[2], moment: self.angular[2] }
        };
        let pivot = push.along(link.slides) + link.armature;
        let rest = torque - self.bias.along(link.slides);
        let give = R::one() / pivot;
        let (force, moment) = (scaled(give, push.force), scaled(give, push.moment));
        let less = |m: &Matrix<R>, a: Vector<R>, b: Vector<R>| difference(m, &outer(a, b));
        let mut open = Self {
            angular: symmetric(less(&self.angular, moment, push.moment)),
            mixed: less(&self.mixed, moment, push.force),
            linear: symmetric(less(&self.linear, force, push.force)),
            bias: self.bias.with(Load { force: scaled(rest, force), moment: scaled(rest, moment) }),
        };
        if link.armature.is_exact_zero() {
            open.give_way(link.slides);
        }
        (Joint { push, pivot, rest }, open)
    }

    /// Along the axis of a joint without drive nothing is felt, which is known exactly.
    fn give_way(&mut self, slides: bool) {
        let zero = R::zero();
        for i in 0..3 {
            if slides {
                self.mixed[i][2] = zero;
                (self.linear[i][2], self.linear[2][i]) = (zero, zero);
            } else {
                self.mixed[2][i] = zero;
                (self.angular[i][2], self.angular[2][i]) = (zero, zero);
            }
        }
    }

    /// In and about the frame before.
    fn seen(&self, frame: &Frame<R>) -> Self {
        let p = frame.place;
        let (angular, mixed, linear) =
            (frame.turned(self.angular), frame.turned(self.mixed), frame.turned(self.linear));
        let linear = symmetric(linear);
        let shifted = sum(&mixed, &crossed(p, &linear));
        // A - B [p] + [p] (B + [p] C)^T, where -B [p] = ([p] B^T)^T.
        let first = transposed(crossed(p, &transposed(mixed)));
        let angular = sum(&sum(&angular, &first), &crossed(p, &transposed(shifted)));
        Self { angular: symmetric(angular), mixed: shifted, linear, bias: self.bias.seen(frame) }
    }
}

impl<R: Real> Chain<R> {
    /// Accelerations under torques and forces of the joints, and the inertias that these move, which are the pivots of the mass matrix from the
    /// tip to the base.
    pub(super) fn forward_dynamics(&self, q: &[R], v: &[R], torques: &[R]) -> (Vec<R>, Vec<R>) {
        let (frames, n) = (self.frames(q), q.len());
        // The motion if no joint was accelerated: forces by velocities and gravity are then those of the bias.
        let mut motion = Motion::of_base(self.gravity);
        let mut bodies = Vec::with_capacity(n);
        for (k, link) in self.links.iter().enumerate() {
            motion = motion.carried(&frames[k], link.slides, (v[k], R::zero()));
            bodies.push(Articulated::of(link, &motion));
        }
        let mut joints = Vec::with_capacity(n);
        for k in (0..n).rev() {
            let (joint, open) = bodies[k].opened(&self.links[k], torques[k]);
            joints.push(joint);
            if let Some(before) = k.checked_sub(1) {
                bodies[before] = bodies[before].with(open.seen(&frames[k]));
            }
        }
        joints.reverse();
        // Accelerations beyond that motion.
        let (mut spinning, mut origin) = ([R::zero(); 3], [R::zero(); 3]);
        let mut accelerations = Vec::with_capacity(n);
        for ((joint, frame), link) in joints.iter().zip(&frames).zip(&self.links) {
            origin = frame.inward(add(origin, cross(spinning, frame.place)));
            spinning = frame.inward(spinning);
            let a = (joint.rest - dot(joint.push.moment, spinning) - dot(joint.push.force, origin)) / joint.pivot;
            if link.slides {
                origin[2] += a
            } else {
                spinning[2] += a
            }
            accelerations.push(a);
        }
        (accelerations, joints.iter().map(|joint| joint.pivot).collect())
    }
}

fn dot<R: Real>(a: Vector<R>, b: Vector<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn difference<R: Real>(a: &Matrix<R>, b: &Matrix<R>) -> Matrix<R> {
    [0, 1, 2].map(|i| [0, 1, 2].map(|k| a[i][k] - b[i][k]))
}

/// `[a]_x m`: the product of each column by `a`.
fn crossed<R: Real>(a: Vector<R>, m: &Matrix<R>) -> Matrix<R> {
    transposed(transposed(*m).map(|column| cross(a, column)))
}
