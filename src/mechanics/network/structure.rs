//! Structures: how a Lagrangian is made of a network's outputs.
//!
//! | structure | `L` | by construction |
//! |---|---|---|
//! | black box | `N(q, v) + alpha v.eta.v`, `eta = diag(1, .., 1)`, -1 for a time-like coordinate | |
//! | mechanical | `v.M(q) v/2 + A(q).v - V(q)`, `M = F F^T` | `M` positive definite |
//! | metric | `g(q)(v, v)/2`, `g = F diag(1, .., 1, -1) F^T`, space first, time last; without a time `g = F F^T` | the signature of `g` |
//!
//! The factor `F` is a triangle or a rectangle, see [`Factor`]. With the time last a triangle is the 3 + 1 split: spatial metric
//! positive definite, lapse positive, shift free. All velocities are scaled, `v_i/s_i`; the network of a mechanical Lagrangian or a
//! metric sees positions alone.

use super::factor::Factor;
use crate::lagrangian::Description;
use serde::{Deserialize, Serialize};

/// Structure of a Lagrangian: how it is made of the network's outputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Structure {
    /// The paper's: one output, a function of positions and velocities.
    #[default]
    BlackBox,
    /// Kinetic energy, vector potential and potential, functions of the positions.
    Mechanical,
    /// The metric of geodesics, a function of the positions.
    Metric,
}

impl Structure {
    /// Every structure.
    pub const ALL: [Self; 3] = [Self::BlackBox, Self::Mechanical, Self::Metric];

    /// The name in configuration files.
    pub fn name(self) -> &'static str {
        match self {
            Self::BlackBox => "black-box",
            Self::Mechanical => "mechanical",
            Self::Metric => "metric",
        }
    }
}

/// Knowledge of a Lagrangian beforehand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Form {
    /// Structure of a Lagrangian: how it is made of the network's outputs.
    pub structure: Structure,
    /// Factor of the kinetic energy or the metric; files without this key have a triangle.
    #[serde(skip_serializing_if = "Factor::is_triangle")]
    pub factor: Factor,
    /// Coordinates that `L` does not depend on: their momenta are conserved exactly.
    pub cyclic: Vec<usize>,
    /// `true` if `L(q, -v) = L(q, v)`: the motion can be run backwards.
    pub even_in_v: bool,
    /// `true` if `alpha` of a black box is learned.
    pub learn_alpha: bool,
    /// Groups of coordinates that enter by direction and distance; files without this key have none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub radial: Vec<Radial>,
    /// A Lagrangian that is known, in physical units, and added; its constants marked `learn` are learned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known: Option<Box<Description>>,
}

/// Cartesian coordinates `x` around a centre, seen near and far alike: each enters as `(x_i/R) ln(R/u)` and as `(x_i/R) (u/R)`, `R` the
/// distance from the centre. At the centre itself there is no feature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radial {
    /// The coordinates.
    pub coordinates: Vec<usize>,
    /// Distance `u`, in the unit of the coordinates: that of the nearest states serves well.
    pub unit: f64,
}

impl Form {
    /// `true` if coordinate `i` belongs to a radial group.
    pub(crate) fn is_radial(&self, i: usize) -> bool {
        self.radial.iter().any(|group| group.coordinates.contains(&i))
    }

    /// `true` if nothing is known.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Outputs of the network for `n` coordinates, one of them a time if `lorentzian`.
    pub(crate) fn outputs(&self, n: usize, lorentzian: bool) -> usize {
        match self.structure {
            Structure::BlackBox => 1,
            Structure::Mechanical => self.factor.numbers(n, false) + 1 + if self.even_in_v { 0 } else { n },
            Structure::Metric => self.factor.numbers(n, lorentzian),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_agree_with_serde() {
        for structure in Structure::ALL {
            assert_eq!(serde_json::to_string(&structure).unwrap(), format!("\"{}\"", structure.name()));
        }
    }
}
