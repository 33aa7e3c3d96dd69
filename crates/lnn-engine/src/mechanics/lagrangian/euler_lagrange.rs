//! Solves for accelerations and energy, given the terms `L`, `p`, `g`, `M`, `c`, `Q`; and for the forces that produce a given motion.

use super::constraints::{Motion, accelerate, along_rows, dot, length};
use super::drives::{driven, require};
use super::error::not_finite;
use super::torques::recursive_forces;
use super::{EulerLagrange, MechanicsError, Request, Terms};
use crate::lagrangian::thresholds::NEAR_CONSTRAINTS;
use crate::linalg::Workspace;
use crate::scalar::{Real, Scalar, update};
use alloc::vec::Vec;

impl<S: Scalar> Terms<S> {
    /// Clears every field but keeps the buffers.
    pub fn clear(&mut self) {
        let Self {
            lagrangian,
            momentum,
            dl_dq,
            mass_matrix,
            coriolis,
            force,
            dissipation,
            acceleration,
            energy,
            failures,
            ..
        } = self;
        failures.clear();
        for field in [lagrangian, momentum, dl_dq, mass_matrix, coriolis, force, dissipation, acceleration, energy] {
            field.clear();
        }
        self.clear_constraints();
    }

    /// Clears the constraint fields, for a model without constraints.
    pub(super) fn clear_constraints(&mut self) {
        self.constraints = 0;
        let Self { constraint_matrix, constraint_drift, multipliers, constraint_force, .. } = self;
        for field in [constraint_matrix, constraint_drift, multipliers, constraint_force] {
            field.clear();
        }
    }

    /// Computes the forces of constraint from their multipliers.
    pub(super) fn sum_constraint_forces(&mut self, n: usize) {
        let m = self.constraints;
        self.constraint_force.clear();
        if m == 0 {
            return;
        }
        self.constraint_force.resize(self.multipliers.len() / m * n, <S as Real>::zero());
        let rows = self.constraint_matrix.chunks_exact(m * n).zip(self.multipliers.chunks_exact(m));
        for (force, (matrix, multipliers)) in self.constraint_force.chunks_exact_mut(n).zip(rows) {
            for (row, &multiplier) in matrix.chunks_exact(n).zip(multipliers) {
                force.iter_mut().zip(row).for_each(|(force, &a)| *force += multiplier * a);
            }
        }
    }

