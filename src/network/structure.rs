//! Structures: how a Lagrangian is made of a network's outputs.
//!
//! | structure | `L` | by construction |
//! |---|---|---|
//! | black box | `N(q, v) + alpha v.eta.v`, `eta = diag(1, .., 1)`, -1 for a time-like coordinate | |
//! | mechanical | `v.M(q) v/2 + A(q).v - V(q)`, `M = C C^T` | `M` positive definite |
//! | metric | `g(q)(v, v)/2`, `g = C diag(1, .., 1, -1) C^T`, space first, time last; without a time `g = C C^T` | the signature of `g` |
//!
//! `C` is lower triangular, its diagonal `softplus(c_ii) + 10^-3` positive. With the time last the factors are the 3 + 1 split:
//! spatial metric positive definite, lapse positive, shift free. All velocities are scaled, `v_i/s_i`; the network of a mechanical
//! Lagrangian or a metric sees positions alone.

use crate::lagrangian::Description;
use crate::scalar::Real;
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

    /// Outputs of the network for `n` coordinates.
    pub(crate) fn outputs(&self, n: usize) -> usize {
        let triangle = n * (n + 1) / 2;
        match self.structure {
            Structure::BlackBox => 1,
            Structure::Mechanical => triangle + 1 + if self.even_in_v { 0 } else { n },
            Structure::Metric => triangle,
        }
    }
}

/// Smallest diagonal element of a triangular factor.
const LEAST: f64 = 1e-3;

/// `v.C eta C^T v / 2` with `C` from the numbers of its lower triangle, row by row; `order` is the order of the coordinates in
/// `C`, the last one counted negative if it is a time.
pub(super) fn quadratic_form<R: Real>(triangle: &[R], v: &[R], order: &[usize], lorentzian: bool) -> R {
    let n = v.len();
    let mut half = R::zero();
    for k in 0..n {
        let along = (k..n).fold(R::zero(), |sum, i| {
            let element = triangle[i * (i + 1) / 2 + k];
            let element = if i == k { element.softplus() + R::from_f64(LEAST) } else { element };
            sum + element * v[order[i]]
        });
        let square = along.sqr() * R::half();
        half = if lorentzian && k + 1 == n { half - square } else { half + square };
    }
    half
}

/// The coordinates with the time-like one last.
pub(super) fn time_last(n: usize, time: Option<usize>) -> Vec<usize> {
    (0..n).filter(|&i| Some(i) != time).chain(time).collect()
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

    /// `softplus(x) + 10^-3 = 1`: a unit triangle gives the Minkowski metric, whatever the place of the time.
    #[test]
    fn a_unit_triangle_gives_the_minkowski_metric() {
        let one = (0.999_f64).exp_m1().ln();
        let triangle = [one, 0.0, one, 0.0, 0.0, one];
        for time in 0..3 {
            let order = time_last(3, Some(time));
            for i in 0..3 {
                let v: [f64; 3] = std::array::from_fn(|k| if k == i { 2.0 } else { 0.0 });
                let expected = if i == time { -2.0 } else { 2.0 };
                assert!((quadratic_form(&triangle, &v, &order, true) - expected).abs() < 1e-14);
            }
        }
        assert_eq!(time_last(2, None), [0, 1]);
    }
}
