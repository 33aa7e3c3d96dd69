//! Networks and batches that the cases of training share.

use crate::common::accuracy::cast;
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer};
use lnn::scalar::{Dd, Scalar};
use lnn::tape::{Depth, Evaluation, STATES};
use lnn::training::{BatchReport, Objective};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// No coordinate is an angle: reducing it would be one more rounding of the input.
pub fn architecture(n: usize, hidden: &[usize], activation: ActivationChoice, alpha: f64) -> Architecture {
    Architecture {
        coordinates: n,
        hidden: hidden.to_vec(),
        activation,
        alpha,
        time_like: None,
        scale: (0..n).map(|i| 1.0 + 0.5 * i as f64).collect(),
        periodic: vec![false; n],
        embed_periodic: false,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    }
}

pub fn weights<S: Scalar>(architecture: &Architecture, seed: u64) -> Vec<S> {
    architecture.initial_weights(Initialization::Default, &mut ChaCha8Rng::seed_from_u64(seed))
}

pub fn states<S: Scalar>(n: usize, count: usize, seed: u64) -> Dataset<S> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |size: f64| (0..count * n).map(|_| S::of_f64(rng.random_range(-size..size))).collect();
    Dataset::new(n, draw(3.0), draw(2.0), draw(4.0)).unwrap()
}

/// Report and gradient of one step over all states.
pub fn step<S: Scalar>(
    architecture: &Architecture,
    (penalty, threads): (Penalty, usize),
    weights: &[S],
    data: &Dataset<S>,
    rows: &[u32],
) -> (BatchReport<S>, Vec<S>) {
    let mut gradient = vec![S::nan(); weights.len()];
    let report = Objective::new(architecture, penalty, threads).unwrap().step(weights, data, rows, &mut gradient);
    (report, gradient)
}

pub fn all_rows(count: usize) -> Vec<u32> {
    (0..count as u32).collect()
}

/// Scaled mass matrices of all states, in double-double.
pub fn mass_matrices<S: Scalar>(architecture: &Architecture, weights: &[S], data: &Dataset<S>) -> Vec<Dd> {
    let mut chunk = Evaluation::<Dd>::new(architecture.model().lagrangian().clone());
    let (weights, width) = (cast::<S, Dd>(weights), STATES * architecture.coordinates);
    let states = data.q().chunks(width).zip(data.v().chunks(width));
    let matrices = states.flat_map(|(q, v)| {
        chunk.evaluate(&weights, &cast::<S, Dd>(q), &cast::<S, Dd>(v), Depth::MassMatrix);
        chunk.mass_matrix.clone()
    });
    matrices.collect()
}
