//! The inverse question: which forces make a motion.

use super::failures::not_finite;
use super::{EulerLagrange, MechanicsError, Request, Terms};
use crate::scalar::{Real, Scalar};

/// Generalized forces of known states and accelerations, `(batch, n)`, in the unit of `L` per unit of each coordinate.
///
/// `generalized = friction + external`; the three say
///
/// ```text
/// generalized = M a + c - g      everything that acts beside the forces of L, friction included
/// friction    = -dD/dv           what the model's own friction gives, nothing for a model without
/// external    = M a + c - g + dD/dv      what has to be applied from outside to move so
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct InverseDynamics<S> {
    /// All force beside that of `L`, friction included.
    pub generalized: Vec<S>,
    /// Force of the model's friction; empty for a model that
    /// [conserves its energy](EulerLagrange::conserves_energy).
    pub friction: Vec<S>,
    /// Force from outside: the torque of a motor, say; what a model learned with known forces takes for those.
    pub external: Vec<S>,
}

/// Forces that give the states `(q, v)` the accelerations `a`, all `(batch, n)` in physical units. No mass matrix is
/// inverted: it may be singular.
///
/// ```
/// use lnn::lagrangian::{configure, inverse_dynamics};
///
/// // What holds an arm of two rods of 1 m and 1 kg level, g = 9.8 m/s^2.
/// let arm = configure::<f64>("double-pendulum", &[])?.build()?;
/// let level = [std::f64::consts::FRAC_PI_2; 2];
/// let torque = inverse_dynamics(arm.as_ref(), &level, &[0.0; 2], &[0.0; 2])?.external;
/// assert!((torque[0] - 2.0 * 9.8).abs() < 1e-12 && (torque[1] - 9.8).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`MechanicsError`] of the model; accelerations of another shape or that are not finite.
pub fn inverse_dynamics<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> Result<InverseDynamics<S>, MechanicsError> {
    let (forces, failures) = inverse_dynamics_by_rows(model, q, v, a)?;
    failures.first().map_or(Ok(forces), |&error| Err(error))
}

/// Parts of the external force of known states and accelerations, `(batch, n)` each: what the motion asks for is
/// `inertial + coriolis + gravity - friction`.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceParts<S> {
    /// `M a`.
    pub inertial: Vec<S>,
    /// What the velocities add: the Coriolis and centrifugal forces.
    pub coriolis: Vec<S>,
    /// `-dL/dq` at rest: what holds the state where it is, against gravity and springs.
    pub gravity: Vec<S>,
    /// `-dD/dv`; empty for a model that [conserves its energy](EulerLagrange::conserves_energy).
    pub friction: Vec<S>,
}

/// The parts of [`inverse_dynamics`].
///
/// # Errors
/// As [`inverse_dynamics`].
pub fn force_parts<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> Result<ForceParts<S>, MechanicsError> {
    let (parts, failures) = force_parts_by_rows(model, q, v, a)?;
    failures.first().map_or(Ok(parts), |&error| Err(error))
}

/// [`force_parts`] with an error for every row that fails, whose inertial part is `NaN`.
///
/// # Errors
/// [`MechanicsError`] that is about no row.
pub(crate) fn force_parts_by_rows<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> Result<(ForceParts<S>, Vec<MechanicsError>), MechanicsError> {
    let still = vec![<S as Real>::zero(); v.len()];
    let (moving, failures) = inverse_dynamics_by_rows(model, q, v, a)?;
    let coasting = inverse_dynamics_by_rows(model, q, v, &still)?.0.generalized;
    let gravity = inverse_dynamics_by_rows(model, q, &still, &still)?.0.generalized;
    let less = |from: &[S], what: &[S]| from.iter().zip(what).map(|(&from, &what)| from - what).collect::<Vec<S>>();
    let (inertial, coriolis) = (less(&moving.generalized, &coasting), less(&coasting, &gravity));
    Ok((ForceParts { inertial, coriolis, gravity, friction: moving.friction }, failures))
}

/// [`inverse_dynamics`] with an error for every row that fails, whose forces are `NaN`.
///
/// # Errors
/// [`MechanicsError`] that is about no row.
pub(crate) fn inverse_dynamics_by_rows<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> Result<(InverseDynamics<S>, Vec<MechanicsError>), MechanicsError> {
    let n = model.coordinates();
    if a.len() != v.len() {
        return Err(MechanicsError::Shape { what: "accelerations", expected: v.len(), found: a.len() });
    }
    let mut terms = Terms::default();
    let request = Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ | Request::FORCE;
    let outcome = model.terms(q, v, request, &mut terms);
    let failed = terms.drain_failures(outcome)?;
    let mut generalized = Vec::with_capacity(a.len());
    for (k, a) in a.chunks(n.max(1)).enumerate() {
        for i in 0..n {
            let row = &terms.mass_matrix[(k * n + i) * n..(k * n + i + 1) * n];
            let inertia = row.iter().zip(a).fold(<S as Real>::zero(), |sum, (&m, &a)| sum + m * a);
            generalized.push(inertia + terms.coriolis[k * n + i] - terms.dl_dq[k * n + i]);
        }
    }
    terms.prepend_failures(not_finite("generalized force", &generalized, n));
    terms.prepend_failures(failed);
    let (mut friction, failures) = (terms.force, terms.failures);
    for row in failures.iter().filter_map(MechanicsError::row) {
        for forces in [&mut generalized, &mut friction].into_iter().filter(|forces| !forces.is_empty()) {
            forces[row * n..(row + 1) * n].fill(S::nan());
        }
    }
    let external = match friction.as_slice() {
        [] => generalized.clone(),
        friction => generalized.iter().zip(friction).map(|(&all, &friction)| all - friction).collect(),
    };
    Ok((InverseDynamics { generalized, friction, external }, failures))
}
