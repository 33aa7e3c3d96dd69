//! How nearly a learned Lagrangian is equivalent to the exact one: the best factor and gauge, and the remaining difference.

use crate::lagrangian::EulerLagrange;
use crate::names::percent;
use crate::pipeline::thresholds::EQUIVALENCE_STATES;
use crate::symmetry::{Basis, Chart, SymmetryError, compare};
use serde::Serialize;

/// Best `learned = f(exact) + dF/dt + constant`, and the relative differences that remain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Equivalence {
    /// Factor that turns the learned Lagrangian, after removing the gauge, into the exact one; for geodesics at rest, for groups that of
    /// the first one. None if it is undetermined because all states are on a mass shell.
    pub factor: Option<f64>,
    /// Coefficients of `f`, from the first power: one, or of geodesics several.
    pub factors: Vec<f64>,
    /// Factors of groups of coordinates that do not act on each other, taken out of the exact Lagrangian first; empty for one group.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub group_factors: Vec<f64>,
    /// Difference of momenta and values.
    pub lagrangian: f64,
    /// Difference of the accelerations.
    pub motion: f64,
    /// Difference of the mass matrices.
    pub mass_matrix: f64,
    /// Difference of the energies.
    pub energy: f64,
    /// States compared.
    pub states: usize,
}

/// Functions that gauge functions are made of, and how many states are compared for them.
pub(crate) fn gauge_functions(names: &[String], charts: &[Chart]) -> (Basis, usize) {
    let (basis, _) = Basis::usual(names, charts);
    let states = EQUIVALENCE_STATES.max(basis.len());
    (basis, states)
}

impl Equivalence {
    /// Compares at states `(states, n)`; gauge functions are over `basis`.
    ///
    /// # Errors
    /// [`SymmetryError`].
    pub(crate) fn new(
        learned: &dyn EulerLagrange<f64>,
        exact: &dyn EulerLagrange<f64>,
        basis: &Basis,
        (q, v): (&[f64], &[f64]),
    ) -> Result<Self, SymmetryError> {
        let found = compare(learned, exact, basis, (q, v))?;
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

    /// Differences by quantity.
    pub(crate) fn differences(&self) -> [(&'static str, f64); 4] {
        [
            ("Lagrangian", self.lagrangian),
            ("motion", self.motion),
            ("mass matrix", self.mass_matrix),
            ("energy", self.energy),
        ]
    }

    /// The differences in a line.
    pub(crate) fn text(&self) -> String {
        self.differences().map(|(name, distance)| format!("{name} {}", percent(distance))).join(", ")
    }
}