    /// Computes `a = M^-1 (g - c + Q)` and `E = p.v - L` if requested, then checks every filled field. With constraints in the terms, it
    /// computes accelerations, multipliers and forces of constraint.
    ///
    /// `v` is `(batch, n)`; `L`, `p`, `g`, `M`, `c` must be filled as far as the request needs them, and `Q` if there are forces that do
    /// not follow from `L`. A single coordinate is solved by division.
    ///
    /// # Errors
    /// [`MechanicsError`] for the first row with a singular mass matrix or a term that is not finite; [`Terms::failures`] lists every such
    /// row. Accelerations without a solution are `NaN`, and everything else is filled.
    pub fn complete(
        &mut self,
        n: usize,
        v: &[S],
        request: Request,
        workspace: &mut Workspace<S>,
    ) -> Result<(), MechanicsError> {
        let batch = v.len() / n.max(1);
        let expect = |what, expected: usize, found: usize| {
            if expected == found { Ok(()) } else { Err(MechanicsError::Shape { what, expected, found }) }
        };
        self.failures.clear();
        if request.includes(Request::ENERGY) {
            expect("Lagrangians", batch, self.lagrangian.len())?;
            expect("momenta", batch * n, self.momentum.len())?;
            self.energy.clear();
            for (row, &lagrangian) in self.lagrangian.iter().enumerate() {
                let mut energy = -lagrangian;
                for i in row * n..(row + 1) * n {
                    energy += self.momentum[i] * v[i];
                }
                self.energy.push(energy);
            }
        }
        if request.includes(Request::ACCELERATION) {
            expect("mass matrices", batch * n * n, self.mass_matrix.len())?;
            expect("dL/dq", batch * n, self.dl_dq.len())?;
            expect("Coriolis terms", batch * n, self.coriolis.len())?;
            let m = self.constraints;
            expect("constraint rows", batch * m * n, self.constraint_matrix.len())?;
            expect("constraint drifts", batch * m, self.constraint_drift.len())?;
            for (field, size) in [(&mut self.acceleration, batch * n), (&mut self.multipliers, batch * m)] {
                field.clear();
                field.resize(size, S::nan());
            }
            let mut right = workspace.take_vector();
            right.clear();
            right.extend_from_slice(&self.dl_dq);
            update(&mut right, &self.coriolis, |right, c| *right -= c);
            if !self.force.is_empty() {
                expect("generalized forces", batch * n, self.force.len())?;
                update(&mut right, &self.force, |right, force| *right += force);
            }
            let motion = Motion {
                size: (n, m),
                mass: &self.mass_matrix,
                constraints: &self.constraint_matrix,
                drift: &self.constraint_drift,
            };
            let found = (&mut self.acceleration[..], &mut self.multipliers[..]);
            accelerate(motion, &right, found, workspace, &mut self.failures);
            self.sum_constraint_forces(n);
            workspace.give_vector(right);
        }
        // An input that is not finite is reported in preference to the failed solution.
        let m = self.constraints;
        let fields: [(&'static str, &[S], usize); 10] = [
            ("Lagrangian", &self.lagrangian, 1),
            ("momentum", &self.momentum, n),
            ("dL/dq", &self.dl_dq, n),
            ("mass matrix", &self.mass_matrix, n * n),
            ("Coriolis term", &self.coriolis, n),
            ("generalized force", &self.force, n),
            ("dissipated power", &self.dissipation, 1),
            ("constraint matrix", &self.constraint_matrix, m * n),
            ("constraint drift", &self.constraint_drift, m),
            ("energy", &self.energy, 1),
        ];
        let mut found = Vec::new();
        for &(what, field, width) in &fields {
            not_finite(what, field, width, &mut found);
        }
        self.prepend_failures(found);
        self.outcome()
    }

    /// Adds external forces, `(batch, n)`, to terms that were computed with [`Request::ACCELERATION`] without a failure: adds `M^-1 Q` to
    /// the accelerations, `Q` to the forces and `-v.Q` to the dissipated power.
    ///
    /// # Errors
    /// [`MechanicsError`] for the first row whose force is not finite or whose mass matrix is singular.
    pub fn add_force(
        &mut self,
        n: usize,
        v: &[S],
        external: &[S],
        workspace: &mut Workspace<S>,
    ) -> Result<(), MechanicsError> {
        let shape = |what, expected, found| Err(MechanicsError::Shape { what, expected, found });
        let (size, zero) = (v.len(), <S as Real>::zero());
        if external.len() != size {
            return shape("external forces", size, external.len());
        }
        if self.mass_matrix.len() != size * n {
            return shape("mass matrices", size * n, self.mass_matrix.len());
        }
        if self.acceleration.len() != size {
            return shape("accelerations", size, self.acceleration.len());
        }
        self.failures.clear();
        let mut found = Vec::new();
        not_finite("external force", external, n, &mut found);
        let mut change = workspace.take_vector();
        change.clear();
        change.resize(size, S::nan());
        let mut pull = vec![zero; self.multipliers.len()];
        let motion = Motion {
            size: (n, self.constraints),
            mass: &self.mass_matrix,
            constraints: &self.constraint_matrix,
            drift: &[],
        };
        accelerate(motion, external, (&mut change, &mut pull), workspace, &mut self.failures);
        update(&mut self.acceleration, &change, |a, change| *a += change);
        update(&mut self.multipliers, &pull, |multiplier, change| *multiplier += change);
        self.sum_constraint_forces(n);
        workspace.give_vector(change);
        self.force.resize(size, zero);
        update(&mut self.force, external, |force, external| *force += external);
        self.dissipation.resize(size / n.max(1), zero);
        for ((power, v), external) in self.dissipation.iter_mut().zip(v.chunks(n)).zip(external.chunks(n)) {
            *power -= v.iter().zip(external).fold(zero, |sum, (&v, &q)| sum + v * q);
        }
        self.prepend_failures(found);
        self.outcome()
    }
}

/// Generalized forces for given states and accelerations, `(batch, n)`, in the unit of `L` per unit of each coordinate.
///
/// `generalized = friction + external + constraint`, where
///
/// ```text
/// generalized = M a + c - g      everything that acts beside the forces of L, friction included
/// friction    = -dD/dv           what the model's own friction gives, nothing for a model without
/// external    = P (M a + c - g + dD/dv)     what has to be applied from outside to move so
/// constraint  = A^T lambda       what the constraints carry of it, nothing for a model without
/// ```
///
/// `P` removes the component along the rows `A` of constraints. A motion determines an external force only up to forces along the rows,
/// which the constraints carry; `external` is the smallest solution.
#[derive(Clone, Debug, PartialEq)]
pub struct InverseDynamics<S> {
    /// All forces that are not in `L`, including friction.
    pub generalized: Vec<S>,
    /// Force of the model's friction; empty for a model that [conserves its energy](EulerLagrange::conserves_energy).
    pub friction: Vec<S>,
    /// External force, such as the torque of a motor; for a model learned with known forces, its prediction of these.
    pub external: Vec<S>,
    /// Force of the constraints under the external force; empty for a model without constraints.
    pub constraint: Vec<S>,
    /// Multipliers `lambda` of the constraints, `(batch, m)`.
    pub multipliers: Vec<S>,
}

impl<S: Scalar> InverseDynamics<S> {
    /// Computes the forces that produce the accelerations `a` at the states `(q, v)`, all `(batch, n)` in physical units. No mass matrix is
    /// inverted, so it may be singular.
    ///
    /// ```
    /// use lnn::lagrangian::{InverseDynamics, SystemInstance};
    ///
    /// // What holds an arm of two rods of 1 m and 1 kg level, g = 9.8 m/s^2.
    /// let arm = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
    /// let level = [std::f64::consts::FRAC_PI_2; 2];
    /// let torque = InverseDynamics::of(arm.as_ref(), &level, &[0.0; 2], &[0.0; 2])?.external;
    /// assert!((torque[0] - 2.0 * 9.8).abs() < 1e-12 && (torque[1] - 9.8).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`MechanicsError`] of the model; also if the accelerations have another shape or are not finite.
    pub fn of(model: &dyn EulerLagrange<S>, q: &[S], v: &[S], a: &[S]) -> Result<Self, MechanicsError> {
        inverse_dynamics_by_drives(model, &[], [q, v, a])
    }
}

/// Computes [`InverseDynamics::of`] with drives, given by the indices of their coordinates: the external force is 0 on all other coordinates.
/// It is unique if there are as many drives as degrees of freedom, and the smallest one if there are more. Without drives, every coordinate
/// is driven.
///
/// # Errors
/// Those of [`InverseDynamics::of`]; [`MechanicsError::Drives`] for fewer drives than degrees of freedom, [`MechanicsError::Undriven`] for a
/// state that can move while the drives are at rest.
pub fn inverse_dynamics_by_drives<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    drives: &[usize],
    states: [&[S]; 3],
) -> Result<InverseDynamics<S>, MechanicsError> {
    let (forces, failures) = inverse_dynamics_by_rows(model, drives, states, &[])?;
    failures.first().map_or(Ok(forces), |&error| Err(error))
}

