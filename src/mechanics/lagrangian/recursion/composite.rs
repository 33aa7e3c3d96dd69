//! The mass matrix by composite bodies: what a joint moves is one rigid body of the links behind it.

use super::vector::{add, outer, scaled, sum, symmetric};
use super::{Body, Chain, Frame, Load};
use crate::scalar::Real;
use alloc::vec::Vec;

impl<R: Real> Body<R> {
    /// In and about the frame before.
    fn seen(&self, frame: &Frame<R>) -> Self {
        let turned = frame.outward(self.first);
        let first = add(turned, scaled(self.mass, frame.place));
        let shifted = sum(&outer(frame.place, turned), &outer(first, frame.place));
        Self { mass: self.mass, first, second: symmetric(sum(&frame.turned(self.second), &shifted)) }
    }
    fn with(&self, other: Self) -> Self {
        let second = sum(&self.second, &other.second);
        Self { mass: self.mass + other.mass, first: add(self.first, other.first), second }
    }
    /// Force and moment that accelerate it from rest along or about the axis by 1.
    fn pushed(&self, slides: bool) -> Load<R> {
        let ([x, y, _], j, zero) = (self.first, &self.second, R::zero());
        if slides {
            return Load { force: [zero, zero, self.mass], moment: [y, -x, zero] };
        }
        Load { force: [-y, x, zero], moment: [-j[0][2], -j[1][2], j[0][0] + j[1][1]] }
    }
}

impl<R: Real> Chain<R> {
    /// The lower triangle of the mass matrix, row by row.
    pub(super) fn mass_matrix(&self, q: &[R]) -> Vec<Vec<R>> {
        let frames = self.frames(q);
        let mut bodies: Vec<Body<R>> = self.links.iter().map(|link| link.body).collect();
        for k in (1..q.len()).rev() {
            bodies[k - 1] = bodies[k - 1].with(bodies[k].seen(&frames[k]));
        }
        let row = |(k, body): (usize, &Body<R>)| {
            let mut load = body.pushed(self.links[k].slides);
            let mut row = vec![load.along(self.links[k].slides) + self.links[k].armature];
            for before in (0..k).rev() {
                load = load.seen(&frames[before + 1]);
                row.push(load.along(self.links[before].slides));
            }
            row.reverse();
            row
        };
        bodies.iter().enumerate().map(row).collect()
    }
}
