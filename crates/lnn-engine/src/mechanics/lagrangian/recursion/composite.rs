//! The mass matrix by the composite rigid body method: a joint moves all links beyond it as one rigid body.

use super::vector::{add, outer, scaled, sum, symmetric};
use super::{Body, Chain, Frame, Load};
use crate::scalar::Real;
use alloc::vec::Vec;

impl<R: Real> Body<R> {
    /// Returns the body in the axes of the previous frame and about its origin.
    fn seen(&self, frame: &Frame<R>) -> Self {
        let turned = frame.outward::<true>(self.first);
        let first = add(turned, scaled(self.mass, frame.place));
        let shifted = sum(&outer(frame.place, turned), &outer(first, frame.place));
        Self { mass: self.mass, first, second: symmetric(sum(&frame.turned(self.second), &shifted)) }
    }
    fn with(&self, other: Self) -> Self {
        let second = sum(&self.second, &other.second);
        Self { mass: self.mass + other.mass, first: add(self.first, other.first), second }
    }
    /// Returns the force and moment for a unit acceleration from rest along or about the axis.
    fn pushed(&self, slides: bool) -> Load<R> {
        let ([x, y, _], j, zero) = (self.first, &self.second, R::zero());
        if slides {
            return Load { force: [zero, zero, self.mass], moment: [y, -x, zero] };
        }
        Load { force: [-y, x, zero], moment: [-j[0][2], -j[1][2], j[0][0] + j[1][1]] }
    }
}

impl<R: Real> Chain<R> {
    /// Computes the lower triangle of the mass matrix, row by row.
    pub(super) fn mass_matrix(&self, q: &[R]) -> Vec<Vec<R>> {
        let own = self.of_joints(q);
        let joints = own.as_deref().unwrap_or(q);
        let frames: Vec<Frame<R>> = self.links.iter().zip(joints).map(|(link, &q)| link.frame(q)).collect();
        let mut bodies: Vec<Body<R>> = self.links.iter().map(|link| link.body).collect();
        for (k, link) in self.links.iter().enumerate().rev() {
            if let Some(parent) = link.parent {
                bodies[parent] = bodies[parent].with(bodies[k].seen(&frames[k]));
            }
        }
        let mut rows: Vec<Vec<R>> = (1..=q.len()).map(|length| vec![R::zero(); length]).collect();
        for (k, link) in self.links.iter().enumerate() {
            let mut load = bodies[k].pushed(link.slides);
            self.add_element(&mut rows, [k, k], load.along(link.slides) + link.armature);
            let mut from = k;
            while let Some(before) = self.links[from].parent {
                load = load.seen::<true>(&frames[from]);
                self.add_element(&mut rows, [k, before], load.along(self.links[before].slides));
                from = before;
            }
        }
        rows
    }

    /// Adds an element of the mass matrix of the joints to that of the coordinates.
    fn add_element(&self, rows: &mut [Vec<R>], [i, j]: [usize; 2], element: R) {
        let Some(drives) = &self.drives else { return rows[i][j] = element };
        let ((a, first), (b, second)) = (drives[i], drives[j]);
        let element = first * second * element;
        // The matrix of the joints is symmetric: if two different joints have the same coordinate, their element counts twice.
        rows[a.max(b)][a.min(b)] += if i != j && a == b { R::two() * element } else { element };
    }
}