/// Components of the external force for given states and accelerations, `(batch, n)` each: the motion requires `inertial + coriolis +
/// gravity - friction`, part of which constraints may carry.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceParts<S> {
    /// `M a`.
    pub inertial: Vec<S>,
    /// Coriolis and centrifugal forces.
    pub coriolis: Vec<S>,
    /// `-dL/dq` at rest: the force that balances gravity and springs.
    pub gravity: Vec<S>,
    /// `-dD/dv`; empty for a model that [conserves its energy](EulerLagrange::conserves_energy).
    pub friction: Vec<S>,
}

impl<S: Scalar> ForceParts<S> {
    /// Computes the components of the forces of [`InverseDynamics::of`].
    ///
    /// # Errors
    /// Those of [`InverseDynamics::of`].
    pub fn of(model: &dyn EulerLagrange<S>, q: &[S], v: &[S], a: &[S]) -> Result<Self, MechanicsError> {
        let (parts, failures) = force_parts_by_rows(model, [q, v, a], &[])?;
        failures.first().map_or(Ok(parts), |&error| Err(error))
    }
}

/// Computes [`ForceParts::of`] at times `(batch)`, which only a time-dependent model needs. Returns an error for every row that fails, whose
/// inertial part is `NaN`. If the momentum depends on the time, its partial derivative by the time counts as gravity.
///
/// # Errors
/// A [`MechanicsError`] that concerns more than single rows.
pub fn force_parts_by_rows<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    [q, v, a]: [&[S]; 3],
    times: &[S],
) -> Result<(ForceParts<S>, Vec<MechanicsError>), MechanicsError> {
    let still = vec![<S as Real>::zero(); v.len()];
    let (moving, failures) = inverse_dynamics_by_rows(model, &[], [q, v, a], times)?;
    let generalized = |v: &[S]| match recursive_forces(model, [q, v, &still]) {
        Some(found) => Ok(found.generalized),
        None => Ok(all_forces(model, [q, v, &still], times)?.0),
    };
    let (coasting, gravity) = (generalized(v)?, generalized(&still)?);
    let less = |from: &[S], what: &[S]| from.iter().zip(what).map(|(&from, &what)| from - what).collect::<Vec<S>>();
    let (inertial, coriolis) = (less(&moving.generalized, &coasting), less(&coasting, &gravity));
    Ok((ForceParts { inertial, coriolis, gravity, friction: moving.friction }, failures))
}

