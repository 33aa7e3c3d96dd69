//! Networks with states and targets, and their Lagrangian and loss as plain functions.

use super::super::common::nested::reference;
use super::super::common::{accuracy::cast, of_scalar, solve};
use lnn::data::Dataset;
use lnn::lagrangian::Lagrangian;
use lnn::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer, NetworkLagrangian};
use lnn::scalar::{Real, Scalar};
use lnn::tape::ScalarFunction;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// States and accelerations beyond this reach do not occur.
pub const REACH: f64 = 10.0;

/// A network, states and targets, all exact in `f32`.
pub struct Case {
    pub n: usize,
    pub width: usize,
    pub batch: usize,
    pub architecture: Architecture,
    pub weights: Vec<f32>,
    pub q: Vec<f32>,
    pub v: Vec<f32>,
    pub targets: Vec<f32>,
}

impl Case {
    pub fn new(n: usize, width: usize, batch: usize) -> Self {
        let architecture = Architecture {
            coordinates: n,
            hidden: vec![width; 3],
            activation: ActivationChoice::Gelu,
            alpha: 1.0,
            time_like: None,
            scale: vec![REACH; n],
            periodic: vec![false; n],
            embed_periodic: false,
            input_layer: InputLayer::None,
            dissipation: None,
            form: Form::default(),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let weights = architecture.initial_weights(Initialization::Default, &mut rng);
        let mut draw = || (0..batch * n).map(|_| rng.random_range(-REACH..REACH) as f32).collect();
        let (q, v, targets) = (draw(), draw(), draw());
        Self { n, width, batch, architecture, weights, q, v, targets }
    }

    pub fn network<S: Scalar>(&self) -> Result<NetworkLagrangian<S>, String> {
        NetworkLagrangian::new(self.architecture.clone(), cast(&self.weights)).map_err(|e| e.to_string())
    }

    pub fn data<S: Scalar>(&self) -> Result<Dataset<S>, String> {
        Dataset::new(self.n, cast(&self.q), cast(&self.v), cast(&self.targets)).map_err(|e| e.to_string())
    }

    pub fn name(&self) -> String {
        format!("n = {}, width {}, batch {}", self.n, self.width, self.batch)
    }
}

/// A Lagrangian as a function of the state `(q, v)`.
pub struct OfState<'a, S> {
    pub architecture: &'a Architecture,
    pub weights: &'a [S],
}

impl<S: Scalar> ScalarFunction for OfState<'_, S> {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let weights: Vec<R> = self.weights.iter().map(|&w| of_scalar(w)).collect();
        self.architecture.lagrangian(&weights, &x[..x.len() / 2], &x[x.len() / 2..])
    }
}

/// The paper's loss of the states of a case as a function of the weights.
pub struct OfWeights<'a>(pub &'a Case);

impl ScalarFunction for OfWeights<'_> {
    fn eval<R: Real>(&self, weights: &[R]) -> R {
        let case = self.0;
        let n = case.n;
        let constant = |x: &[f32]| -> Vec<R> { x.iter().map(|&x| of_scalar(x)).collect() };
        let states = case.q.chunks_exact(n).zip(case.v.chunks_exact(n)).zip(case.targets.chunks_exact(n));
        let total = states.fold(R::zero(), |total, ((q, v), target)| {
            let terms = reference(&case.architecture, weights, &constant(q), &constant(v));
            let force: Vec<R> = terms.g.iter().zip(&terms.c).map(|(&g, &c)| g - c).collect();
            let scaled = constant(target).into_iter().map(|t| t / R::of(REACH));
            solve(n, &terms.m, &force).into_iter().zip(scaled).fold(total, |sum, (a, t)| sum + (a - t).abs())
        });
        total / R::of((2 * n * case.batch) as f64)
    }
}
