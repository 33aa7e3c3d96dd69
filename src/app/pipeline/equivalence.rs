//! Measures how nearly a learned Lagrangian is equivalent to the exact one: best factor and gauge, and the remaining difference.

use crate::lagrangian::EulerLagrange;
use crate::names::percent;
use crate::pipeline::thresholds::EQUIVALENCE_STATES;
use crate::symmetry::{Basis, Chart, Comparison, SymmetryError};
use serde::Serialize;

/// The best fit `learned = f(exact) + dF/dt + constant`, and the remaining relative differences.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Equivalence {
    /// Factor that turns the learned Lagrangian, after removing the gauge, into the exact one; for geodesics at rest, for groups that of
    /// the first one. None if it is undetermined because all states are on a mass shell.
    pub factor: Option<f64>,
    /// Coefficients of `f`, starting with the first power: one, or several for geodesics.
    pub factors: Vec<f64>,
    /// Factors of groups of coordinates that do not interact, by which the exact Lagrangian is multiplied first; empty if there is one
    /// group.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub group_factors: Vec<f64>,
    /// Difference of the momenta and of the Lagrangians.
    pub lagrangian: f64,
    /// Difference of the accelerations.
    pub motion: f64,
    /// Difference of the mass matrices.
    pub mass_matrix: f64,
    /// Difference of the energies.
    pub energy: f64,
    /// Number of states compared.
    pub states: usize,
}

/// Basis of the gauge functions, and the number of states needed to compare them.
pub(crate) fn gauge_functions(names: &[String], charts: &[Chart]) -> (Basis, usize) {
    let (basis, _) = Basis::usual(names, charts);
    let states = EQUIVALENCE_STATES.max(basis.len());
    (basis, states)
}

impl Equivalence {
    /// Compares the Lagrangians at states `(states, n)`; gauge functions are combinations of `basis`.
    ///
    /// # Errors
    /// [`SymmetryError`].
    pub(crate) fn new(
        learned: &dyn EulerLagrange<f64>,
        exact: &dyn EulerLagrange<f64>,
        basis: &Basis,
        (q, v): (&[f64], &[f64]),
    ) -> Result<Self, SymmetryError> {
        let found = Comparison::of(learned, exact, basis, (q, v))?;
        let slope = found.factors.first().copied().filter(|slope| *slope != 0.0 && !found.on_shell);
        Ok(Self {
            factor: slope.map(|slope| 1.0 / (slope * found.group_factors.first().unwrap_or(&1.0))),
            group_factors: found.group_factors,
            factors: found.factors,
            lagrangian: found.lagrangian,
            motion: found.motion,
            mass_matrix: found.mass_matrix,
            energy: found.energy,
            states: q.len() / learned.coordinates().max(1),
        })
    }

    /// Returns the differences by quantity.
    pub(crate) fn differences(&self) -> [(&'static str, f64); 4] {
        [
            ("Lagrangian", self.lagrangian),
            ("motion", self.motion),
            ("mass matrix", self.mass_matrix),
            ("energy", self.energy),
        ]
    }

    /// Describes the differences in one line.
    pub(crate) fn text(&self) -> String {
        self.differences().map(|(name, distance)| format!("{name} {}", percent(distance))).join(", ")
    }
}