/// Computes `inverse_dynamics_by_drives` at times `(batch)`, which only a time-dependent model needs. Returns an error for every row that
/// fails, whose forces are `NaN`.
///
/// # Errors
/// A [`MechanicsError`] that concerns more than single rows.
pub fn inverse_dynamics_by_rows<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    drives: &[usize],
    [q, v, a]: [&[S]; 3],
    times: &[S],
) -> Result<(InverseDynamics<S>, Vec<MechanicsError>), MechanicsError> {
    let n = model.coordinates();
    if !drives.is_empty() {
        require(n, model.manifold(), drives)?;
    }
    if let Some(found) = recursive_forces(model, [q, v, a]) {
        return Ok((found, Vec::new()));
    }
    let (mut generalized, mut terms) = all_forces(model, [q, v, a], times)?;
    let held = Held::of(n, &terms, (&generalized, a), drives);
    terms.prepend_failures(held.refused);
    let Held { mut external, mut constraint, mut multipliers, .. } = held;
    let (mut friction, failures, m) = (terms.force, terms.failures, terms.constraints);
    for row in failures.iter().filter_map(MechanicsError::row) {
        for forces in [&mut generalized, &mut friction, &mut external, &mut constraint] {
            forces.iter_mut().skip(row * n).take(n).for_each(|x| *x = S::nan());
        }
        multipliers.iter_mut().skip(row * m).take(m).for_each(|x| *x = S::nan());
    }
    Ok((InverseDynamics { generalized, friction, external, constraint, multipliers }, failures))
}

/// Computes `M a + c - g` of every row, and its terms; the failures list the rows that fail.
fn all_forces<S: Scalar>(
    model: &dyn EulerLagrange<S>,
    [q, v, a]: [&[S]; 3],
    times: &[S],
) -> Result<(Vec<S>, Terms<S>), MechanicsError> {
    let n = model.coordinates();
    if a.len() != v.len() {
        return Err(MechanicsError::Shape { what: "accelerations", expected: v.len(), found: a.len() });
    }
    let mut terms = Terms::default();
    let request = Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ | Request::FORCE | Request::CONSTRAINTS;
    let outcome = model.terms_at(times, q, v, request, &mut terms);
    let failed = terms.drain_failures(outcome)?;
    let mut generalized = Vec::with_capacity(a.len());
    for (k, a) in a.chunks(n.max(1)).enumerate() {
        for i in 0..n {
            let row = &terms.mass_matrix[(k * n + i) * n..(k * n + i + 1) * n];
            let inertia = row.iter().zip(a).fold(<S as Real>::zero(), |sum, (&m, &a)| sum + m * a);
            generalized.push(inertia + terms.coriolis[k * n + i] - terms.dl_dq[k * n + i]);
        }
    }
    let mut found = Vec::new();
    not_finite("generalized force", &generalized, n, &mut found);
    terms.prepend_failures(found);
    terms.prepend_failures(failed);
    Ok((generalized, terms))
}

/// Forces separated into external forces and forces of constraint.
struct Held<S> {
    external: Vec<S>,
    constraint: Vec<S>,
    multipliers: Vec<S>,
    /// Failures of rows whose accelerations the constraints do not allow or the drives cannot produce.
    refused: Vec<MechanicsError>,
}

