//! Where the weights of a network sit in its flat parameter vector.

use crate::network::Architecture;

/// One affine map `z = W h + b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Numbers in.
    pub inputs: usize,
    /// Numbers out.
    pub outputs: usize,
    /// Offset of `W`, `(outputs, inputs)` row-major.
    pub weight: usize,
    /// Offset of `b`, `(outputs)`; the output layer has none (a constant in `L` moves nothing).
    pub bias: Option<usize>,
}

impl Layer {
    /// Range of the weight matrix.
    pub fn weight_range(&self) -> std::ops::Range<usize> {
        self.weight..self.weight + self.inputs * self.outputs
    }
    /// Range of the bias, empty if there is none.
    pub fn bias_range(&self) -> std::ops::Range<usize> {
        self.bias.map_or(0..0, |start| start..start + self.outputs)
    }
}

/// The affine maps of a network in order, the last one linear with one output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Affine maps, input to output.
    pub layers: Vec<Layer>,
    /// Length of the flat parameter vector.
    pub parameters: usize,
    /// Input features made of coordinates.
    pub position_features: usize,
}

impl Layout {
    /// Layout of an architecture.
    pub fn new(architecture: &Architecture) -> Self {
        let position_features = architecture.position_features();
        let mut layers = Vec::with_capacity(architecture.hidden.len() + 1);
        let mut inputs = position_features + architecture.coordinates;
        let mut offset = 0;
        for &outputs in &architecture.hidden {
            let bias = offset + inputs * outputs;
            layers.push(Layer { inputs, outputs, weight: offset, bias: Some(bias) });
            offset = bias + outputs;
            inputs = outputs;
        }
        layers.push(Layer { inputs, outputs: 1, weight: offset, bias: None });
        Self { layers, parameters: offset + inputs, position_features }
    }

    /// Input features: those of the coordinates, then one per velocity.
    pub fn features(&self) -> usize {
        self.layers[0].inputs
    }
    /// Hidden layers, all but the last affine map.
    pub fn hidden(&self) -> &[Layer] {
        &self.layers[..self.layers.len() - 1]
    }
    /// Weights of the linear output.
    pub fn output_range(&self) -> std::ops::Range<usize> {
        self.layers[self.layers.len() - 1].weight_range()
    }
}
