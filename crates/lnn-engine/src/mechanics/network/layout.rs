//! Positions of the parameters of a network in its flat vector, for a sum of branches that are chains of layers; and initial weights.

use crate::lagrangian::Description;
use crate::network::thresholds::{INITIAL_FRICTION, INITIAL_TANH_SCALE, NEAR_ZERO_FACTOR};
use crate::network::{Activation, Architecture, Initialization, InputLayer};
use crate::scalar::{Real, Scalar};
use alloc::vec::Vec;
use core::ops::Range;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// How a layer's weights `W` act on its inputs `x`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearMap {
    /// `W x`, with `W` of shape `(outputs, inputs)`, row-major.
    Dense,
    /// `gamma_i x_i`, with one weight per unit.
    Diagonal,
    /// `a x_i`, with one weight for all units.
    Scalar,
}

/// One layer `h = act(W x + b)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Kind of the linear map.
    pub map: LinearMap,
    /// Activation, applied elementwise after the affine map.
    pub activation: Activation,
    /// Number of inputs.
    pub inputs: usize,
    /// Number of outputs; equal to the number of inputs unless the map is dense.
    pub outputs: usize,
    /// Offset of `W`.
    pub weight: usize,
    /// Offset of `b`, `(outputs)`; `None` for the output layer of a single number, since a constant in `L` has no effect.
    pub bias: Option<usize>,
}

impl Layer {
    /// Returns the range of the weights.
    pub fn weight_range(&self) -> Range<usize> {
        let count = match self.map {
            LinearMap::Dense => self.inputs * self.outputs,
            LinearMap::Diagonal => self.outputs,
            LinearMap::Scalar => 1,
        };
        self.weight..self.weight + count
    }
    /// Returns the range of the bias, which may be empty.
    pub fn bias_range(&self) -> Range<usize> {
        self.bias.map_or(0..0, |start| start..start + self.outputs)
    }
}

/// A chain of layers, the last of which is dense and linear: one output without a bias, or the outputs of a structure with biases.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// Layers from input to output.
    pub layers: Vec<Layer>,
}

impl Branch {
    /// Returns all layers except the output.
    pub fn hidden(&self) -> &[Layer] {
        &self.layers[..self.layers.len() - 1]
    }
    /// Returns the range of the weights of the linear output.
    #[cfg(test)]
    pub fn output_range(&self) -> Range<usize> {
        self.layers[self.layers.len() - 1].weight_range()
    }
}

/// The flat parameter vector: first the branches of a network, whose outputs are added, then the dissipation, then the parameters of a
/// known part.
///
/// For every layer the weights come before the biases.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Branches, which all have the same input features.
    pub branches: Vec<Branch>,
    /// Length of the flat parameter vector.
    pub parameters: usize,
    /// Number of input features computed from coordinates.
    pub position_features: usize,
    /// Number of all input features; a black box has one more per velocity.
    pub features: usize,
    /// Parameters of the dissipation, which follow those of all branches.
    pub dissipation: Option<DissipationLayout>,
    /// Parameters of the structure outside the network, such as a learned `alpha` of a black box.
    pub constants: Range<usize>,
    /// Parameters of the joint friction, `(rows, n)`.
    pub joint_friction: Range<usize>,
    /// Parameters for the learned constants of a known part, which come last.
    pub known: Range<usize>,
}

/// Positions of the parameters of a Rayleigh dissipation: `gamma`, then `w`, then `b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DissipationLayout {
    /// Number of units `K`.
    pub units: usize,
    /// Number of input features computed from coordinates, `F`.
    pub features: usize,
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Offset of the first parameter.
    pub offset: usize,
}

impl DissipationLayout {
    /// Returns the range of `gamma`, `(K)`.
    pub fn gamma_range(&self) -> Range<usize> {
        self.offset..self.offset + self.units
    }
    /// Returns the range of `w`, `(K, F)`, row-major.
    pub fn weight_range(&self) -> Range<usize> {
        let start = self.gamma_range().end;
        start..start + self.units * self.features
    }
    /// Returns the range of `b`, `(K, n)`, row-major.
    pub fn direction_range(&self) -> Range<usize> {
        let start = self.weight_range().end;
        start..start + self.units * self.coordinates
    }
}

