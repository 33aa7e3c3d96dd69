//! Structures: how a Lagrangian is made of a network's outputs.
//!
//! | structure | `L` | by construction |
//! |---|---|---|
//! | black box | `N(q, v) + alpha v.eta.v`, `eta = diag(1, .., 1)`, -1 for a time-like coordinate | |
//! | mechanical | `v.M(q) v/2 + A(q).v - V(q)`, `M = F F^T` | `M` positive definite |
//! | constant mass | `v.M v/2 + A(q).v - V(q)`, `M = F F^T` the same everywhere | `M` positive definite and constant, as in Cartesian coordinates |
//! | metric | `g(q)(v, v)/2`, `g = F diag(1, .., 1, -1) F^T`, space first, time last; without a time `g = F F^T` | the signature of `g` |
//!
//! The factor `F` is a triangle or a rectangle, see [`Factor`]. With the time last a triangle is the 3 + 1 split: spatial metric
//! positive definite, lapse positive, shift free. All velocities are scaled, `v_i/s_i`; the network of every
//! structure but the black box sees positions alone.

use super::factor::{Factor, time_last};
use super::joint_friction::JointFriction;
use crate::lagrangian::Description;
use crate::scalar::Real;
use serde::{Deserialize, Serialize};

/// Builds the choice from rows `Name "name in configurations and files";`.
macro_rules! structures {
    ($first:ident $first_text:literal $first_doc:literal; $($name:ident $text:literal $doc:literal;)*) => {
        /// Structure of a Lagrangian: how it is made of the network's outputs.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum Structure {
            #[doc = $first_doc]
            #[default]
            #[serde(rename = $first_text)]
            $first,
            $(#[doc = $doc] #[serde(rename = $text)] $name,)*
        }

        impl Structure {
            /// Every structure.
            pub const ALL: [Self; 1 + [$($text),*].len()] = [Self::$first, $(Self::$name),*];
            /// The names of all structures, separated by commas.
            pub const NAMES: &'static str = concat!($first_text $(, ", ", $text)*);

            /// The name in configuration files.
            pub fn name(self) -> &'static str {
                match self {
                    Self::$first => $first_text,
                    $(Self::$name => $text,)*
                }
            }
        }
    };
}

structures! {
    BlackBox "black-box" "The paper's: one output, a function of positions and velocities.";
    Mechanical "mechanical" "Kinetic energy, vector potential and potential, functions of the positions.";
    ConstantMass "constant-mass" "A constant mass matrix, as in Cartesian coordinates; vector potential and potential are functions of the positions.";
    Metric "metric" "The metric of geodesics, a function of the positions.";
}

impl Structure {
    /// `true` if the network sees the velocities; its output has no bias then, for a constant in `L` moves nothing.
    pub(super) fn sees_velocities(self) -> bool {
        match self {
            Self::BlackBox => true,
            Self::Mechanical | Self::ConstantMass | Self::Metric => false,
        }
    }

    /// `true` if one coordinate may be a time.
    fn takes_a_time(self) -> bool {
        match self {
            Self::BlackBox | Self::Metric => true,
            Self::Mechanical | Self::ConstantMass => false,
        }
    }

    /// `true` if the mass matrix has its signature by construction: one negative direction for a time, all others positive.
    pub(crate) fn has_signature(self) -> bool {
        match self {
            Self::BlackBox => false,
            Self::Mechanical | Self::ConstantMass | Self::Metric => true,
        }
    }
}

/// Initial factor of a constant mass matrix beside a known Lagrangian.
const BESIDE_KNOWN: f64 = 0.01;

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
    /// Friction of every coordinate by itself; files without this key have none.
    #[serde(skip_serializing_if = "JointFriction::is_none")]
    pub joint_friction: JointFriction,
    /// Sizes of the parts; files without this key have all of size 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sizes: Option<Sizes>,
}

/// Usual sizes of the parts of a model, in scaled coordinates, so that a network learns numbers near 1: in an arm gravity is far above
/// inertia, and the inertia of the first joint far above that of the last one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sizes {
    /// Factor of every scaled velocity in the kinetic energy, `(n)`: its square is the size of `M_ii`.
    pub velocity: Vec<f64>,
    /// Factor of the potential.
    pub potential: f64,
    /// Factor of the joint friction of every coordinate, `(n)`.
    pub friction: Vec<f64>,
}

impl Sizes {
    /// `true` for `n` positive numbers of each kind.
    fn are_valid(&self, n: usize) -> bool {
        let all = || self.velocity.iter().chain(&self.friction).chain([&self.potential]);
        let lengths = [self.velocity.len(), self.friction.len()];
        lengths == [n, n] && all().all(|size| size.is_finite() && *size > 0.0)
    }
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

    /// Checks what the structure asks of the rest, for `n` coordinates.
    pub(super) fn check(&self, n: usize, time_like: Option<usize>) -> Result<(), String> {
        let (structure, name) = (self.structure, self.structure.name());
        if time_like.is_some() && !structure.takes_a_time() {
            return Err(format!(
                "expected no time-like coordinate for `{name}`; `{}` has one",
                Structure::Metric.name()
            ));
        }
        if !structure.sees_velocities() && (0..n).all(|i| self.cyclic.contains(&i)) {
            return Err(format!("expected a coordinate that is not cyclic for `{name}`"));
        }
        if self.learn_alpha && structure != Structure::BlackBox {
            return Err(format!("expected no learned alpha for `{name}`, which has no such term"));
        }
        if self.sizes.as_ref().is_some_and(|sizes| !sizes.are_valid(n)) {
            return Err(format!("expected {n} positive sizes of each kind"));
        }
        Ok(())
    }

