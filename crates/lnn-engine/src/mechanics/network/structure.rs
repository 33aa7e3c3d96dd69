//! Structures: how a network's outputs form a Lagrangian.
//!
//! | structure | `L` | by construction |
//! |---|---|---|
//! | black box | `N(q, v) + alpha v.eta.v`, `eta = diag(1, .., 1)`, -1 for a time-like coordinate | |
//! | mechanical | `v.M(q) v/2 + A(q).v - V(q)`, `M = F F^T` | `M` positive definite |
//! | constant mass | `v.M v/2 + A(q).v - V(q)`, `M = F F^T` the same everywhere | `M` positive definite and constant, as in Cartesian coordinates |
//! | metric | `g(q)(v, v)/2`, `g = F diag(1, .., 1, -1) F^T`, space first, time last; without a time `g = F F^T` | the signature of `g` |
//!
//! The factor `F` is a triangle or a rectangle, see [`Factor`]. With the time last a triangle is the 3 + 1 split: spatial metric positive
//! definite, lapse positive, shift free. All velocities are scaled, `v_i/s_i`; except for the black box, the network takes only positions.

use super::joint_friction::JointFriction;
use crate::lagrangian::Description;
use crate::network::thresholds::{BESIDE_KNOWN, INITIAL_DIAGONAL, LEAST_DIAGONAL, RECTANGLE_ROWS};
use crate::scalar::Real;
use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Defines the choices from rows `Name "name in configurations and files";`.
macro_rules! structures {
    ($first:ident $first_text:literal $first_doc:literal; $($name:ident $text:literal $doc:literal;)*) => {
        /// Structure of a Lagrangian: how it is computed from the network's outputs.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
        #[non_exhaustive]
        pub enum Structure {
            #[doc = $first_doc]
            #[default]
            #[cfg_attr(feature = "serde", serde(rename = $first_text))]
            $first,
            $(#[doc = $doc] #[cfg_attr(feature = "serde", serde(rename = $text))] $name,)*
        }

        impl Structure {
            /// All structures.
            pub const ALL: [Self; 1 + [$($text),*].len()] = [Self::$first, $(Self::$name),*];
            /// The names of all structures, separated by commas.
            pub const NAMES: &'static str = concat!($first_text $(, ", ", $text)*);

            /// Returns the name in configuration files.
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
    /// Returns `true` if velocities are inputs of the network; its output then has no bias, because a constant in `L` has no effect.
    pub(super) fn sees_velocities(self) -> bool {
        match self {
            Self::BlackBox => true,
            Self::Mechanical | Self::ConstantMass | Self::Metric => false,
        }
    }

    /// Returns `true` if one of the coordinates can be time-like.
    fn takes_a_time(self) -> bool {
        match self {
            Self::BlackBox | Self::Metric => true,
            Self::Mechanical | Self::ConstantMass => false,
        }
    }

    /// Returns `true` if the signature of the mass matrix is fixed by construction: one negative direction for a time, all others positive.
    pub fn has_signature(self) -> bool {
        match self {
            Self::BlackBox => false,
            Self::Mechanical | Self::ConstantMass | Self::Metric => true,
        }
    }
}

/// Prior knowledge of a Lagrangian.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields, default))]
pub struct Form {
    /// Structure of the Lagrangian.
    pub structure: Structure,
    /// Factor of the kinetic energy or the metric; a triangle in files without this key.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Factor::is_triangle"))]
    pub factor: Factor,
    /// Coordinates on which `L` does not depend, so that their momenta are conserved exactly.
    pub cyclic: Vec<usize>,
    /// `true` if `L(q, -v) = L(q, v)`, so that the motion is reversible.
    pub even_in_v: bool,
    /// `true` if `alpha` of a black box is learned.
    pub learn_alpha: bool,
    /// Groups of coordinates that enter by direction and distance; empty in files without this key.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Vec::is_empty"))]
    pub radial: Vec<Radial>,
    /// A known Lagrangian, in physical units, that is added; its constants with `learn` are learned.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub known: Option<Box<Description>>,
    /// Friction of every coordinate individually; none in files without this key.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "JointFriction::is_none"))]
    pub joint_friction: JointFriction,
    /// Sizes of the parts; all are 1 in files without this key.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub sizes: Option<Sizes>,
}

/// Typical sizes of the parts of a model in scaled coordinates, so that the network's outputs are near 1. In an arm, for example, gravity
/// far exceeds inertia, and the inertia of the first joint far exceeds that of the last one.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Sizes {
    /// Factor of every scaled velocity in the kinetic energy, `(n)`: its square is the size of `M_ii`.
    pub velocity: Vec<f64>,
    /// Factor of the potential.
    pub potential: f64,
    /// Factor of the joint friction of every coordinate, `(n)`.
    pub friction: Vec<f64>,
}

impl Sizes {
    /// Returns `true` for `n` positive numbers of each kind.
    fn are_valid(&self, n: usize) -> bool {
        let all = || self.velocity.iter().chain(&self.friction).chain([&self.potential]);
        let lengths = [self.velocity.len(), self.friction.len()];
        lengths == [n, n] && all().all(|size| size.is_finite() && *size > 0.0)
    }
}

/// Cartesian coordinates `x` around a centre, resolved equally well near and far: each enters as `(x_i/R) ln(R/u)` and as `(x_i/R) (u/R)`,
/// where `R` is the distance from the centre. The features are not defined at the centre itself.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Radial {
    /// The coordinates.
    pub coordinates: Vec<usize>,
    /// Distance `u`, in the unit of the coordinates; the smallest distance in the data works well.
    pub unit: f64,
}

impl Form {
    /// Returns `true` if coordinate `i` belongs to a radial group.
    pub(crate) fn is_radial(&self, i: usize) -> bool {
        self.radial.iter().any(|group| group.coordinates.contains(&i))
    }

    /// Returns `true` if there is no prior knowledge.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Checks that the other settings are compatible with the structure, for `n` coordinates.
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

    /// Returns the number of outputs of the network for `n` coordinates, one of which is a time if `lorentzian`.
    pub(crate) fn outputs(&self, n: usize, lorentzian: bool) -> usize {
        let potentials = 1 + if self.even_in_v { 0 } else { n };
        match self.structure {
            Structure::BlackBox => 1,
            Structure::Mechanical => self.factor.numbers(n, false) + potentials,
            Structure::ConstantMass => potentials,
            Structure::Metric => self.factor.numbers(n, lorentzian),
        }
    }

    /// Returns the nonzero initial biases of the outputs, with their indices.
    pub(super) fn initial_biases(&self, n: usize, lorentzian: bool) -> Vec<(usize, f64)> {
        match self.structure {
            Structure::BlackBox | Structure::ConstantMass => Vec::new(),
            Structure::Mechanical => self.factor.initial_biases(n, false),
            Structure::Metric => self.factor.initial_biases(n, lorentzian),
        }
    }

    /// Returns the name and initial values of the parameters outside the network; `alpha` is the coefficient of the added term.
    pub(super) fn constants(&self, n: usize, alpha: f64) -> Option<(&'static str, Vec<f64>)> {
        match self.structure {
            Structure::BlackBox => self.learn_alpha.then(|| ("alpha", vec![alpha])),
            Structure::ConstantMass => {
                let mut numbers = vec![0.0; self.factor.numbers(n, false)];
                // Next to a known part the mass is small, but not zero, since it would then have no gradient.
                let size = if self.known.is_some() { BESIDE_KNOWN } else { 1.0 };
                self.factor.initial_biases(n, false).iter().for_each(|&(k, number)| numbers[k] = size * number);
                Some(("mass", numbers))
            }
            Structure::Mechanical | Structure::Metric => None,
        }
    }

    /// Computes `L` of a state, from a network that maps input features to outputs.
    pub(super) fn lagrangian<R: Real>(&self, network: impl Fn(&[R]) -> Vec<R>, state: LagrangianInputs<'_, R>) -> R {
        let LagrangianInputs { positions, velocities, constants, alpha, time_like } = state;
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

/// Inputs of a Lagrangian in addition to the network.
pub(super) struct LagrangianInputs<'a, R> {
    /// Input features computed from the coordinates.
    pub positions: &'a [R],
    /// Scaled velocities `v_i/s_i`.
    pub velocities: &'a [R],
    /// The parameters outside the network.
    pub constants: &'a [R],
    /// Coefficient of the term added to a black box, if it is not learned.
    pub alpha: f64,
    /// Index of the time-like coordinate.
    pub time_like: Option<usize>,
}

/// Factor of the quadratic form of a structure, which makes the form a sum of squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Factor {
    /// A lower triangle with the diagonal `softplus(c_ii) + 10^-3`, which gives as many squares as coordinates.
    #[default]
    Triangle,
    /// A rectangle of arbitrary numbers plus `10^-6` times the identity: three squares for every spatial coordinate, that is, the squared
    /// velocity in a space of higher dimension. It stays smooth where the diagonal of a triangle has a root. A time has a separate shift
    /// and lapse.
    Rectangle,
}

impl Factor {
    /// Returns `true` for the default in files without the key.
    fn is_triangle(&self) -> bool {
        *self == Self::Triangle
    }

    /// Returns how many numbers define a form in `n` coordinates, one of which is a time if `lorentzian`.
    pub(super) fn numbers(self, n: usize, lorentzian: bool) -> usize {
        let space = n - usize::from(lorentzian);
        match self {
            Self::Triangle => n * (n + 1) / 2,
            Self::Rectangle => RECTANGLE_ROWS * space * space + if lorentzian { n } else { 0 },
        }
    }

    /// Returns the nonzero initial biases of the numbers, with their indices: they give 1.7 times the identity.
    pub(super) fn initial_biases(self, n: usize, lorentzian: bool) -> Vec<(usize, f64)> {
        let space = n - usize::from(lorentzian);
        match self {
            Self::Triangle => (0..n).map(|i| (i * (i + 1) / 2 + i, INITIAL_DIAGONAL)).collect(),
            Self::Rectangle => {
                let lapse = lorentzian.then(|| (self.numbers(n, true) - 1, INITIAL_DIAGONAL));
                (0..space).map(|i| (i * space + i, INITIAL_DIAGONAL.exp().ln_1p())).chain(lapse).collect()
            }
        }
    }

    /// Returns the factor of the initial output weights.
    pub(super) fn variation(self) -> f64 {
        match self {
            Self::Triangle => 0.1,
            Self::Rectangle => 0.3,
        }
    }

    /// Computes half of the quadratic form of `v`. `order` is the order of the coordinates; the last one is a time with a negative square,
    /// if `lorentzian`.
    ///
    /// - Triangle: `v.C eta C^T v / 2`, the numbers those of `C`, row by row.
    /// - Rectangle: `|B w|^2 / 2 - (N v_t)^2 / 2`, `w_i = v_i + shift_i v_t`, the numbers those of `B`, row by row, then the
    ///   shift and the lapse `N`.
    fn half_form<R: Real>(self, numbers: &[R], v: &[R], order: &[usize], lorentzian: bool) -> R {
        match self {
            Self::Triangle => half_form_of_triangle(numbers, v, order, lorentzian),
            Self::Rectangle => half_form_of_rectangle(numbers, v, order, lorentzian),
        }
    }
}

/// Maps any number to a positive one.
fn positive<R: Real>(x: R) -> R {
    x.softplus() + R::of(LEAST_DIAGONAL)
}

fn half_form_of_triangle<R: Real>(triangle: &[R], v: &[R], order: &[usize], lorentzian: bool) -> R {
    let n = v.len();
    let mut half = R::zero();
    for k in 0..n {
        let along = (k..n).fold(R::zero(), |sum, i| {
            let element = triangle[i * (i + 1) / 2 + k];
            sum + if i == k { positive(element) } else { element } * v[order[i]]
        });
        let square = along.sqr() * R::half();
        half = if lorentzian && k + 1 == n { half - square } else { half + square };
    }
    half
}

fn half_form_of_rectangle<R: Real>(numbers: &[R], v: &[R], order: &[usize], lorentzian: bool) -> R {
    let space = v.len() - usize::from(lorentzian);
    let (rectangle, rest) = numbers.split_at(RECTANGLE_ROWS * space * space);
    let moved: Vec<R> = match order[space..] {
        [time] => order[..space].iter().zip(rest).map(|(&i, &shift)| v[i] + shift * v[time]).collect(),
        _ => order.iter().map(|&i| v[i]).collect(),
    };
    let square = |sum: R, x: R| sum + x.sqr();
    let along = |row: &[R]| row.iter().zip(&moved).fold(R::zero(), |sum, (&b, &w)| sum + b * w);
    let least = moved.iter().copied().fold(R::zero(), square) * R::of(LEAST_DIAGONAL * LEAST_DIAGONAL);
    let form = rectangle.chunks_exact(space.max(1)).map(along).fold(least, square);
    let form = match order[space..] {
        [time] => form - (positive(rest[space]) * v[time]).sqr(),
        _ => form,
    };
    form * R::half()
}

/// Returns the coordinates with the time-like one last.
fn time_last(n: usize, time: Option<usize>) -> Vec<usize> {
    (0..n).filter(|&i| Some(i) != time).chain(time).collect()
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

    /// With `softplus(x) + 10^-3 = 1`, a unit triangle gives the Minkowski metric, whatever the index of the time.
    #[test]
    fn a_unit_triangle_gives_the_minkowski_metric() {
        let one = (0.999_f64).exp_m1().ln();
        let triangle = [one, 0.0, one, 0.0, 0.0, one];
        for time in 0..3 {
            let order = time_last(3, Some(time));
            for i in 0..3 {
                let v: [f64; 3] = std::array::from_fn(|k| if k == i { 2.0 } else { 0.0 });
                let expected = if i == time { -2.0 } else { 2.0 };
                assert!((Factor::Triangle.half_form(&triangle, &v, &order, true) - expected).abs() < 1e-14);
            }
        }
        assert_eq!(time_last(2, None), [0, 1]);
    }

    /// Checks `|B w|^2 - (N v_t)^2`, with the shift in `w`, and `10^-6 |w|^2`, for numbers computed by hand.
    #[test]
    fn a_rectangle_is_a_sum_of_squares_with_shift_and_lapse() {
        let lapse = (2.0 - LEAST_DIAGONAL).exp_m1().ln();
        let rectangle = [1.0, 2.0, 0.0, -1.0, 3.0, 0.0, 0.0, 0.5, 0.0, 0.0, -1.0, 0.0];
        let v = [0.5, 2.0, -1.0];
        let order = time_last(3, Some(1));
        // w = (0.5 + 0.25 * 2, -1 - 0.5 * 2) = (1, -2).
        let squares = 9.0 + 4.0 + 9.0 + 1.0 + 1.0 + LEAST_DIAGONAL * LEAST_DIAGONAL * 5.0;
        let lorentzian = [&rectangle[..], &[0.25, -0.5, lapse]].concat();
        assert_eq!(lorentzian.len(), Factor::Rectangle.numbers(3, true));
        let found: f64 = Factor::Rectangle.half_form(&lorentzian, &v, &order, true);
        assert!((found - (squares - 16.0) / 2.0).abs() < 1e-13);
        // A single time-like coordinate.
        assert_eq!(
            Factor::Rectangle.half_form(&[lapse], &[1.0], &[0], true),
            -0.5 * (lapse.exp().ln_1p() + LEAST_DIAGONAL).powi(2)
        );
        let found: f64 = Factor::Rectangle.half_form(&rectangle, &[1.0, -2.0], &[0, 1], false);
        assert!((found - squares / 2.0).abs() < 1e-13);
    }
}