impl Layout {
    /// Returns offset, rows and columns of every dense weight matrix, in order.
    pub fn matrices(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        let layers = self.branches.iter().flat_map(|branch| &branch.layers);
        layers.filter(|layer| layer.map == LinearMap::Dense).map(|layer| (layer.weight, layer.outputs, layer.inputs))
    }
    /// Computes the layout of an architecture: one branch per activation, each with an equal share of the widths and a separate input
    /// layer.
    pub fn new(architecture: &Architecture) -> Self {
        let position_features = architecture.position_features();
        let (n, form) = (architecture.coordinates, &architecture.form);
        let sees_velocities = form.structure.sees_velocities();
        let features = position_features + if sees_velocities { n } else { 0 };
        let activations = architecture.activation.branches();
        let mut parameters = 0;
        let mut branches = Vec::with_capacity(activations.len());
        for &activation in activations {
            let mut chain = Chain { layers: Vec::new(), width: features, offset: parameters };
            match architecture.input_layer {
                InputLayer::None => {}
                InputLayer::Dyt => {
                    chain.push(LinearMap::Scalar, Activation::Tanh, features, false);
                    chain.push(LinearMap::Diagonal, Activation::Identity, features, true);
                }
            }
            for &width in &architecture.hidden {
                chain.push(LinearMap::Dense, activation, width / activations.len(), true);
            }
            chain.push(LinearMap::Dense, Activation::Identity, architecture.outputs(), !sees_velocities);
            parameters = chain.offset;
            branches.push(Branch { layers: chain.layers });
        }
        let dissipation = architecture.dissipation.map(|units| DissipationLayout {
            units,
            features: position_features,
            coordinates: architecture.coordinates,
            offset: parameters,
        });
        let parameters = dissipation.map_or(parameters, |dissipation| dissipation.direction_range().end);
        let constants = architecture.own_constants().map_or(0, |(_, initial)| initial.len());
        let constants = parameters..parameters + constants;
        let friction = form.joint_friction.rows() * n;
        let joint_friction = constants.end..constants.end + friction;
        let parameters = joint_friction.end;
        let learned = form.known.as_ref().map_or(0, |known| learned(known));
        let known = parameters..parameters + learned;
        let parameters = known.end;
        Self { branches, parameters, position_features, features, dissipation, constants, joint_friction, known }
    }
}

/// A branch under construction.
struct Chain {
    layers: Vec<Layer>,
    /// Number of outputs of the last layer.
    width: usize,
    /// End of its parameters so far.
    offset: usize,
}

impl Chain {
    fn push(&mut self, map: LinearMap, activation: Activation, outputs: usize, has_bias: bool) {
        let mut layer = Layer { map, activation, inputs: self.width, outputs, weight: self.offset, bias: None };
        self.offset = layer.weight_range().end;
        if has_bias {
            layer.bias = Some(self.offset);
            self.offset += outputs;
        }
        self.width = outputs;
        self.layers.push(layer);
    }
}

/// Returns the number of learned constants in a known part.
fn learned(description: &Description) -> usize {
    description.parameters.values().filter(|parameter| parameter.learn).count()
}

impl Architecture {
    /// Draws the flat parameters of a network; the same generator state gives the same weights in every precision.
    ///
    /// Every branch is drawn separately, with its own widths and gains; the gain of a linear layer is 1. The parameters of an input layer are
    /// not random: `a = 0.5`, `gamma = 1`, `beta = 0`.
    ///
    /// The parameters of a dissipation are drawn last, so that all others do not depend on it: `gamma = -5`, `w = 0`, and `b` of length 1 in
    /// random directions.
    ///
    /// Unless near zero, a structure starts with a tenth (a rectangle: three tenths) of these output weights, and with the output biases that
    /// give 1.7 times the identity.
    pub fn initial_weights<S: Scalar>(&self, kind: Initialization, rng: &mut impl Rng) -> Vec<S> {
        let layout = Layout::new(self);
        let mut weights = vec![<S as Real>::zero(); layout.parameters];
        for branch in &layout.branches {
            let dense = || branch.layers.iter().filter(|layer| layer.map == LinearMap::Dense);
            let count = dense().count();
            for (k, layer) in dense().enumerate() {
                let place = if k + 1 == count { Place::Output } else { Place::Hidden(k) };
                draw(layer, place, kind, rng, &mut weights);
            }
            for layer in &branch.layers {
                match layer.map {
                    LinearMap::Dense => {}
                    LinearMap::Diagonal => weights[layer.weight_range()].fill(<S as Real>::one()),
                    LinearMap::Scalar => weights[layer.weight_range()].fill(S::of_f64(INITIAL_TANH_SCALE)),
                }
            }
        }
        if self.form.structure.has_signature() && kind != Initialization::NearZero {
            start_near_identity(&layout, &self.initial_biases(), self.form.factor.variation(), &mut weights);
        }
        let constants = self.own_constants().map_or(Vec::new(), |(_, initial)| initial);
        for (place, initial) in layout.constants.clone().zip(constants) {
            weights[place] = S::of_f64(initial);
        }
        let joints = self.form.joint_friction.initial(self.coordinates);
        for (place, initial) in layout.joint_friction.clone().zip(joints) {
            weights[place] = S::of_f64(initial);
        }
        if let Some(dissipation) = layout.dissipation {
            weights[dissipation.gamma_range()].fill(S::of_f64(INITIAL_FRICTION));
            for row in weights[dissipation.direction_range()].chunks_exact_mut(dissipation.coordinates) {
                draw_direction(rng, row);
            }
        }
        weights
    }
}

