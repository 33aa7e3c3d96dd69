//! The constraints of a Lagrangian and its degenerate directions.

use super::ConstraintKind;
use crate::lagrangian::{EulerLagrange, ReducedMass, Request, Terms, project};
use serde::Serialize;
use std::collections::BTreeMap;

/// Constraints and degenerate directions of a Lagrangian.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ExaminedLagrangian {
    /// Name of the system.
    pub system: String,
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// Number of constraints.
    pub count: usize,
    /// The constraints of the system.
    pub constraints: Vec<OwnConstraint>,
    /// Redundant constraints, which follow from the others.
    pub redundant: Vec<String>,
    /// Largest number of degenerate directions at a state.
    pub open: usize,
    /// States that were examined.
    pub states: usize,
    /// Number of examined states with degenerate directions.
    pub open_states: usize,
    /// The degenerate directions at a state with the most of them.
    pub null_directions: Vec<Vec<f64>>,
    /// Positive and negative eigenvalues of the mass matrix within the constraints, at the first state.
    pub signature: Option<[usize; 2]>,
}

/// A constraint of a system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OwnConstraint {
    /// Its kind.
    pub kind: ConstraintKind,
    /// Its name.
    pub name: String,
    /// The formula that vanishes; empty where none is known.
    pub formula: String,
}

/// Examines the Lagrangian of a system with these coordinates at states `(states, n)`, each projected onto the constraints; `formulas` are
/// the formulas of the constraints, by name.
///
/// States without a finite mass matrix are left out; `states` is 0 if that leaves none.
pub fn examine(
    (system, coordinates): (&str, &[String]),
    model: &dyn EulerLagrange<f64>,
    formulas: &BTreeMap<String, String>,
    (q, v): (&[f64], &[f64]),
) -> ExaminedLagrangian {
    let n = model.coordinates();
    let (system, coordinates) = (system.to_string(), coordinates.to_vec());
    let mut examined = ExaminedLagrangian { system, coordinates, ..ExaminedLagrangian::default() };
    if let Some(manifold) = model.manifold() {
        examined.redundant = manifold.redundant().to_vec();
        examined.constraints = (0..manifold.names().len())
            .map(|row| {
                let (name, holonomic) = (manifold.names()[row].clone(), manifold.is_holonomic(row));
                let kind = if holonomic { ConstraintKind::Holonomic } else { ConstraintKind::Nonholonomic };
                let formula = formulas.get(&name).cloned().unwrap_or_default();
                OwnConstraint { kind, name, formula }
            })
            .collect();
        examined.count = examined.constraints.len();
    }
    let mut terms = Terms::default();
    for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
        let (mut q, mut v) = (q.to_vec(), v.to_vec());
        if model.manifold().is_some_and(|manifold| project(manifold, &mut q, &mut v).is_err()) {
            continue;
        }
        if model.terms(&q, &v, Request::MASS_MATRIX | Request::CONSTRAINTS, &mut terms).is_err() {
            continue;
        }
        let Ok(reduced) = ReducedMass::of(n, &terms.mass_matrix, &terms.constraint_matrix) else { continue };
        examined.states += 1;
        let open = reduced.null_directions();
        examined.open_states += usize::from(!open.is_empty());
        if open.len() > examined.open {
            examined.open = open.len();
            examined.null_directions = open.into_iter().map(<[f64]>::to_vec).collect();
        }
        let negative = reduced.eigenvalues.iter().filter(|w| **w < 0.0).count();
        examined.signature.get_or_insert([reduced.eigenvalues.len() - negative, negative]);
    }
    examined
}
