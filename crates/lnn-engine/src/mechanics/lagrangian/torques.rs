//! Forces for a given motion, computed with the recursion of a chain of links, and a type that computes them state after state.

use super::recursion::Passes;
use super::{EulerLagrange, InverseDynamics, MechanicsError};
use crate::scalar::{Scalar, are_finite};
use alloc::vec::Vec;

/// Computes the forces for accelerations at states `(batch, n)` with the recursion of a model. Returns `None` for a model without
/// recursion, and if a force is not finite or a slice has the wrong length; the general method then reports the error.
pub(super) fn recursive_forces<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    [q, v, a]: [&[S]; 3],
) -> Option<InverseDynamics<S>> {
    let mut external = vec![S::nan(); q.len()];
    if !write_torques(model, [q, v, a], &mut Passes::default(), &mut external) {
        return None;
    }
    let (mut generalized, mut friction, n) = (external.clone(), Vec::new(), model.coordinates());
    if let Some(chain) = model.links().filter(|_| !model.conserves_energy()) {
        friction.extend(v.iter().enumerate().map(|(k, &v)| chain.friction(k % n, v)));
        generalized.iter_mut().zip(&friction).for_each(|(all, &friction)| *all += friction);
    }
    Some(InverseDynamics { generalized, friction, external, constraint: Vec::new(), multipliers: Vec::new() })
}

/// Writes the external forces for accelerations at states with the recursion of a model, if it has one; returns `true` if all are finite.
fn write_torques<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    [q, v, a]: [&[S]; 3],
    buffer: &mut Passes<S>,
    torques: &mut [S],
) -> bool {
    let (Some(chain), n) = (model.links(), model.coordinates()) else { return false };
    if [v.len(), a.len(), torques.len()] != [q.len(); 3] || !q.len().is_multiple_of(n) {
        return false;
    }
    for (row, torques) in torques.chunks_exact_mut(n).enumerate() {
        let [q, v, a] = [q, v, a].map(|x| &x[row * n..][..n]);
        chain.inverse_dynamics([q, v, a], buffer, torques);
        for (k, torque) in torques.iter_mut().enumerate() {
            *torque -= chain.friction(k, v[k]);
        }
    }
    are_finite(torques)
}

/// Computes the external forces for a motion, such as the torques of an arm's motors, state after state with preallocated buffers, for use
/// in a controller.
///
/// The forces equal those of [`InverseDynamics::of`]. For a chain of links they are computed by the recursive Newton-Euler method, and nothing
/// is allocated after the first call.
///
/// ```
/// use lnn::lagrangian::{SystemInstance, Torques};
///
/// // What holds an arm of two rods of 1 m and 1 kg level, g = 9.8 m/s^2.
/// let arm = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
/// let (level, still, mut torques) = ([std::f64::consts::FRAC_PI_2; 2], [0.0; 2], [0.0; 2]);
/// Torques::new(arm.as_ref()).at(&level, &still, &still, &mut torques)?;
/// assert!((torques[0] - 2.0 * 9.8).abs() < 1e-12 && (torques[1] - 9.8).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Torques<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    buffer: Passes<S>,
}

impl<'a, S: Scalar> Torques<'a, S> {
    /// Allocates the buffers for a model.
    pub fn new(model: &'a dyn EulerLagrange<S>) -> Self {
        Self { model, buffer: Passes::default() }
    }

    /// Computes the forces at states `q`, `v` for accelerations `a`, all `(batch, n)` in physical units.
    ///
    /// # Errors
    /// Those of [`InverseDynamics::of`]; also if `torques` has the wrong length.
    pub fn at(&mut self, q: &[S], v: &[S], a: &[S], torques: &mut [S]) -> Result<(), MechanicsError> {
        if torques.len() != q.len() {
            return Err(MechanicsError::Shape { what: "torques", expected: q.len(), found: torques.len() });
        }
        if !write_torques(self.model, [q, v, a], &mut self.buffer, torques) {
            torques.copy_from_slice(&InverseDynamics::of(self.model, q, v, a)?.external);
        }
        Ok(())
    }
}
