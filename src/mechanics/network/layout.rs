//! Where the parameters of a network sit in its flat vector: a sum of branches, each a chain of layers.

use crate::lagrangian::Description;
use crate::network::{Activation, Architecture, InputLayer};
use std::ops::Range;

/// Action of a layer's weights `W` on its inputs `x`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearMap {
    /// `W x`, `W` of shape `(outputs, inputs)` row-major.
    Dense,
    /// `gamma_i x_i`, one weight per unit.
    Diagonal,
    /// `a x_i`, one weight for all units.
    Scalar,
}

/// One layer `h = act(W x + b)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Kind of the linear map.
    pub map: LinearMap,
    /// Function after the affine map, elementwise.
    pub activation: Activation,
    /// Numbers in.
    pub inputs: usize,
    /// Numbers out; as many as go in unless the map is dense.
    pub outputs: usize,
    /// Offset of `W`.
    pub weight: usize,
    /// Offset of `b`, `(outputs)`; the output layer has none (a constant in `L` moves nothing).
    pub bias: Option<usize>,
}

impl Layer {
    /// Range of the weights.
    pub fn weight_range(&self) -> Range<usize> {
        let count = match self.map {
            LinearMap::Dense => self.inputs * self.outputs,
            LinearMap::Diagonal => self.outputs,
            LinearMap::Scalar => 1,
        };
        self.weight..self.weight + count
    }
    /// Range of the bias, empty if there is none.
    pub fn bias_range(&self) -> Range<usize> {
        self.bias.map_or(0..0, |start| start..start + self.outputs)
    }
}

/// A chain of layers, the last one dense and linear: one output without a bias, or the outputs of a structure with theirs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// Layers, input to output.
    pub layers: Vec<Layer>,
}

impl Branch {
    /// All layers but the output.
    pub fn hidden(&self) -> &[Layer] {
        &self.layers[..self.layers.len() - 1]
    }
    /// Weights of the linear output.
    #[cfg(test)]
    pub fn output_range(&self) -> Range<usize> {
        self.layers[self.layers.len() - 1].weight_range()
    }
}

/// The branches of a network, whose outputs add up, one after the other in the flat parameter vector; behind them the dissipation,
/// then what stands beside the network.
///
/// Every layer holds its weights, then its biases.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Branches; all start from the input features.
    pub branches: Vec<Branch>,
    /// Length of the flat parameter vector.
    pub parameters: usize,
    /// Input features made of coordinates.
    pub position_features: usize,
    /// Input features: those of the coordinates, then one per velocity for a black box.
    pub features: usize,
    /// Parameters of the dissipation, behind those of all branches.
    pub dissipation: Option<DissipationLayout>,
    /// Parameters of the structure that stand beside the network, as `alpha` of a black box that learns it.
    pub constants: Range<usize>,
    /// Parameters of the joint friction, `(rows, n)`.
    pub joint_friction: Range<usize>,
    /// Parameters of the learned constants of a known part, the last ones.
    pub known: Range<usize>,
}

/// Where the parameters of a Rayleigh dissipation sit: `gamma`, then `w`, then `b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DissipationLayout {
    /// Units `K`.
    pub units: usize,
    /// Input features made of coordinates, `F`.
    pub features: usize,
    /// Number of coordinates `n`.
    pub coordinates: usize,
    /// Offset of the first parameter.
    pub offset: usize,
}

impl DissipationLayout {
    /// Range of `gamma`, `(K)`.
    pub fn gamma_range(&self) -> Range<usize> {
        self.offset..self.offset + self.units
    }
    /// Range of `w`, `(K, F)` row-major.
    pub fn weight_range(&self) -> Range<usize> {
        let start = self.gamma_range().end;
        start..start + self.units * self.features
    }
    /// Range of `b`, `(K, n)` row-major.
    pub fn direction_range(&self) -> Range<usize> {
        let start = self.weight_range().end;
        start..start + self.units * self.coordinates
    }
}

impl Layout {
    /// Offset, rows and columns of every dense weight matrix, in order.
    pub fn matrices(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        let layers = self.branches.iter().flat_map(|branch| &branch.layers);
        layers.filter(|layer| layer.map == LinearMap::Dense).map(|layer| (layer.weight, layer.outputs, layer.inputs))
    }
    /// Layout of an architecture: one branch per activation of its nonlinearity, each with an equal share of the widths
    /// and an input layer of its own.
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

/// A branch in the making.
struct Chain {
    layers: Vec<Layer>,
    /// Outputs of the last layer.
    width: usize,
    /// End of its parameters.
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

/// Constants of a known part that are learned.
fn learned(description: &Description) -> usize {
    description.parameters.values().filter(|parameter| parameter.learn).count()
}
