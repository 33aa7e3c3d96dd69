//! A training step allocates nothing after the first.

use crate::alone;
use crate::counting::allocations;
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer, Layout};
use lnn::optimizers::{Method, Moments, Update};
use lnn::training::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[test]
fn a_training_step_allocates_nothing_after_the_first() {
    if !alone("training_allocation::a_training_step_allocates_nothing_after_the_first") {
        return;
    }
    allocates_nothing(ActivationChoice::Gelu, InputLayer::None, None);
    allocates_nothing(ActivationChoice::QuadraticSoftplus, InputLayer::Dyt, Some(16));
}

fn allocates_nothing(activation: ActivationChoice, input_layer: InputLayer, dissipation: Option<usize>) {
    let architecture = Architecture {
        coordinates: 2,
        hidden: vec![96; 3],
        activation,
        alpha: -1.0,
        time_like: None,
        scale: vec![2.0; 2],
        periodic: vec![true; 2],
        embed_periodic: true,
        input_layer,
        dissipation,
        form: Form::default(),
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut weights: Vec<f32> = architecture.initial_weights(Initialization::Default, &mut rng);
    let mut draw = || (0..2 * 256).map(|_| rng.random_range(-2.0..2.0)).collect();
    let data = Dataset::new(2, draw(), draw(), draw()).unwrap().with_forces(draw()).unwrap();
    let rows: Vec<u32> = (0..256).collect();
    // The negative quadratic term keeps the penalty and its jets active.
    let mut objective = Objective::new(&architecture, Penalty::Eigenvalue { lambda: 1.0 }, 2).unwrap();
    let layout = Layout::new(&architecture);
    for method in [Method::Radam, Method::Soap] {
        let mut gradient = weights.clone();
        let mut moments = Moments::for_method(method, weights.len(), layout.matrices());
        let update = Update { method, rate: 1e-6, weight_decay: 1e-6, decaying: usize::MAX, clip: 1.0 };
        let mut step = || {
            let report = objective.step(&weights, &data, &rows, &mut gradient);
            assert_eq!(report.penalised, 256);
            moments.update(&mut weights, &mut gradient, &update);
        };
        (0..3).for_each(|_| step());
        let counted = allocations(|| (0..10).for_each(|_| step()));
        assert_eq!(counted, 0, "allocations in 10 steps of {} with {activation}", method.name());
    }
}