/// Initializes a structure with a mass matrix near 1.7 times the identity and almost no forces. A random metric would have curvature forces
/// at every velocity, which training would have to remove first.
fn start_near_identity<S: Scalar>(layout: &Layout, biases: &[(usize, f64)], variation: f64, weights: &mut [S]) {
    for (k, branch) in layout.branches.iter().enumerate() {
        let output = &branch.layers[branch.layers.len() - 1];
        weights[output.weight_range()].iter_mut().for_each(|w| *w *= S::of_f64(variation));
        let bias = &mut weights[output.bias_range()];
        bias.fill(<S as Real>::zero());
        if k == 0 {
            biases.iter().for_each(|&(index, number)| bias[index] = S::of_f64(number));
        }
    }
}

/// Draws a vector of length 1 with a uniformly distributed direction.
fn draw_direction<S: Scalar>(rng: &mut impl Rng, direction: &mut [S]) {
    let normal: Vec<f64> = direction.iter().map(|_| StandardNormal.sample(rng)).collect();
    // The length is never 0, unless the generator returns only zeros.
    let length = normal.iter().map(|x: &f64| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    for (x, normal) in direction.iter_mut().zip(normal) {
        *x = S::of_f64(normal / length);
    }
}

/// The position of a dense layer in its branch.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    /// Hidden layer, counted from 0.
    Hidden(usize),
    /// Linear output.
    Output,
}