    /// Outputs of the network for `n` coordinates, one of them a time if `lorentzian`.
    pub(crate) fn outputs(&self, n: usize, lorentzian: bool) -> usize {
        let potentials = 1 + if self.even_in_v { 0 } else { n };
        match self.structure {
            Structure::BlackBox => 1,
            Structure::Mechanical => self.factor.numbers(n, false) + potentials,
            Structure::ConstantMass => potentials,
            Structure::Metric => self.factor.numbers(n, lorentzian),
        }
    }

    /// Initial biases of the outputs, those other than 0 with their indices.
    pub(super) fn initial_biases(&self, n: usize, lorentzian: bool) -> Vec<(usize, f64)> {
        match self.structure {
            Structure::BlackBox | Structure::ConstantMass => Vec::new(),
            Structure::Mechanical => self.factor.initial_biases(n, false),
            Structure::Metric => self.factor.initial_biases(n, lorentzian),
        }
    }

    /// Name and initial values of the parameters that stand beside the network; `alpha` is the factor of the added term.
    pub(super) fn constants(&self, n: usize, alpha: f64) -> Option<(&'static str, Vec<f64>)> {
        match self.structure {
            Structure::BlackBox => self.learn_alpha.then(|| ("alpha", vec![alpha])),
            Structure::ConstantMass => {
                let mut numbers = vec![0.0; self.factor.numbers(n, false)];
                // Beside a known part a small mass, though none at all would have no gradient.
                let size = if self.known.is_some() { BESIDE_KNOWN } else { 1.0 };
                self.factor.initial_biases(n, false).iter().for_each(|&(k, number)| numbers[k] = size * number);
                Some(("mass", numbers))
            }
            Structure::Mechanical | Structure::Metric => None,
        }
    }

    /// `L` of a state, from a network that gives its outputs for input features.
    pub(super) fn lagrangian<R: Real>(&self, network: impl Fn(&[R]) -> Vec<R>, state: State<'_, R>) -> R {
        let State { positions, velocities, constants, alpha, time_like } = state;
        let (n, factor) = (velocities.len(), self.factor);
        let sized: Vec<R>;
        let (moving, potential) = match &self.sizes {
            Some(sizes) => {
                sized = velocities.iter().zip(&sizes.velocity).map(|(&v, &size)| v * R::of(size)).collect();
                (&sized[..], R::of(sizes.potential))
            }
            None => (velocities, R::one()),
        };
        let with_potentials = |kinetic: R, potentials: &[R]| {
            let height = if self.sizes.is_some() { potential * potentials[0] } else { potentials[0] };
            let linear = potentials[1..].iter().zip(moving);
            linear.fold(kinetic - height, |sum, (&a, &v)| sum + a * v)
        };
        match self.structure {
            Structure::BlackBox => {
                let at = |sign: R| {
                    let moved = velocities.iter().map(|&v| sign * v);
                    network(&positions.iter().copied().chain(moved).collect::<Vec<_>>())[0]
                };
                let learned = if self.even_in_v { (at(R::one()) + at(-R::one())) * R::half() } else { at(R::one()) };
                let signed = |(i, &v): (usize, &R)| if time_like == Some(i) { -(v * v) } else { v * v };
                let squares = moving.iter().enumerate().map(signed).fold(R::zero(), |sum, square| sum + square);
                let learned = if self.sizes.is_some() { potential * learned } else { learned };
                learned + constants.first().map_or(R::of(alpha), |&alpha| alpha) * squares
            }
            Structure::Mechanical => {
                let outputs = network(positions);
                let (numbers, potentials) = outputs.split_at(factor.numbers(n, false));
                with_potentials(factor.half_form(numbers, moving, &time_last(n, None), false), potentials)
            }
            Structure::ConstantMass => {
                with_potentials(factor.half_form(constants, moving, &time_last(n, None), false), &network(positions))
            }
            Structure::Metric => {
                factor.half_form(&network(positions), moving, &time_last(n, time_like), time_like.is_some())
            }
        }
    }
}

/// What a Lagrangian is made of beside the network.
pub(super) struct State<'a, R> {
    /// Input features made of the coordinates.
    pub positions: &'a [R],
    /// Scaled velocities `v_i/s_i`.
    pub velocities: &'a [R],
    /// The parameters that stand beside the network.
    pub constants: &'a [R],
    /// Factor of the added term of a black box that does not learn it.
    pub alpha: f64,
    /// The coordinate that is a time.
    pub time_like: Option<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_agree_with_serde() {
        for structure in Structure::ALL {
            assert_eq!(serde_json::to_string(&structure).unwrap(), format!("\"{}\"", structure.name()));
            assert!(Structure::NAMES.split(", ").any(|name| name == structure.name()));
        }
    }
}