impl<S: Scalar> Held<S> {
    /// Separates the total forces, `(batch, n)`, using the friction in the terms.
    fn of(n: usize, terms: &Terms<S>, (generalized, a): (&[S], &[S]), drives: &[usize]) -> Self {
        let mut external = generalized.to_vec();
        external.iter_mut().zip(&terms.force).for_each(|(all, &friction)| *all -= friction);
        let (m, zero) = (terms.constraints, <S as Real>::zero());
        let mut held = Self { external, constraint: Vec::new(), multipliers: Vec::new(), refused: Vec::new() };
        if m == 0 {
            return held;
        }
        let rows = terms.constraint_matrix.chunks_exact(m * n).zip(terms.constraint_drift.chunks_exact(m));
        for (row, ((external, a), (matrix, drift))) in
            held.external.chunks_mut(n).zip(a.chunks(n)).zip(rows).enumerate()
        {
            let by = |x: &[S]| -> Vec<S> { matrix.chunks_exact(n).map(|row| dot(row, x)).collect() };
            let by_drives = if drives.is_empty() { None } else { driven(drives, matrix, external) };
            if by_drives.is_none() && !drives.is_empty() {
                held.refused.push(MechanicsError::Undriven { row });
            }
            let beside = by_drives.unwrap_or_else(|| vec![zero; n]);
            let rest: Vec<S> = external.iter().zip(&beside).map(|(&x, &beside)| x - beside).collect();
            let (carried, multipliers) = along_rows(n, matrix, &by(&rest));
            match drives.is_empty() {
                true => external.iter_mut().zip(&carried).for_each(|(x, &carried)| *x -= carried),
                false => external.copy_from_slice(&beside),
            }
            held.constraint.extend(carried);
            held.multipliers.extend(multipliers);
            let mut missed = by(a);
            missed.iter_mut().zip(drift).for_each(|(missed, &drift)| *missed += drift);
            let distance = length(&along_rows(n, matrix, &missed).0);
            let size = |field: &[S]| length(&field[row * n..(row + 1) * n]);
            let inertia = length(&terms.mass_matrix[row * n * n..(row + 1) * n * n]);
            let forces = size(&terms.dl_dq) + size(&terms.coriolis);
            let free = if inertia > zero { forces / inertia } else { zero };
            if distance > S::of_f64(NEAR_CONSTRAINTS) * (length(a) + length(&along_rows(n, matrix, drift).0) + free) {
                let over = |c: usize| (missed[c].abs() / length(&matrix[c * n..(c + 1) * n])).to_f64();
                let constraint = (0..m).max_by(|&b, &c| over(b).total_cmp(&over(c))).unwrap_or(0);
                held.refused.push(MechanicsError::OffConstraints { row, constraint, distance: distance.to_f64() });
            }
        }
        held
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formula_and_failures() {
        let mut terms = Terms {
            lagrangian: vec![1.0, 2.0, 3.0],
            momentum: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            dl_dq: vec![3.0, 4.0, 1.0, 1.0, 1.0, 1.0],
            coriolis: vec![1.0; 6],
            mass_matrix: vec![1.0, 0.0, 0.0, -1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 0.0, 0.0, 2.0],
            ..Terms::default()
        };
        let v = [1.0, 1.0, 2.0, 2.0, 0.0, 1.0];
        let mut workspace = Workspace::new();
        let error = terms.complete(2, &v, Request::ALL, &mut workspace).unwrap_err();
        assert_eq!(error, MechanicsError::Singular { row: 1, condition: f64::INFINITY });
        assert_eq!(terms.failures, [error]);
        assert_eq!(terms.energy, [2.0, 12.0, 3.0]);
        assert_eq!(terms.acceleration[..2], [2.0, -3.0]);
        assert!(terms.acceleration[2].is_nan() && terms.acceleration[3].is_nan());
        assert_eq!(terms.acceleration[4..], [0.0, 0.0]);
        terms.momentum[1] = f64::NAN;
        let error = terms.complete(2, &v, Request::ALL, &mut workspace).unwrap_err();
        assert_eq!(error, MechanicsError::NotFinite { row: 0, what: "momentum" });
        assert_eq!(terms.failures, [error, MechanicsError::Singular { row: 1, condition: f64::INFINITY }]);
        let error = terms.complete(3, &v, Request::ALL, &mut workspace).unwrap_err();
        assert!(matches!(error, MechanicsError::Shape { .. }));
    }

    #[test]
    fn forces_beside_those_of_the_lagrangian_accelerate() {
        let mut terms = Terms {
            dl_dq: vec![3.0, 4.0],
            coriolis: vec![1.0; 2],
            force: vec![-1.0, 2.0],
            mass_matrix: vec![2.0, 0.0, 0.0, 4.0],
            ..Terms::default()
        };
        terms.complete(2, &[1.0, 0.0], Request::ACCELERATION, &mut Workspace::new()).unwrap();
        assert_eq!(terms.acceleration, [0.5, 1.25]);
        terms.force.pop();
        let error = terms.complete(2, &[1.0, 0.0], Request::ACCELERATION, &mut Workspace::new()).unwrap_err();
        assert_eq!(error, MechanicsError::Shape { what: "generalized forces", expected: 2, found: 1 });
        terms.force = vec![f64::NAN, 0.0];
        let error = terms.complete(2, &[1.0, 0.0], Request::ACCELERATION, &mut Workspace::new()).unwrap_err();
        assert_eq!(error, MechanicsError::NotFinite { row: 0, what: "generalized force" });
    }

    #[test]
    fn forces_from_outside_are_added() {
        let mut terms = Terms {
            dl_dq: vec![3.0, 4.0, 0.0, 0.0],
            coriolis: vec![1.0, 1.0, 0.0, 0.0],
            mass_matrix: vec![2.0, 0.0, 0.0, 4.0, 1.0, 0.0, 0.0, 1.0],
            ..Terms::default()
        };
        let (v, mut workspace) = ([1.0, 2.0, 3.0, 0.0], Workspace::new());
        terms.complete(2, &v, Request::ACCELERATION, &mut workspace).unwrap();
        terms.add_force(2, &v, &[-1.0, 2.0, 5.0, 7.0], &mut workspace).unwrap();
        assert_eq!(terms.acceleration, [0.5, 1.25, 5.0, 7.0]);
        assert_eq!((terms.force, terms.dissipation), (vec![-1.0, 2.0, 5.0, 7.0], vec![-3.0, -15.0]));
        // One coordinate, with friction of the model.
        let mut one = Terms {
            mass_matrix: vec![2.0],
            acceleration: vec![1.0],
            force: vec![-0.5],
            dissipation: vec![1.5],
            ..Terms::default()
        };
        one.add_force(1, &[3.0], &[4.0], &mut workspace).unwrap();
        assert_eq!((one.acceleration[0], one.force[0], one.dissipation[0]), (3.0, 3.5, -10.5));
        let error = one.add_force(1, &[3.0], &[f64::NAN], &mut workspace).unwrap_err();
        assert_eq!(error, MechanicsError::NotFinite { row: 0, what: "external force" });
        let error = one.add_force(1, &[3.0], &[1.0, 2.0], &mut workspace).unwrap_err();
        assert_eq!(error, MechanicsError::Shape { what: "external forces", expected: 1, found: 2 });
        one.mass_matrix[0] = 0.0;
        let error = one.add_force(1, &[3.0], &[1.0], &mut workspace).unwrap_err();
        assert_eq!(error, MechanicsError::Singular { row: 0, condition: f64::INFINITY });
    }

    #[test]
    fn one_coordinate_is_divided() {
        let mut terms = Terms {
            dl_dq: vec![6.0, 1.0, 1e300],
            coriolis: vec![0.0; 3],
            mass_matrix: vec![-2.0, 0.0, 1e-300],
            ..Terms::default()
        };
        let error = terms.complete(1, &[0.0; 3], Request::ACCELERATION, &mut Workspace::new()).unwrap_err();
        assert_eq!(error, MechanicsError::Singular { row: 1, condition: f64::INFINITY });
        assert_eq!(terms.failures, [error, MechanicsError::NotFinite { row: 2, what: "acceleration" }]);
        assert_eq!(terms.acceleration[0], -3.0);
        assert!(terms.acceleration[1].is_nan() && terms.acceleration[2].is_nan());
    }
}