/// Draws the parameters of a dense layer; `weights` contains all parameters and is initially zero.
fn draw<S: Scalar>(layer: &Layer, place: Place, kind: Initialization, rng: &mut impl Rng, weights: &mut [S]) {
    let side = if kind == Initialization::Cranmer { layer.inputs.max(layer.outputs) } else { layer.inputs };
    let root = (side as f64).sqrt();
    let deviation = match (kind, place) {
        (Initialization::Default | Initialization::NearZero, _) => {
            let bound = root.recip();
            let near_zero = kind == Initialization::NearZero && place == Place::Output;
            let factor = if near_zero { NEAR_ZERO_FACTOR } else { 1.0 };
            for w in layer.weight_range().chain(layer.bias_range()) {
                weights[w] = S::of_f64(factor * rng.random_range(-bound..=bound));
            }
            return;
        }
        (Initialization::VariancePreserving, _) => layer.activation.variance_gain() / root,
        (Initialization::Cranmer | Initialization::CranmerPaper, Place::Hidden(0)) => 2.2 / root,
        (Initialization::Cranmer, Place::Hidden(k)) => 0.58 * k as f64 / root,
        (Initialization::CranmerPaper, Place::Hidden(k)) => 0.58 * (k + 1) as f64 / root,
        (Initialization::Cranmer | Initialization::CranmerPaper, Place::Output) => root,
    };
    for w in layer.weight_range() {
        let normal: f64 = StandardNormal.sample(rng);
        weights[w] = S::of_f64(deviation * normal);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{ActivationChoice, Factor, Form, Structure};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn architecture(activation: ActivationChoice) -> Architecture {
        Architecture {
            coordinates: 2,
            hidden: vec![300, 200],
            activation,
            alpha: 0.0,
            time_like: None,
            scale: vec![1.0; 2],
            periodic: vec![false; 2],
            embed_periodic: false,
            input_layer: InputLayer::None,
            dissipation: None,
            form: Form::default(),
        }
    }

    fn drawn(architecture: &Architecture, kind: Initialization) -> Vec<f64> {
        architecture.initial_weights(kind, &mut ChaCha8Rng::seed_from_u64(1))
    }

    fn root_mean_square(numbers: &[f64]) -> f64 {
        (numbers.iter().map(|w| w * w).sum::<f64>() / numbers.len().max(1) as f64).sqrt()
    }

    /// Checks that a sample deviation is within four standard errors for `count` weights.
    fn near(found: f64, expected: f64, count: usize) {
        assert!((found / expected - 1.0).abs() < 4.0 / (2.0 * count as f64).sqrt(), "{found} for {expected}");
    }

    /// Compares deviations of weights and biases, for a single network and for both branches of a hybrid, with `expected(widths,
    /// activation)`: weights and biases of every layer.
    fn every_branch_follows(kind: Initialization, expected: impl Fn([f64; 3], Activation) -> [[f64; 2]; 3]) {
        for choice in [ActivationChoice::Softplus, ActivationChoice::XTanh, ActivationChoice::QuadraticSoftplus] {
            let architecture = architecture(choice);
            let weights = drawn(&architecture, kind);
            let branches = Layout::new(&architecture).branches;
            assert_eq!(branches.len(), choice.branches().len());
            for (branch, &activation) in branches.iter().zip(choice.branches()) {
                let share = branches.len() as f64;
                let expected = expected([4.0, 300.0 / share, 200.0 / share], activation);
                assert_eq!(branch.layers.len(), 3);
                for (layer, [weight, bias]) in branch.layers.iter().zip(expected) {
                    let (range, biases) = (layer.weight_range(), layer.bias_range());
                    near(root_mean_square(&weights[range.clone()]), weight, range.len());
                    if bias == 0.0 {
                        assert!(weights[biases].iter().all(|&b| b == 0.0));
                    } else {
                        near(root_mean_square(&weights[biases.clone()]), bias, biases.len());
                    }
                }
            }
        }
    }

    /// Returns the standard deviation of a uniform distribution within the inverse root of the fan-in.
    fn uniform(fan_in: f64) -> f64 {
        (3.0 * fan_in).sqrt().recip()
    }

    #[test]
    fn default_weights_are_uniform_within_the_inverse_root_of_the_fan_in() {
        every_branch_follows(Initialization::Default, |n, _| {
            [[uniform(n[0]); 2], [uniform(n[1]); 2], [uniform(n[2]), 0.0]]
        });
    }

    #[test]
    fn variance_preserving_weights_have_the_gain_of_their_own_activation() {
        every_branch_follows(Initialization::VariancePreserving, |n, activation| {
            let gain = activation.variance_gain();
            [[gain / n[0].sqrt(), 0.0], [gain / n[1].sqrt(), 0.0], [n[2].sqrt().recip(), 0.0]]
        });
    }

    #[test]
    fn cranmer_weights_follow_the_code_of_their_author() {
        every_branch_follows(Initialization::Cranmer, |n, _| {
            // The larger sides of the maps are the first width twice, then the second.
            [[2.2 / n[1].sqrt(), 0.0], [0.58 / n[1].sqrt(), 0.0], [n[2].sqrt(), 0.0]]
        });
        deep_maps_deviate_by(Initialization::Cranmer, [2.2 / 10.0, 0.58 / 10.0, 1.16 / 10.0, 1.74 / 10.0, 10.0]);
    }

    #[test]
    fn cranmer_weights_of_the_paper_count_all_maps_and_take_the_fan_in() {
        every_branch_follows(Initialization::CranmerPaper, |n, _| {
            [[2.2 / n[0].sqrt(), 0.0], [1.16 / n[1].sqrt(), 0.0], [n[2].sqrt(), 0.0]]
        });
        deep_maps_deviate_by(Initialization::CranmerPaper, [1.1, 1.16 / 10.0, 1.74 / 10.0, 2.32 / 10.0, 10.0]);
    }

    /// Compares the deviations of the maps of four layers of 100.
    fn deep_maps_deviate_by(kind: Initialization, expected: [f64; 5]) {
        let deeper = Architecture { hidden: vec![100; 4], ..architecture(ActivationChoice::Gelu) };
        let weights = drawn(&deeper, kind);
        let layers = &Layout::new(&deeper).branches[0].layers;
        assert_eq!(layers.len(), expected.len());
        for (layer, expected) in layers.iter().zip(expected) {
            let range = layer.weight_range();
            near(root_mean_square(&weights[range.clone()]), expected, range.len());
        }
    }

    #[test]
    fn near_zero_weights_are_the_default_ones_with_a_small_output() {
        for choice in [ActivationChoice::Gelu, ActivationChoice::QuadraticSoftplus] {
            let architecture = Architecture { input_layer: InputLayer::Dyt, ..architecture(choice) };
            let mut expected = drawn(&architecture, Initialization::Default);
            for branch in Layout::new(&architecture).branches {
                expected[branch.output_range()].iter_mut().for_each(|w| *w *= 0.01);
            }
            assert_eq!(drawn(&architecture, Initialization::NearZero), expected);
        }
    }

    /// Initially `M` is 1.7 times the identity with an error of a third, or of two for a rectangle, whatever the position. For a black box
    /// it depends on `alpha`.
    #[test]
    fn a_structure_begins_with_a_nearly_constant_mass_matrix() {
        use crate::lagrangian::{EulerLagrange, Request, Terms};
        for (factor, bound) in [(Factor::Triangle, 1.0 / 3.0), (Factor::Rectangle, 2.0 / 3.0)] {
            let form = Form { structure: Structure::Mechanical, factor, ..Form::default() };
            let architecture = Architecture { form, ..architecture(ActivationChoice::Gelu) };
            let weights = drawn(&architecture, Initialization::Default);
            let model = crate::network::NetworkLagrangian::new(architecture, weights).unwrap();
            let mut terms = Terms::default();
            let q: Vec<f64> = (0..40).map(|k| (1.7 * f64::from(k)).sin() * 3.0).collect();
            model.terms(&q, &[1.0; 40], Request::ALL, &mut terms).unwrap();
            let diagonal = (1.0_f64.exp().ln_1p() + 1e-3).powi(2);
            for m in terms.mass_matrix.chunks_exact(4) {
                let off = [m[0] - diagonal, m[1], m[2], m[3] - diagonal];
                assert!(off.iter().all(|x| x.abs() < diagonal * bound), "{m:?}");
            }
        }
    }

    #[test]
    fn a_dissipation_is_drawn_after_the_lagrangian_and_starts_small() {
        for kind in [Initialization::Default, Initialization::Cranmer] {
            let plain = architecture(ActivationChoice::QuadraticSoftplus);
            let damped = Architecture { dissipation: Some(40), ..plain.clone() };
            let (without, with) = (drawn(&plain, kind), drawn(&damped, kind));
            let (lagrangian, friction) = with.split_at(without.len());
            assert_eq!(lagrangian, without);
            let (gamma, rest) = friction.split_at(40);
            let (weight, direction) = rest.split_at(40 * 2);
            assert!(gamma.iter().all(|&g| g == -5.0) && weight.iter().all(|&w| w == 0.0));
            assert_eq!(direction.len(), 40 * 2);
            assert!(direction.chunks(2).all(|b| (b[0].hypot(b[1]) - 1.0).abs() < 4.0 * f64::EPSILON));
            // For a mean of 40 unit vectors, each component has the standard error sqrt(1/2/40).
            for i in 0..2 {
                let mean = direction.iter().skip(i).step_by(2).sum::<f64>() / 40.0;
                assert!(mean.abs() < 4.0 * (0.5f64 / 40.0).sqrt(), "{mean}");
            }
        }
    }

    #[test]
    fn an_input_layer_starts_as_stated_and_draws_nothing() {
        for choice in [ActivationChoice::Gelu, ActivationChoice::QuadraticSoftplus] {
            let plain = architecture(choice);
            let dyt = Architecture { input_layer: InputLayer::Dyt, ..plain.clone() };
            for kind in [
                Initialization::Default,
                Initialization::VariancePreserving,
                Initialization::Cranmer,
                Initialization::CranmerPaper,
                Initialization::NearZero,
            ] {
                let (with, without) = (drawn(&dyt, kind), drawn(&plain, kind));
                let mut rest = without.as_slice();
                for branch in Layout::new(&dyt).branches {
                    let start = branch.layers[0].weight;
                    assert_eq!(with[start..start + 9], [0.5, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
                    let own;
                    (own, rest) = rest.split_at(branch.output_range().end - start - 9);
                    assert_eq!(with[start + 9..branch.output_range().end], *own);
                }
                assert!(rest.is_empty());
            }
        }
    }
}
