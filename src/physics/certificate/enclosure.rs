//! Enclosure of the mass matrices of a box of states.

use super::arena::Arena;
use super::basis::Basis;
use super::interval::Interval;
use super::number::Number;
use super::spectrum::MatrixForms;
use crate::lagrangian::Lagrangian;
use crate::scalar::Scalar;
use std::sync::Arc;

/// A Lagrangian with its parameters, ready to be evaluated over boxes by any thread.
pub struct Source<'l, L> {
    pub lagrangian: &'l L,
    /// Intervals that hold the parameters.
    pub parameters: Vec<Interval>,
    /// Monomials of the polynomials that enclose what it computes.
    pub basis: Arc<Basis>,
}

/// Questions of the search to a Lagrangian.
pub trait Enclose: Sync {
    /// Number of coordinates `n`.
    fn coordinates(&self) -> usize;
    /// Evaluates boxes, given as `(low, high)` of every coordinate and every velocity, one after the other.
    fn each(&self, boxes: &[&[(f64, f64)]], take: &mut dyn FnMut(usize, MatrixForms) -> bool);
}

impl<'l, L: Lagrangian> Source<'l, L> {
    /// Numbers of any precision; those that no `f64` is equal to are enclosed.
    pub fn new<S: Scalar>(lagrangian: &'l L, parameters: &[S]) -> Self {
        let enclosed = |x: &S| match x.parts() {
            (high, 0.0) => Interval::point(high),
            (high, low) => Interval::point(high) + Interval::point(low),
        };
        let basis = Arc::new(Basis::for_axes(2 * lagrangian.coordinates()));
        Self { lagrangian, parameters: parameters.iter().map(enclosed).collect(), basis }
    }
}

impl<L: Lagrangian> Enclose for Source<'_, L> {
    fn coordinates(&self) -> usize {
        self.lagrangian.coordinates()
    }

    fn each(&self, boxes: &[&[(f64, f64)]], take: &mut dyn FnMut(usize, MatrixForms) -> bool) {
        let n = self.lagrangian.coordinates();
        let arena = Arena::new(n, &self.basis);
        let parameters: Vec<Number<'_>> = self.parameters.iter().map(|x| Number::Constant(*x)).collect();
        for (index, bounds) in boxes.iter().enumerate() {
            arena.clear();
            if !take(index, mass_matrix(self.lagrangian, &arena, &parameters, bounds)) {
                return;
            }
        }
    }
}

/// `d2L/dv dv` over a box.
fn mass_matrix<'a, L: Lagrangian>(
    lagrangian: &L,
    arena: &'a Arena,
    parameters: &[Number<'a>],
    bounds: &[(f64, f64)],
) -> MatrixForms {
    let (n, stride) = (bounds.len() / 2, arena.basis.stride());
    let side = |(axis, &(low, high)): (usize, &(f64, f64))| {
        Number::Variable(arena, arena.variable(axis, Interval::new(low, high), axis.checked_sub(n)))
    };
    let state: Vec<Number<'a>> = bounds.iter().enumerate().map(side).collect();
    let found = lagrangian.lagrangian(parameters, &state[..n], &state[n..]);
    let mut forms = vec![[0.0]; n * n * stride];
    // A Lagrangian that may not be defined, or that read a value.
    let known = found.range().is_bounded() && !arena.was_read();
    for (k, out) in forms.chunks_exact_mut(stride).enumerate() {
        match found {
            Number::Variable(arena, place) if known => {
                out.copy_from_slice(&arena.form(place, arena.second(k / n, k % n)));
            }
            Number::Constant(_) if known => {}
            _ => out.fill([f64::NAN]),
        }
    }
    MatrixForms { n, basis: Arc::clone(&arena.basis), forms, blamed: arena.blamed() }
}

/// Intervals `(n, n)` that hold the elements of the mass matrix `d2L/dv dv` of every state of a box, `(low, high)` of every coordinate and
/// every velocity; everything where the Lagrangian is not defined in the whole box, or not differentiable, as `|v|` at 0.
///
/// Parameters are taken as they are; constants in the Lagrangian's own code are the `f64` that it names.
///
/// # Panics
/// If there are not `n` pairs of each.
#[cfg(test)]
pub(crate) fn mass_matrix_enclosure<L: Lagrangian, S: Scalar>(
    lagrangian: &L,
    parameters: &[S],
    positions: &[(f64, f64)],
    velocities: &[(f64, f64)],
) -> Vec<Interval> {
    let n = lagrangian.coordinates();
    assert!(positions.len() == n && velocities.len() == n, "expected {n} pairs of bounds for positions and velocities");
    let bounds = [positions, velocities].concat();
    let mut found = Vec::new();
    Source::new(lagrangian, parameters).each(&[&bounds], &mut |_, matrix| {
        let forms = matrix.forms.chunks_exact(matrix.basis.stride());
        found = forms.map(|form| super::form::range(&matrix.basis, form, 0)).collect();
        true
    });
    found
}
